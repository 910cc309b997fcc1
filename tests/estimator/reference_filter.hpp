// The extended Kalman filter of SocEstimator without its guards: the same equations for the 1RC model, in any form of
// the covariance (UdCovariance, EigenCovariance). It checks no input, keeps no hypotheses and sums the charge in S.
#pragma once

#include <array>
#include <cstdint>

#include "estimator/voltage_uncertainty.hpp"
#include "model/extended_rc.hpp"

namespace bms::tests {

/// Lasting: whether the overpotential of the last half hour counts, as the estimator's monitor has it.
template <class S, class Covariance, bool Lasting = true>
class ReferenceFilter {
  using Model = typename model::ExtendedRc<0, 0>::template Of<S>;

 public:
  /// At rest. v_rc_sigma_v: standard deviation of the RC voltage.
  ReferenceFilter(S soc, S soc_sigma, S v_rc_sigma_v) : soc_(soc) {
    covariance_.set_diagonal({v_rc_sigma_v * v_rc_sigma_v, soc_sigma * soc_sigma});
  }

  /// One sample, duration_s after the one before. Returns the state of charge.
  template <class Cell>
  S step(const Cell& cell, S current_a, S voltage_v, S duration_s) {
    const model::StepInput<S> input{current_a, duration_s};
    const model::LawSet<S> laws;
    soc_ += current_a * cell.limits.soc_per_as * duration_s;
    const auto at = look_up(cell, soc_, interval_);
    const auto discretisation = Model::discretise(laws, x_, at, input);
    auto q = Model::noise(laws, discretisation, cell.noise);
    const S white = cell.noise.white_soc_per_s * duration_s;
    q[Model::soc] = white * white + cell.noise.walk_soc2_per_s * duration_s;
    covariance_.propagate(Model::state_transition(x_, at, discretisation, input), q);
    x_ = Model::advance(x_, at, discretisation, input);

    const S correlated = cell.noise.model_correlation_s / duration_s, samples = correlated > S(1) ? correlated : S(1);
    const S predicted_v = Model::voltage(laws, x_, at, input), overpotential_v = predicted_v - at.ocv_v;
    const S error = cell.noise.resistance_error, drop_v2 = estimator::drop_variance_v2<S>(at, current_a, error);
    if constexpr (Lasting) watch(overpotential_v, duration_s);
    const auto correction = covariance_.observe(
        Model::measurement_jacobian(laws, at, input),
        cell.noise.voltage_v2 + (at.error_v2 + drop_v2 + lasting_v_ * lasting_v_ * error * error) * samples,
        voltage_v - predicted_v);
    x_[0] += correction[0];
    soc_ += correction[Model::soc];
    return soc_;
  }

  S soc_variance() const { return covariance_.template variance<Model::soc>(); }
  S v_rc_v() const { return x_[0]; }

 private:
  /// The mean overpotential of half an hour, from the samples whose time crosses a multiple of 2^26 us.
  void watch(S overpotential_v, S duration_s) {
    const std::uint32_t before_us = time_us_;
    time_us_ += static_cast<std::uint32_t>(duration_s * S(1e6));
    if (last_us_ == 0)
      last_us_ = time_us_;
    else if ((time_us_ ^ before_us) >> 26 != 0) {
      lasting_v_ += (overpotential_v - lasting_v_) * (S(time_us_ - last_us_) * S(1e-6 / 1'800));
      last_us_ = time_us_;
    }
  }

  Covariance covariance_;
  typename Model::State x_{};
  S soc_, lasting_v_{};
  std::uint32_t time_us_ = 0, last_us_ = 0;
  std::uint8_t interval_ = 0;
};

}  // namespace bms::tests
