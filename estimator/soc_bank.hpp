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
  static constexpr double narrow_soc = 0.025;  ///< one sigma, below which a line through the curve does as well
  static constexpr double wide_soc = 0.03;     ///< and above which it does not

  constexpr bool open() const { return open_; }
  constexpr void close() { open_ = false; }

  /// Begins. misfit(soc): what speaks against it so far, >= 0. mean: where the filter now has soc. lasting_v2: of the
  /// model's error.
  template <class F>
  constexpr void open_at(const Soc& mean, const Variance& lasting_v2, F&& misfit) {
    open_ = true;
    turn_ = 0;
    mean_ = mean;
    bias_v_ = {};
    bias_v2_ = lasting_v2;
    gained_ = Sum(0);
    least_ = Misfit(2'000);
    for (int k = 0; k < points; ++k) {
      misfit_[static_cast<std::size_t>(k)] = held(Misfit(misfit(grid(k))));
      if (misfit_[static_cast<std::size_t>(k)] < least_) least_ = misfit_[static_cast<std::size_t>(k)];
    }
  }

  /// What a voltage says to one hypothesis.
  struct Seen {
    Voltage off_v;    ///< measured less expected
    Voltage half_v;   ///< half a step of the grid on the curve
    Variance new_v2;  ///< variance of what is new in every correlation time
  };
  struct News {
    bool any = false;
    Soc moved{};  ///< the mean, by
    Variance variance{};
  };

  /// One sample. soc: where the filter has it, mean and what was counted since; share: of a correlation time that
  /// passes in 2 points samples, 1.9 at most; white_v2: of the reading; lasting_v2 as above, forgotten in
  /// model::lasting_error_lasts correlation times; seen(soc_k): Seen.
  template <class F>
  constexpr News step(const Soc& soc, const Fraction& share, const Variance& white_v2, const Variance& lasting_v2,
                      F&& seen) {
    const auto k = static_cast<std::size_t>(turn_ % points);
    if (turn_ < points)
      compare(k, share, white_v2, seen(Soc(grid(static_cast<int>(k)) + (soc - mean_))));
    else
      weigh(k);
    if (++turn_ < 2 * points) return {};
    turn_ = 0;
    // what the biases have been told, and have forgotten
    const Fraction forgotten = forgotten_in(share), told = Fraction(gained_ * Fraction(1.0 / points));
    bias_v2_ = Variance(bias_v2_ - arithmetic::product<Variance>(bias_v2_, told));
    bias_v2_ = Variance(bias_v2_ + arithmetic::product<Variance>(
                                       arithmetic::product<Variance>(Variance(lasting_v2 - bias_v2_), forgotten),
                                       Fraction(Fraction(2) - forgotten)));
    gained_ = Sum(0);
    const Soc mean = arithmetic::ratio<Soc>(first_, weights_);
    const Fraction step(1.0 / points);
    const Variance finest = Variance(Variance(step * step) * Fraction(1.0 / 12));
    News news{true, Soc(mean - mean_), Variance(arithmetic::ratio<Soc>(second_, weights_) - mean * mean)};
    news.variance = news.variance < Variance(0) ? finest : Variance(news.variance + finest);
    mean_ = mean;
    return news;
  }

  static constexpr Soc grid(int k) { return Soc(arithmetic::Current<S>(2 * k + 1) * Fraction(0.5 / points)); }

 private:
  static constexpr int most = 4;  ///< that one comparison may add to a misfit

  static constexpr Misfit held(const Misfit& m) { return m > Misfit(200) ? Misfit(200) : m; }

  static constexpr Fraction forgotten_in(const Fraction& share) {
    return share * Fraction(1.0 / model::lasting_error_lasts);
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

  constexpr void compare(std::size_t k, const Fraction& share, const Variance& white_v2, const Seen& seen) {
    if (k == 0) next_least_ = Misfit(2'000);
    bias_v_[k] = Voltage(bias_v_[k] - bias_v_[k] * forgotten_in(share));
    const Voltage off_v = seen.off_v - bias_v_[k];
    const Voltage beyond_v = off_v > seen.half_v    ? Voltage(off_v - seen.half_v)
                             : off_v < -seen.half_v ? Voltage(off_v + seen.half_v)
                                                    : Voltage(0);
    const Variance noise_v2 =
        Variance(white_v2 + (share < Fraction(1) ? arithmetic::ratio<Variance>(seen.new_v2, share) : seen.new_v2));
    const Variance all_v2 = Variance(bias_v2_ + noise_v2);
    const auto squares = arithmetic::ratio<Exponent>(Variance(beyond_v * beyond_v), Variance(all_v2 + all_v2));
    const auto gain = arithmetic::ratio<Fraction>(bias_v2_, all_v2);
    const bool far = squares > Exponent(most);  // as much may be one bad reading
    if (!far) bias_v_[k] = Voltage(bias_v_[k] + gain * beyond_v);
    gained_ = Sum(gained_ + gain);
    const Misfit width =
        Misfit(half_log(Variance(white_v2 + seen.new_v2)) * (share < Fraction(1) ? share : Fraction(1)));
    misfit_[k] = held(Misfit(Misfit(Misfit(misfit_[k] - least_) + width) + (far ? Misfit(most) : Misfit(squares))));
    if (misfit_[k] < next_least_) next_least_ = misfit_[k];
  }

  constexpr void weigh(std::size_t k) {
    if (k == 0) {
      weights_ = first_ = second_ = Variance{};
      least_ = next_least_;
    }
    const Fraction spacing(1.0 / points);
    const Fraction weight = (Fraction(1) - arithmetic::settled<S>(Exponent(Misfit(misfit_[k] - least_)))) * spacing;
    const Fraction moment = weight * grid(static_cast<int>(k));
    weights_ = Variance(weights_ + weight);
    first_ = Variance(first_ + moment);
    second_ = Variance(second_ + moment * grid(static_cast<int>(k)));
  }

  std::array<Misfit, points> misfit_{};
  std::array<Voltage, points> bias_v_{};
  Variance bias_v2_{};
  Sum gained_{};
  Misfit least_{}, next_least_{};
  Variance weights_{}, first_{}, second_{};
  Soc mean_{};
  std::uint8_t turn_ = 0;
  bool open_ = false;
};

}  // namespace bms::estimator
