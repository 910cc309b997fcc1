// The extended Kalman filter of SocEstimator without its guards: the same equations for the 1RC model, in any form of
// the covariance (UdCovariance, EigenCovariance). It checks no input, keeps no hypotheses and sums the charge in S.
#pragma once

#include <array>
#include <cstdint>

#include "estimator/voltage_uncertainty.hpp"
#include "model/extended_rc.hpp"

namespace bms::tests {

template <class S, class Covariance>
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
    const S drop_v2 = estimator::drop_variance_v2<S>(at, current_a, cell.noise.resistance_error);
    const auto correction = covariance_.observe(Model::measurement_jacobian(laws, at, input),
                                                cell.noise.voltage_v2 + (at.error_v2 + drop_v2) * samples,
                                                voltage_v - Model::voltage(laws, x_, at, input));
    x_[0] += correction[0];
    soc_ += correction[Model::soc];
    return soc_;
  }

  S soc_variance() const { return covariance_.template variance<Model::soc>(); }
  S v_rc_v() const { return x_[0]; }

 private:
  Covariance covariance_;
  typename Model::State x_{};
  S soc_;
  std::uint8_t interval_ = 0;
};

}  // namespace bms::tests
