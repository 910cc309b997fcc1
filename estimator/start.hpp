// The first state of charge, from a rested voltage, with the uncertainty that it leaves.
//
// Nobody knows how long the present current has flowed, and what flowed before (noise.current_unknown_a). The voltage,
// minus half of the voltage that the present current may have built up in the RC branch, is a reading of
// the OCV curve with a standard deviation. Both follow the resistances at each SOC. Every SOC from 0 to 1 is weighted
// by how well its OCV fits; the start is the mean and standard deviation of this distribution. On the plateau that is a
// wide band, as it should be.
//
// The points are those of the bank, which keeps their misfits. They decide how much is around the best of them and how
// much elsewhere; where around it, four times as many points decide there. A wide distribution needs no finer points,
// and a narrow one has them.
#pragma once

#include <algorithm>
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

/// Points between 0 and 1, as close as around the best point of the bank.
inline constexpr int start_points = 256;

/// How often a prior is entirely wrong: then every SOC is as probable, and a voltage that clearly contradicts the prior
/// wins.
enum class WrongPrior : std::uint8_t {
  one_in_ten_thousand,  ///< for an estimate with a sigma: that of a right start. A normal distribution cannot state the
                        ///< chance of a wrong one; with one in a hundred a sigma of 2 % would become 2.8 %
  one_in_a_hundred,     ///< for a bank, which can state it
  even_odds,            ///< whoever checks a prior takes no side: a wrong SOC that lasts is worse than a wide sigma
};

/// Misfit of a SOC to a prior, >= 0.
template <class S>
class PriorMisfit {
  using Misfit = arithmetic::Current<S>;
  using Variance = arithmetic::Variance<S>;

 public:
  /// Without a prior: 0.
  constexpr PriorMisfit() = default;
  /// before: with a standard deviation of two points' spacing or more.
  constexpr explicit PriorMisfit(const SocDistribution<S>& before, WrongPrior wrong = WrongPrior::one_in_a_hundred)
      : soc_(before.soc),
        per_square_(arithmetic::ratio<Variance>(Variance(1), Variance(before.variance + before.variance))),
        if_wrong_(Misfit(Misfit(of_one_thousandth) - SocBank<S>::half_log(before.variance))),
        most_(
            at_least_0(wrong == WrongPrior::even_odds
                           ? if_wrong_
                           : Misfit(if_wrong_ + Misfit(wrong == WrongPrior::one_in_a_hundred ? ln_100 : 2 * ln_100)))) {
  }

  /// The same prior with WrongPrior::even_odds; without one, as it is.
  constexpr PriorMisfit with_even_odds() const {
    PriorMisfit p = *this;
    p.most_ = at_least_0(if_wrong_);
    return p;
  }

  constexpr arithmetic::Exponent<S> operator()(const arithmetic::Soc<S>& soc) const {
    const arithmetic::Soc<S> off = soc - soc_;
    const auto of_prior = arithmetic::product<arithmetic::Exponent<S>>(Variance(off * off), per_square_);
    return of_prior < arithmetic::Exponent<S>(most_) ? of_prior : arithmetic::Exponent<S>(most_);
  }

 private:
  static constexpr double of_one_thousandth = 5.9888, ln_100 = 4.6052;  // of_one_thousandth: ln(1 / (sqrt(2 pi) 0.001))
  static constexpr Misfit at_least_0(const Misfit& misfit) { return misfit > Misfit(0) ? misfit : Misfit(0); }

  arithmetic::Soc<S> soc_{};
  Variance per_square_{};
  /// Of a SOC if the prior is wrong at even odds, above that of the prior's mean: ln(1 / (sqrt(2 pi) sigma)).
  Misfit if_wrong_{};
  Misfit most_{};
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

/// Misfit of a SOC to a reading of the OCV, >= 0. Reading: the OcvReading from the tables at a SOC, since the
/// resistances there decide on what a current left.
template <class S, class Cell, class Reading = OcvReading<S>>
struct StartMisfit {
  const Cell& cell;
  const Reading& reading;

  /// half_step: half the spacing of the points for which this is called.
  constexpr arithmetic::Exponent<S> operator()(const arithmetic::Soc<S>& soc, const arithmetic::Fraction<S>& half_step,
                                               std::uint8_t& interval) const {
    using namespace model;
    const auto at = look_up(cell, soc, interval);
    const OcvReading<S> read = reading(at);
    const Voltage<S> off_v = read.ocv_v - at.ocv_v;
    const Variance<S> one_v2 = Variance<S>((off_v > Voltage<S>(0) ? read.above_v2 : read.v2) +
                                           soc_axis_variance<S>(cell, noise_of(cell), at, soc, off_v, interval));
    // no SOC of the point's share of the curve is nearer: steep parts have few points
    const Voltage<S> beyond_v = SocBank<S>::beyond(off_v, product<Voltage<S>>(ocv_slope<S>(at), half_step));
    return ratio<Exponent<S>>(Variance<S>(beyond_v * beyond_v), Variance<S>(one_v2 + one_v2));
  }
};

/// Sums over SOCs, each weighted by exp(-misfit). Not inline: each is called at several places of a start.
template <class S>
struct SocSums {
  using Fraction = arithmetic::Fraction<S>;
  using Variance = arithmetic::Variance<S>;
  using Soc = arithmetic::Soc<S>;
  using Exponent = arithmetic::Exponent<S>;

  Variance weights{}, first{}, second{};

  [[gnu::noinline]] static constexpr Fraction weight(const Exponent& misfit) {
    return Fraction(Fraction(1) - arithmetic::step_response<S>(misfit));
  }
  [[gnu::noinline]] constexpr void add(const Fraction& weight, const Soc& soc) {
    const auto w = Variance(weight), moment = Variance(w * Variance(soc));
    weights = Variance(weights + w);
    first = Variance(first + moment);
    second = Variance(second + arithmetic::product<Variance>(moment, Variance(soc)));
  }
  /// All sums times `by`.
  [[gnu::noinline]] constexpr void scale(const Variance& by) {
    weights = arithmetic::product<Variance>(weights, by);
    first = arithmetic::product<Variance>(first, by);
    second = arithmetic::product<Variance>(second, by);
  }
  constexpr void add(const SocSums& other) {
    weights = Variance(weights + other.weights);
    first = Variance(first + other.first);
    second = Variance(second + other.second);
  }
};

/// Finds the SOC from the misfits of its points.
template <class S, class Cell, class Reading>
class StartSearch {
  using Bank = SocBank<S>;
  using Soc = arithmetic::Soc<S>;
  using Fraction = arithmetic::Fraction<S>;
  using Variance = arithmetic::Variance<S>;
  using Exponent = arithmetic::Exponent<S>;

 public:
  constexpr StartSearch(const StartMisfit<S, Cell, Reading>& of_reading, const PriorMisfit<S>& prior)
      : of_reading_(of_reading), prior_(prior) {}

  /// Mean and variance of the SOC, weighted by exp(-misfit). Leaves the misfits to the reading alone in the bank.
  [[gnu::cold, gnu::noinline]] constexpr SocDistribution<S> run(Bank& bank) {
    int best = 0;
    Exponent least(0);
    for (int k = 0; k < Bank::points; ++k) {
      const Exponent of_reading = misfit_of_reading(Bank::grid(k), Fraction(0.5 / Bank::points));
      bank.set_first_misfit(k, of_reading);
      const Exponent misfit = with_prior(of_reading, Bank::grid(k));
      if (k > 0 && !(misfit < least)) continue;
      least = misfit;
      best = k;
    }
    const Soc about = Bank::grid(best);
    const int from = std::clamp(best - around / 2, 0, Bank::points - around);
    SocSums<S> elsewhere;
    Variance here{};  // weight of the points that finer ones replace
    for (int k = 0; k < Bank::points; ++k) {
      const Exponent misfit = with_prior(bank.first_misfit(k), Bank::grid(k));
      const Fraction weight = SocSums<S>::weight(Exponent(misfit - least));
      if (k >= from && k < from + around)
        here = Variance(here + weight);
      else
        elsewhere.add(weight, Soc(Bank::grid(k) - about));
    }
    SocSums<S> all = sums_around(from, about);
    all.scale(arithmetic::ratio<Variance>(here, all.weights));
    all.add(elsewhere);
    const Soc off = arithmetic::ratio<Soc>(all.first, all.weights);
    const Variance about_mean = Variance(arithmetic::ratio<Variance>(all.second, all.weights) - Variance(off * off));
    // the spacing of the points limits the accuracy
    const Fraction spacing(1.0 / start_points);
    return {Soc(about + off),
            Variance((about_mean > Variance(0) ? about_mean : Variance(0)) + Variance(spacing * spacing))};
  }

 private:
  static constexpr int around = 8;  ///< points of the bank that finer ones replace

  /// Not inline: the two passes would each have a copy of it.
  [[gnu::noinline]] constexpr Exponent misfit_of_reading(const Soc& soc, const Fraction& half_step) {
    return of_reading_(soc, half_step, interval_);
  }
  [[gnu::noinline]] constexpr Exponent with_prior(const Exponent& of_reading, const Soc& soc) const {
    return Exponent(of_reading + prior_(soc));
  }

  /// The finer points. The smallest misfit so far is subtracted from all, so that a voltage outside the curve still has
  /// weights.
  [[gnu::cold, gnu::noinline]] constexpr SocSums<S> sums_around(int from, const Soc& about) {
    constexpr int finer = start_points / Bank::points;
    const Fraction half_step(0.5 / start_points);
    SocSums<S> sums;
    Exponent least(30'000);
    for (int k = finer * from; k < finer * (from + around); ++k) {
      const auto soc = Soc(arithmetic::Current<S>(2 * k + 1) * half_step);
      const Exponent misfit = with_prior(misfit_of_reading(soc, half_step), soc);
      const bool better = misfit < least;
      const Fraction weight = SocSums<S>::weight(better ? Exponent(least - misfit) : Exponent(misfit - least));
      if (better) {
        least = misfit;
        sums.scale(Variance(weight));
      }
      sums.add(better ? Fraction(1) : weight, Soc(soc - about));
    }
    return sums;
  }

  const StartMisfit<S, Cell, Reading>& of_reading_;
  const PriorMisfit<S>& prior_;
  std::uint8_t interval_ = 0;
};

}  // namespace bms::estimator
