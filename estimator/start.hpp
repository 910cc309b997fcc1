// The first state of charge, from a rested voltage, with the uncertainty that it leaves.
//
// The voltage, minus half of the voltage that the present current may have built up in the RC branch, is a reading of
// the OCV curve with a standard deviation. Every SOC from 0 to 1 is weighted by how well its OCV fits; the start is the
// mean and standard deviation of this distribution. On the plateau that is a wide band, as it should be.
//
// Cost: one pass over 256 points, once.
#pragma once

#include <cstddef>

#include "estimator/voltage_uncertainty.hpp"
#include "model/one_rc.hpp"

namespace bms::estimator {

/// A state of charge with its variance.
template <class S>
struct SocDistribution {
  arithmetic::Soc<S> soc;
  arithmetic::Variance<S> variance;
};

/// Voltage of the RC branch at the start.
template <class S>
struct StartPolarisation {
  arithmetic::Voltage<S> v_rc_v;
  arithmetic::Variance<S> variance_v2;
};

/// Nobody knows how long the present current has flowed. The RC branch is assumed to be charged to half of its final
/// voltage, with a standard deviation of the same size; the current before that adds to it (noise.current_unknown_a).
template <class S>
constexpr StartPolarisation<S> start_polarisation(const model::TablePoint<S>& at,
                                                  const arithmetic::Current<S>& current_a,
                                                  const model::FilterNoise<S>& noise) {
  using namespace model;
  const Voltage<S> half_v = at.r1_ohm * Fraction<S>(0.5) * current_a;
  const Voltage<S> before_v = at.r1_ohm * noise.unknown_a;
  return {half_v, Variance<S>(half_v * half_v) + Variance<S>(before_v * before_v)};
}

inline constexpr int start_points = 256;

/// Misfit of a SOC to a reading of the OCV, to a prior, or to both; >= 0.
template <class S, class Cell>
struct StartMisfit {
  const Cell& cell;
  const arithmetic::Voltage<S>* ocv_v;  ///< the reading; nullptr if it is missing
  arithmetic::Variance<S> variance_v2;  ///< of the reading
  const SocDistribution<S>*
      before;  ///< the prior, with a standard deviation of two points' spacing or more; nullptr if it is missing

  /// half_step: half the spacing of the points for which this is called.
  constexpr arithmetic::Exponent<S> operator()(const arithmetic::Soc<S>& soc, const arithmetic::Fraction<S>& half_step,
                                               std::uint8_t& interval) const {
    using namespace model;
    Exponent<S> misfit(0);
    if (ocv_v != nullptr) {
      const auto at = look_up(cell, soc, interval);
      const Voltage<S> off_v = *ocv_v - at.ocv_v;
      // half a point's width on the curve counts as uncertainty as well: steep parts have few points
      const Voltage<S> half_width_v = product<Voltage<S>>(ocv_slope<S>(at), half_step);
      const Variance<S> two_variances = variance_v2 + variance_v2 + product<Variance<S>>(half_width_v, half_width_v);
      misfit = ratio<Exponent<S>>(Variance<S>(off_v * off_v), two_variances);
    }
    if (before == nullptr) return misfit;
    const Soc<S> off = soc - before->soc;
    const auto of_prior = ratio<Exponent<S>>(Variance<S>(off * off), Variance<S>(before->variance + before->variance));
    const Exponent<S> most(8);  // one prior in 3,000 is entirely wrong: a voltage that clearly contradicts it wins
    return Exponent<S>(misfit + (of_prior < most ? of_prior : most));
  }
};

/// Mean and variance of the SOC, weighted by exp(-misfit).
template <class S, class Cell>
constexpr SocDistribution<S> soc_from(const StartMisfit<S, Cell>& misfit_of) {
  using namespace model;
  constexpr int points = start_points;
  const Fraction<S> spacing(1.0 / points), half_step(0.5 / points);
  const auto point = [&](int k) { return Soc<S>(Current<S>(2 * k + 1) * half_step); };
  std::uint8_t interval = 0;
  const auto misfit = [&](int k) { return misfit_of(point(k), half_step, interval); };
  // the smallest misfit is subtracted from all, so that a voltage outside the curve still has weights
  Exponent<S> least = misfit(0);
  for (int k = 1; k < points; ++k) {
    const Exponent<S> m = misfit(k);
    if (m < least) least = m;
  }
  Variance<S> weights{}, first{}, second{};  // the widest type: sums of 256 weights of at most 1/256
  for (int k = 0; k < points; ++k) {
    const Fraction<S> weight = (Fraction<S>(1) - step_response<S>(Exponent<S>(misfit(k) - least))) * spacing;
    weights = Variance<S>(weights + weight);
    first = Variance<S>(first + weight * point(k));
  }
  const Soc<S> mean = ratio<Soc<S>>(first, weights);
  for (int k = 0; k < points; ++k) {
    const Soc<S> off = point(k) - mean;
    const Fraction<S> weight = (Fraction<S>(1) - step_response<S>(Exponent<S>(misfit(k) - least))) * spacing;
    second = Variance<S>(second + weight * Fraction<S>(off * off));
  }
  // the spacing of the points limits the accuracy
  const Variance<S> variance = Variance<S>(ratio<Fraction<S>>(second, weights)) + Variance<S>(spacing * spacing);
  return {mean, variance};
}

}  // namespace bms::estimator
