// Where an estimate begins when nobody says where: the state of charge that a first voltage tells, with what it leaves
// open.
//
// The voltage, less half of what the present current may have built up in the RC branch, is a reading of the OCV curve
// with a standard deviation. Every soc from 0 to 1 is held possible and weighed by how well its OCV fits; mean and
// standard deviation of that distribution are the start. On the plateau that is a wide band, as it should be.
//
// Cost: one pass over 256 points, once.
#pragma once

#include <cstddef>

#include "estimator/voltage_uncertainty.hpp"
#include "model/one_rc.hpp"

namespace bms::estimator {

/// A state of charge and how sure it is.
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

/// What speaks against a soc: a reading of the OCV, a belief, or both. All >= 0.
template <class S, class Cell>
struct StartMisfit {
  const Cell& cell;
  const arithmetic::Voltage<S>* ocv_v;  ///< the reading; nullptr: none
  arithmetic::Variance<S> variance_v2;  ///< of it
  const SocDistribution<S>* before;     ///< nullptr: none; else with a deviation of at least two points' spacing

  /// half_step: half the spacing of the points that it is asked for.
  constexpr arithmetic::Exponent<S> operator()(const arithmetic::Soc<S>& soc, const arithmetic::Fraction<S>& half_step,
                                               std::uint8_t& interval) const {
    using namespace model;
    Exponent<S> misfit(0);
    if (ocv_v != nullptr) {
      const auto at = look_up(cell, soc, interval);
      const Voltage<S> off_v = *ocv_v - at.ocv_v;
      // half a point's width on the curve counts as uncertainty too: steep parts have few points
      const Voltage<S> half_width_v = product<Voltage<S>>(ocv_slope<S>(at), half_step);
      const Variance<S> two_variances = variance_v2 + variance_v2 + product<Variance<S>>(half_width_v, half_width_v);
      misfit = ratio<Exponent<S>>(Variance<S>(off_v * off_v), two_variances);
    }
    if (before == nullptr) return misfit;
    const Soc<S> off = soc - before->soc;
    const auto of_belief = ratio<Exponent<S>>(Variance<S>(off * off), Variance<S>(before->variance + before->variance));
    const Exponent<S> mistaken(
        8);  // one belief in 3,000 is wrong altogether: a voltage that speaks clearly against it wins
    return Exponent<S>(misfit + (of_belief < mistaken ? of_belief : mistaken));
  }
};

/// Mean and variance of soc.
template <class S, class Cell>
constexpr SocDistribution<S> soc_from(const StartMisfit<S, Cell>& speaks_against) {
  using namespace model;
  constexpr int points = start_points;
  const Fraction<S> spacing(1.0 / points), half_step(0.5 / points);
  const auto point = [&](int k) { return Soc<S>(Current<S>(2 * k + 1) * half_step); };
  std::uint8_t interval = 0;
  const auto misfit = [&](int k) { return speaks_against(point(k), half_step, interval); };
  // misfit of the best point is taken off all of them, so that a voltage outside the curve still has weights
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
  // the points' own spacing is the least that can be known
  const Variance<S> variance = Variance<S>(ratio<Fraction<S>>(second, weights)) + Variance<S>(spacing * spacing);
  return {mean, variance};
}

}  // namespace bms::estimator
