// From a voltage to a state of charge: the slope of the OCV, the voltage drop over the resistances, and the uncertainty
// of both.
#pragma once

#include <cstddef>
#include <cstdint>

#include "model/extended_rc.hpp"

namespace bms::estimator {

/// Slope of the OCV at one point of the tables.
template <class S>
constexpr arithmetic::VoltagePerSoc<S> ocv_slope(const model::TablePoint<S>& at) {
  return arithmetic::VoltagePerSoc<S>(at.ocv_delta_v * at.per_width);
}

/// Drop over R0 and R1 under a current that lasts.
template <class S>
constexpr arithmetic::Voltage<S> steady_state_drop_v(const model::TablePoint<S>& at,
                                                     const arithmetic::Current<S>& current_a) {
  return arithmetic::Voltage<S>(arithmetic::Voltage<S>(at.r0_ohm * current_a) +
                                arithmetic::Voltage<S>(at.r1_ohm * current_a));
}

/// Variance of that drop. resistance_error: relative standard deviation of the resistances.
template <class S, class Error>
constexpr arithmetic::Variance<S> drop_variance_v2(const model::TablePoint<S>& at,
                                                   const arithmetic::Current<S>& current_a,
                                                   const Error& resistance_error) {
  const arithmetic::Voltage<S> sigma_v =
      arithmetic::product<arithmetic::Voltage<S>>(steady_state_drop_v<S>(at, current_a), resistance_error);
  return sigma_v * sigma_v;
}

/// Variance that those states before the SOC for which counts(k) is true give a voltage, as if they were independent.
/// h: measurement Jacobian.
template <class Model, class Counts>
constexpr auto sum_variance(const typename Model::Variances& variances, const typename Model::MeasurementJacobian& h,
                            Counts&& counts) {
  using Variance = typename Model::Variances::value_type;
  Variance sum{};
  for (std::size_t k = 0; k < Model::soc; ++k) {
    if (counts(k))
      sum = Variance(sum + arithmetic::product<Variance>(arithmetic::product<Variance>(variances[k], h[k]), h[k]));
  }
  return sum;
}

/// Variance of the OCV from the uncertainty of the tables' SOC axis (tolerance.initial_soc).
template <class S>
constexpr arithmetic::Variance<S> soc_axis_variance(const model::FilterNoise<S>& noise,
                                                    const model::TablePoint<S>& at) {
  return arithmetic::Variance<S>(at.error_v2 - noise.model_v2);
}

/// The same for a deviation off_v of a voltage from `at` that may be large. The curve is steep over few per cent only,
/// so its secant over three standard deviations of the axis counts, on the side of the deviation, and from empty to
/// full. at: of `tables` at soc, which is in `interval`.
template <class S, class Tables>
constexpr arithmetic::Variance<S> soc_axis_variance(const Tables& tables, const model::FilterNoise<S>& noise,
                                                    const model::TablePoint<S>& at, const arithmetic::Soc<S>& soc,
                                                    const arithmetic::Voltage<S>& off_v, std::uint8_t interval) {
  using namespace arithmetic;
  constexpr double sigmas = 3;
  const bool below = off_v < Voltage<S>(0);
  const Soc<S> end(below ? 0 : 1), three = Soc<S>(noise.soc_axis + noise.soc_axis + noise.soc_axis);
  if (below ? !(soc > end) : !(soc < end)) return Variance<S>{};
  Soc<S> there = below ? Soc<S>(soc - three) : Soc<S>(soc + three);
  if (below ? there < end : there > end) there = end;
  const Voltage<S> sigma_v = Voltage<S>(look_up(tables, there, interval).ocv_v - at.ocv_v) * Fraction<S>(1 / sigmas);
  return sigma_v * sigma_v;
}

/// Variance of the model's error as noise of one voltage reading. Errors: persistent_errors.hpp; Constants: those of
/// the step (step_constants.hpp).
template <class S, class Errors, class Constants>
constexpr arithmetic::Variance<S> model_noise_v2(const model::FilterNoise<S>& noise, const model::TablePoint<S>& at,
                                                 const arithmetic::Current<S>& current_a, const Constants& constants) {
  using Variance = arithmetic::Variance<S>;
  const arithmetic::Voltage<S> drop_v = steady_state_drop_v<S>(at, current_a);
  const Variance error_v2 = Errors::error_in_noise(noise, at.error_v2, [&] { return soc_axis_variance<S>(noise, at); });
  return Variance(arithmetic::product<Variance>(error_v2, constants.correlated_samples()) +
                  arithmetic::product<Variance>(Variance(drop_v * drop_v), constants.resistance_noise()));
}

}  // namespace bms::estimator
