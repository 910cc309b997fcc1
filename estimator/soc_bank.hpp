// Where soc may be while a voltage leaves several answers: a grid of hypotheses that all move with the charge that is
// counted, each with what the voltages so far speak against it. A straight line through the OCV curve, which is what a
// Kalman filter lays, would pick one of them and be sure of it.
//
//   e_k = |v - V(soc_k) - b_k| - w_k           beyond half a step of the grid on the curve, w_k
//   misfit_k += e_k^2 / (2 (p + r)) + ln r / 2         b_k += p / (p + r) e_k
//
// The model's error is a lasting one, b, and each hypothesis has its own, of standard deviation noise.model_v at first:
// what is off by as much for hours speaks once, and a knee of the curve that is passed, or is not, speaks for itself.
// r: what is new in every correlation time: where the curve is steep it is large, so nothing there is far off; that it
// could be anything is what speaks against it, ln r. The variance of b, p, is the same for all.
//
// In turns, a point at a time: `points` samples add to the misfits, as many sum the weights exp(-misfit) up, then mean
// and variance are known anew. So a step costs the same whenever it comes. (The point-mass filter of R. Bucy and K.
// Senne, Automatica 7 (1971) 287, on one state whose motion is known.)
//
// Memory: 8 bytes a point, one bank for an estimator.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "model/one_rc.hpp"

namespace bms::estimator {

template <class S>
class SocBank {
  using Soc = arithmetic::Soc<S>;
  using Voltage = arithmetic::Voltage<S>;
  using Variance = arithmetic::Variance<S>;
  using Fraction = arithmetic::Fraction<S>;
  using Exponent = arithmetic::Exponent<S>;
  using Misfit = arithmetic::Current<S>;  // to 2,048 in 32 bits
  using Sum = arithmetic::Current<S>;     // of `points` fractions

 public:
  static constexpr int points = 64;
  static constexpr double max_share = 1.9;            ///< largest `share` of step()
  static constexpr double close_below_sigma = 0.025;  ///< one sigma, below which a line through the curve does as well
  static constexpr double open_above_sigma = 0.03;    ///< and above which it does not

  constexpr bool open() const { return open_; }
  constexpr void close() { open_ = false; }

  /// Begins. misfit(soc): what speaks against it so far, >= 0. mean: where the filter now has soc. persistent_variance:
  /// of the model's error.
  template <class F>
  constexpr void open_at(const Soc& mean, const Variance& persistent_variance, F&& misfit) {
    open_ = true;
    turn_ = 0;
    mean_ = mean;
    bias_v_ = {};
    bias_v2_ = persistent_variance;
    gain_sum_ = Sum(0);
    least_ = Misfit(2'000);
    for (int k = 0; k < points; ++k) {
      misfit_[static_cast<std::size_t>(k)] = clamped(Misfit(misfit(grid(k))));
      if (misfit_[static_cast<std::size_t>(k)] < least_) least_ = misfit_[static_cast<std::size_t>(k)];
    }
  }

  /// What a voltage says to one hypothesis.
  struct Observation {
    Voltage off_v;    ///< measured less expected
    Voltage half_v;   ///< half a step of the grid on the curve
    Variance new_v2;  ///< variance of what is new in every correlation time
  };
  struct BankUpdate {
    bool ready = false;
    Soc moved{};  ///< the mean, by
    Variance variance{};
  };

  /// One sample. soc: where the filter has it, mean and what was counted since; share: of a correlation time that
  /// passes in 2 points samples, 1.9 at most; white_v2: of the reading; persistent_variance as above, forgotten in
  /// model::persistent_error_correlations correlation times; seen(soc_k): Seen.
  template <class F>
  constexpr BankUpdate step(const Soc& soc, const Fraction& share, const Variance& white_v2,
                            const Variance& persistent_variance, F&& observation) {
    const auto k = static_cast<std::size_t>(turn_ % points);
    if (turn_ < points)
      update_misfit(k, share, white_v2, observation(Soc(grid(static_cast<int>(k)) + (soc - mean_))));
    else
      accumulate_moments(k);
    if (++turn_ < 2 * points) return {};
    turn_ = 0;
    // what the biases have been told, and have forgotten
    const Fraction decayed = decay_in(share), mean_gain = Fraction(gain_sum_ * Fraction(1.0 / points));
    bias_v2_ = Variance(bias_v2_ - arithmetic::product<Variance>(bias_v2_, mean_gain));
    bias_v2_ = Variance(bias_v2_ + arithmetic::product<Variance>(
                                       arithmetic::product<Variance>(Variance(persistent_variance - bias_v2_), decayed),
                                       Fraction(Fraction(2) - decayed)));
    gain_sum_ = Sum(0);
    const Soc mean = arithmetic::ratio<Soc>(first_, weights_);
    const Fraction step(1.0 / points);
    const Variance finest = Variance(Variance(step * step) * Fraction(1.0 / 12));
    BankUpdate bank_update{true, Soc(mean - mean_), Variance(arithmetic::ratio<Soc>(second_, weights_) - mean * mean)};
    bank_update.variance = bank_update.variance < Variance(0) ? finest : Variance(bank_update.variance + finest);
    mean_ = mean;
    return bank_update;
  }

  static constexpr Soc grid(int k) { return Soc(arithmetic::Current<S>(2 * k + 1) * Fraction(0.5 / points)); }

 private:
  static constexpr int most = 4;  ///< that one comparison may add to a misfit

  static constexpr Misfit clamped(const Misfit& m) { return m > Misfit(200) ? Misfit(200) : m; }

  static constexpr Fraction decay_in(const Fraction& share) {
    return share * Fraction(1.0 / model::persistent_error_correlations);
  }

  /// ln(v2 / 1 mV^2) / 2, 0 below that; straight lines between powers of four, within 0.06.
  static constexpr Misfit half_log(Variance v2) {
    const auto unit = Variance(1e-6), four = Variance(4e-6);
    const auto ln_2 = Misfit(0.69314718);
    Misfit sum(0);
    while (v2 > four) {
      v2 = arithmetic::product<Variance>(v2, Fraction(0.25));
      sum = Misfit(sum + ln_2);
    }
    return v2 > unit ? Misfit(sum + ln_2 * arithmetic::ratio<Fraction>(Variance(v2 - unit), Variance(four - unit)))
                     : sum;
  }

  constexpr void update_misfit(std::size_t k, const Fraction& share, const Variance& white_v2,
                               const Observation& observation) {
    if (k == 0) next_least_ = Misfit(2'000);
    bias_v_[k] = Voltage(bias_v_[k] - bias_v_[k] * decay_in(share));
    const Voltage off_v = observation.off_v - bias_v_[k];
    const Voltage beyond_v = off_v > observation.half_v    ? Voltage(off_v - observation.half_v)
                             : off_v < -observation.half_v ? Voltage(off_v + observation.half_v)
                                                           : Voltage(0);
    const Variance noise_v2 = Variance(
        white_v2 + (share < Fraction(1) ? arithmetic::ratio<Variance>(observation.new_v2, share) : observation.new_v2));
    const Variance all_v2 = Variance(bias_v2_ + noise_v2);
    const auto squares = arithmetic::ratio<Exponent>(Variance(beyond_v * beyond_v), Variance(all_v2 + all_v2));
    const auto gain = arithmetic::ratio<Fraction>(bias_v2_, all_v2);
    const bool far = squares > Exponent(most);  // as much may be one bad reading
    if (!far) bias_v_[k] = Voltage(bias_v_[k] + gain * beyond_v);
    gain_sum_ = Sum(gain_sum_ + gain);
    const Misfit width =
        Misfit(half_log(Variance(white_v2 + observation.new_v2)) * (share < Fraction(1) ? share : Fraction(1)));
    misfit_[k] = clamped(Misfit(Misfit(Misfit(misfit_[k] - least_) + width) + (far ? Misfit(most) : Misfit(squares))));
    if (misfit_[k] < next_least_) next_least_ = misfit_[k];
  }

  constexpr void accumulate_moments(std::size_t k) {
    if (k == 0) {
      weights_ = first_ = second_ = Variance{};
      least_ = next_least_;
    }
    const Fraction spacing(1.0 / points);
    const Fraction weight =
        (Fraction(1) - arithmetic::step_response<S>(Exponent(Misfit(misfit_[k] - least_)))) * spacing;
    const Fraction moment = weight * grid(static_cast<int>(k));
    weights_ = Variance(weights_ + weight);
    first_ = Variance(first_ + moment);
    second_ = Variance(second_ + moment * grid(static_cast<int>(k)));
  }

  std::array<Misfit, points> misfit_{};
  std::array<Voltage, points> bias_v_{};
  Variance bias_v2_{};
  Sum gain_sum_{};
  Misfit least_{}, next_least_{};
  Variance weights_{}, first_{}, second_{};
  Soc mean_{};
  std::uint8_t turn_ = 0;
  bool open_ = false;
};

}  // namespace bms::estimator
