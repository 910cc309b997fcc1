// The first state of charge, from a rested voltage, with the uncertainty that it leaves.
//
// Nobody knows how long the present current has flowed, and what flowed before (noise.current_unknown_a). The voltage,
// minus half of the voltage that the present current may have built up in the RC branch, is a reading of
// the OCV curve with a standard deviation. Both follow the resistances at each SOC. Every SOC from 0 to 1 is weighted
// by how well its OCV fits; the start is the mean and standard deviation of this distribution. On the plateau that is a
// wide band, as it should be.
//
// Cost: two passes over 256 points, once.
#pragma once

#include <cstddef>

#include "estimator/soc_bank.hpp"
#include "estimator/voltage_uncertainty.hpp"
#include "model/one_rc.hpp"

namespace bms::estimator {

/// A state of charge with its variance.
template <class S>
struct SocDistribution {
  arithmetic::Soc<S> soc;
  arithmetic::Variance<S> variance;
};

inline constexpr double rests_below_c = 0.01;  ///< current of a cell at rest, in capacities per hour

template <class S>
constexpr bool rests(const arithmetic::Current<S>& current_a, const model::FilterNoise<S>& noise) {
  return arithmetic::magnitude(current_a) <
         arithmetic::Current<S>(noise.one_c_a * arithmetic::Fraction<S>(rests_below_c));
}

inline constexpr int start_points = 256;

/// How often a prior is entirely wrong: then every SOC is as probable, and a voltage that clearly contradicts the prior
/// wins.
enum class WrongPrior : std::uint8_t {
  one_in_ten_thousand,  ///< for an estimate with a sigma: that of a right start. A normal distribution cannot state the
                        ///< chance of a wrong one; with one in a hundred a sigma of 2 % would become 2.8 %
  one_in_a_hundred,     ///< for a bank, which can state it
  even_odds,            ///< whoever checks a prior takes no side: a wrong SOC that lasts is worse than a wide sigma
};

/// Misfit of a SOC if the prior is wrong, above that of the prior's mean: ln(odds / (sqrt(2 pi) sigma)), >= 0.
template <class S>
constexpr arithmetic::Exponent<S> wrong_prior_misfit(const arithmetic::Variance<S>& variance, WrongPrior wrong) {
  using Misfit = arithmetic::Current<S>;
  constexpr double of_one_thousandth = 5.9888, ln_100 = 4.6052;  // of_one_thousandth: ln(1 / (sqrt(2 pi) 0.001))
  auto misfit = Misfit(Misfit(of_one_thousandth) - SocBank<S>::half_log(variance));
  if (wrong != WrongPrior::even_odds)
    misfit = Misfit(misfit + Misfit(wrong == WrongPrior::one_in_a_hundred ? ln_100 : 2 * ln_100));
  return arithmetic::Exponent<S>(misfit > Misfit(0) ? misfit : Misfit(0));
}

/// Misfit of a SOC to a prior, >= 0, with the interface of StartMisfit.
template <class S>
struct PriorMisfit {
  SocDistribution<S> before;  ///< with a standard deviation of two points' spacing or more
  WrongPrior wrong = WrongPrior::one_in_a_hundred;

  constexpr arithmetic::Exponent<S> operator()(const arithmetic::Soc<S>& soc, const arithmetic::Fraction<S>&,
                                               std::uint8_t&) const {
    const arithmetic::Soc<S> off = soc - before.soc;
    const auto of_prior = arithmetic::ratio<arithmetic::Exponent<S>>(
        arithmetic::Variance<S>(off * off), arithmetic::Variance<S>(before.variance + before.variance));
    const auto most = wrong_prior_misfit<S>(before.variance, wrong);
    return of_prior < most ? of_prior : most;
  }
};

template <class Cell>
constexpr const auto& noise_of(const Cell& cell) {
  if constexpr (requires { cell.cell.noise; })
    return cell.cell.noise;
  else
    return cell.noise;
}

/// The first voltage less what the present current explains, as a reading of the OCV.
template <class S>
struct OcvReading {
  arithmetic::Voltage<S> ocv_v{};
  arithmetic::Variance<S> v2{};        ///< of the reading
  arithmetic::Variance<S> above_v2{};  ///< the same for a reading above the curve

  /// The same at every SOC.
  template <class At>
  constexpr const OcvReading& operator()(const At&) const {
    return *this;
  }
};

/// Misfit of a SOC to a reading of the OCV, to a prior, or to both; >= 0. Reading: the OcvReading from the tables at a
/// SOC, since the resistances there decide on what a current left.
template <class S, class Cell, class Reading = OcvReading<S>>
struct StartMisfit {
  const Cell& cell;
  const Reading* reading;            ///< nullptr if it is missing
  const SocDistribution<S>* before;  ///< the prior, as in PriorMisfit; nullptr if it is missing
  WrongPrior wrong = WrongPrior::one_in_ten_thousand;

  /// half_step: half the spacing of the points for which this is called.
  constexpr arithmetic::Exponent<S> operator()(const arithmetic::Soc<S>& soc, const arithmetic::Fraction<S>& half_step,
                                               std::uint8_t& interval) const {
    using namespace model;
    Exponent<S> misfit(0);
    if (reading != nullptr) {
      const auto at = look_up(cell, soc, interval);
      const OcvReading<S> read = (*reading)(at);
      const Voltage<S> off_v = read.ocv_v - at.ocv_v;
      const Variance<S> one_v2 = Variance<S>((off_v > Voltage<S>(0) ? read.above_v2 : read.v2) +
                                             soc_axis_variance<S>(cell, noise_of(cell), at, soc, off_v));
      // half a point's width on the curve counts as uncertainty as well: steep parts have few points
      const Voltage<S> half_width_v = product<Voltage<S>>(ocv_slope<S>(at), half_step);
      const Variance<S> two_variances = one_v2 + one_v2 + product<Variance<S>>(half_width_v, half_width_v);
      misfit = ratio<Exponent<S>>(Variance<S>(off_v * off_v), two_variances);
    }
    if (before == nullptr) return misfit;
    return Exponent<S>(misfit + PriorMisfit<S>{*before, wrong}(soc, half_step, interval));
  }
};

/// Mean and variance of the SOC, weighted by exp(-misfit).
template <class S, class Cell, class Reading>
constexpr SocDistribution<S> soc_from(const StartMisfit<S, Cell, Reading>& misfit_of) {
  using namespace model;
  constexpr int points = start_points;
  const Fraction<S> spacing(1.0 / points), half_step(0.5 / points);
  const auto point = [&](int k) { return Soc<S>(Current<S>(2 * k + 1) * half_step); };
  std::uint8_t interval = 0;
  const auto misfit = [&](int k) { return misfit_of(point(k), half_step, interval); };
  // the smallest misfit is subtracted from all, so that a voltage outside the curve still has weights
  Exponent<S> least = misfit(0);
  Soc<S> best = point(0);
  for (int k = 1; k < points; ++k) {
    const Exponent<S> m = misfit(k);
    if (!(m < least)) continue;
    least = m;
    best = point(k);
  }
  Variance<S> weights{}, first{}, second{};  // the widest type: sums of 256 weights of at most 1/256
  for (int k = 0; k < points; ++k) {
    const Fraction<S> weight = (Fraction<S>(1) - step_response<S>(Exponent<S>(misfit(k) - least))) * spacing;
    const Soc<S> off = point(k) - best;
    weights = Variance<S>(weights + weight);
    first = Variance<S>(first + weight * point(k));
    second = Variance<S>(second + weight * Fraction<S>(off * off));
  }
  const Soc<S> mean = ratio<Soc<S>>(first, weights), off = mean - best;
  const Variance<S> about_mean = Variance<S>(Variance<S>(ratio<Fraction<S>>(second, weights)) - Variance<S>(off * off));
  // the spacing of the points limits the accuracy
  const Variance<S> variance =
      (about_mean > Variance<S>(0) ? about_mean : Variance<S>(0)) + Variance<S>(spacing * spacing);
  return {mean, variance};
}

}  // namespace bms::estimator
