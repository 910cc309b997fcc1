// Hypotheses over the state of charge, while a voltage fits several values: a grid of SOCs that all move with the
// counted charge, each with a misfit that sums up what the voltages say against it. A straight line through the OCV
// curve, as a Kalman filter uses it, would choose one of them and be certain.
//
//   e_k = |v - V(soc_k) - b_k| - w_k           beyond w_k, half a step of the grid on the curve
//   misfit_k += e_k^2 / (2 (p_k + r_k)) + ln(p_k + r) / 2         b_k += p_k / (p_k + r_k) e_k
//
// The model's error persists: each hypothesis has its own bias b_k, of variance p_k at first. A constant deviation over
// hours therefore counts once, and crossing a knee of the curve, or not, decides. r is the variance that is
// uncorrelated after one correlation time. Where the curve is steep, p_k is large, so every voltage fits there; the
// term ln compensates for this. The share of p_k that is left is the same for all hypotheses.
//
// The error of the SOC axis is one constant shift. It is a part of p_k. What it changes while the SOC moves is a part
// of r_k but not of r: counted in ln once in every correlation time, it would rule out the true SOC on a steep part of
// the curve where the model is exact.
//
// One point is processed per sample: during `points` samples the misfits are updated, during the next `points` the
// weights exp(-misfit) are summed; then mean and variance are computed. So every step costs the same. (The point-mass
// filter of R. Bucy and K. Senne, Automatica 7 (1971) 287, on one state whose motion is known.) All points of a turn
// are compared on one reading, the first: an error of that reading is then no difference between them.
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
  using Misfit = arithmetic::Current<S>;  // below 2,048 in 32 bits
  using Sum = arithmetic::Current<S>;     // of `points` fractions

 public:
  static constexpr int points = 64;
  static constexpr double max_share = 1.9;                    ///< largest `share` of step()
  static constexpr double close_below_sigma = 0.025;          ///< sigma below which a line through the curve is as good
  static constexpr double open_above_sigma = 0.03;            ///< sigma above which it is not
  static constexpr double apart_soc = 2 * close_below_sigma;  ///< what two sigma of that line do not cover

  constexpr bool open() const { return open_; }
  constexpr void close() { open_ = false; }
  /// The next step() begins a turn.
  constexpr bool begins_turn() const { return turn_ == 0; }

  /// Misfit of a point to the first voltage, kept until open_at(): up to 32,000, in steps of 3e-5.
  constexpr void set_first_misfit(int k, const Exponent& misfit) {
    misfit_[static_cast<std::size_t>(k)] = Misfit(arithmetic::product<Exponent>(misfit, Fraction(1.0 / 16)));
  }
  constexpr Exponent first_misfit(int k) const {
    return Exponent(misfit_[static_cast<std::size_t>(k)] * arithmetic::Current<S>(16));
  }

  constexpr void clear_first_misfits() { misfit_ = {}; }

  /// Starts. mean: present SOC of the filter; misfit(k): initial misfit of grid(k), >= 0. With the moments, so that
  /// `points` samples pass before a reading: the error of the next one is that of the reading that the misfits are
  /// from.
  template <class F>
  constexpr void open_at(const Soc& mean, F&& misfit) {
    open_ = true;
    turn_ = points;
    mean_ = mean;
    bias_v_ = {};
    bias_share_ = Fraction(1);
    lasting_v2_ = Variance{};
    gain_sum_ = Sum(0);
    least_ = Misfit(2'000);
    for (int k = 0; k < points; ++k) {
      misfit_[static_cast<std::size_t>(k)] = clamped(Misfit(misfit(k)));
      if (misfit_[static_cast<std::size_t>(k)] < least_) least_ = misfit_[static_cast<std::size_t>(k)];
    }
    next_least_ = least_;
  }

  /// Whether more than a whole capacity was counted since open_at(), so that no hypothesis is in its place any more.
  /// soc: as in step().
  constexpr bool has_run_off(const Soc& soc) const { return arithmetic::magnitude(Soc(soc - mean_)) > Soc(1); }

  /// A voltage as one hypothesis sees it.
  struct Observation {
    Voltage off_v;           ///< measured minus expected
    Voltage half_v;          ///< half a step of the grid on the curve
    Variance new_v2;         ///< r: variance that is uncorrelated after one correlation time
    Variance axis_v2;        ///< the same of the SOC axis: r_k - r
    Variance persistent_v2;  ///< p_k, if nothing was seen yet. Decays in model::persistent_error_correlations
  };
  struct BankUpdate {
    bool ready = false;
    Soc moved{};  ///< change of the mean
    Variance variance{};
    Fraction elsewhere{};  ///< probability that the SOC is more than apart_soc from that of the filter
  };

  /// One sample. soc: of the filter, the mean plus the charge counted since; share: correlation times that pass in
  /// 2 `points` samples, max_share at most; white_v2: variance of the reading; lasting_v2: part of p_k that is
  /// the same for all. Where it falls, because the branch of the hysteresis becomes known, the biases fall with it.
  /// observation(soc_k): Observation of the reading that began the turn, as are soc and lasting_v2.
  template <class F>
  constexpr BankUpdate step(const Soc& soc, const Fraction& share, const Variance& white_v2, const Variance& lasting_v2,
                            F&& observation) {
    if (turn_ == 0) {
      bias_left_ = lasting_v2 < lasting_v2_ ? arithmetic::ratio<Fraction>(lasting_v2, lasting_v2_) : Fraction(1);
      lasting_v2_ = lasting_v2;
      moved_ = Soc(soc - mean_);
    }
    const auto k = static_cast<std::size_t>(turn_ % points);
    if (turn_ < points)
      update_misfit(k, share, white_v2, observation(Soc(grid(static_cast<int>(k)) + moved_)));
    else
      accumulate_moments(k);
    if (++turn_ < 2 * points) return {};
    turn_ = 0;
    // the biases were corrected, and decayed
    const Fraction decayed = decay_in(share), mean_gain = Fraction(gain_sum_ * Fraction(1.0 / points));
    bias_share_ = Fraction(bias_share_ - bias_share_ * mean_gain);
    const Fraction returned = Fraction(Fraction(Fraction(1) - bias_share_) * decayed);
    bias_share_ = Fraction(bias_share_ + returned * Fraction(Fraction(2) - decayed));
    gain_sum_ = Sum(0);
    const Soc mean = arithmetic::ratio<Soc>(first_, weights_);
    const Fraction step(1.0 / points);
    const Variance finest = Variance(Variance(step * step) * Fraction(1.0 / 12));
    BankUpdate bank_update{true, Soc(mean - mean_), Variance(arithmetic::ratio<Soc>(second_, weights_) - mean * mean)};
    bank_update.elsewhere = arithmetic::ratio<Fraction>(elsewhere_, weights_);
    bank_update.variance = bank_update.variance < Variance(0) ? finest : Variance(bank_update.variance + finest);
    mean_ = mean;
    return bank_update;
  }

  /// The SOC of the filter was changed by `by` other than by counted charge, or was not moved to
  /// the mean of the last step: then by is minus BankUpdate::moved.
  constexpr void follow(const Soc& by) { mean_ = Soc(mean_ + by); }
  /// Whether every hypothesis further than `beyond` from soc has a misfit of `above` more than the smallest one; after
  /// a step that is ready. filter_soc: as in step().
  constexpr bool rules_out_beyond(const Soc& beyond, const Misfit& above, const Soc& soc, const Soc& filter_soc) const {
    const Soc on_grid = Soc(soc - (filter_soc - mean_));
    for (int k = 0; k < points; ++k) {
      if (arithmetic::magnitude(Soc(grid(k) - on_grid)) > beyond &&
          Misfit(misfit_[static_cast<std::size_t>(k)] - least_) < above)
        return false;
    }
    return true;
  }

  /// ln(v2 / 1e-6) / 2, and 0 below 1e-6; linear between powers of four, within 0.06.
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

  /// Part of a persistent error that passes in one turn. share: as in step().
  static constexpr Fraction decay_in(const Fraction& share) {
    return share * Fraction(1.0 / model::persistent_error_correlations);
  }

  /// Part of off_v outside of +-half_v.
  static constexpr Voltage beyond(const Voltage& off_v, const Voltage& half_v) {
    if (off_v > half_v) return Voltage(off_v - half_v);
    return off_v < -half_v ? Voltage(off_v + half_v) : Voltage(0);
  }

  static constexpr Soc grid(int k) { return Soc(arithmetic::Current<S>(2 * k + 1) * Fraction(0.5 / points)); }

 private:
  static constexpr int most = 4;  ///< largest increase of a misfit by one voltage

  static constexpr Misfit clamped(const Misfit& m) { return m > Misfit(200) ? Misfit(200) : m; }

  constexpr void update_misfit(std::size_t k, const Fraction& share, const Variance& white_v2,
                               const Observation& observation) {
    if (k == 0) next_least_ = Misfit(2'000);
    bias_v_[k] = Voltage(Voltage(bias_v_[k] - bias_v_[k] * decay_in(share)) * bias_left_);
    const Voltage off_v = observation.off_v - bias_v_[k];
    const Voltage beyond_v = beyond(off_v, observation.half_v);
    const Variance bias_v2 = arithmetic::product<Variance>(observation.persistent_v2, bias_share_);
    const Variance varying_v2 = Variance(observation.new_v2 + observation.axis_v2);
    const Variance noise_v2 =
        Variance(white_v2 + (share < Fraction(1) ? arithmetic::ratio<Variance>(varying_v2, share) : varying_v2));
    const Variance all_v2 = Variance(bias_v2 + noise_v2);
    const auto squares = arithmetic::ratio<Exponent>(Variance(beyond_v * beyond_v), Variance(all_v2 + all_v2));
    const auto gain = arithmetic::ratio<Fraction>(bias_v2, all_v2);
    const bool far = squares > Exponent(most);  // this may be one bad reading
    if (!far) bias_v_[k] = Voltage(bias_v_[k] + gain * beyond_v);
    gain_sum_ = Sum(gain_sum_ + gain);
    const Misfit width = Misfit(half_log(Variance(Variance(white_v2 + observation.new_v2) + bias_v2)) *
                                (share < Fraction(1) ? share : Fraction(1)));
    misfit_[k] = clamped(Misfit(Misfit(Misfit(misfit_[k] - least_) + width) + (far ? Misfit(most) : Misfit(squares))));
    if (misfit_[k] < next_least_) next_least_ = misfit_[k];
  }

  constexpr void accumulate_moments(std::size_t k) {
    if (k == 0) {
      weights_ = first_ = second_ = elsewhere_ = Variance{};
      least_ = next_least_;
    }
    const Fraction spacing(1.0 / points);
    const Fraction weight =
        (Fraction(1) - arithmetic::step_response<S>(Exponent(Misfit(misfit_[k] - least_)))) * spacing;
    const Soc at = grid(static_cast<int>(k));
    const Fraction moment = weight * at;
    weights_ = Variance(weights_ + weight);
    first_ = Variance(first_ + moment);
    second_ = Variance(second_ + moment * at);
    if (arithmetic::magnitude(Soc(at - mean_)) > Soc(apart_soc)) elsewhere_ = Variance(elsewhere_ + weight);
  }

  std::array<Misfit, points> misfit_{};
  std::array<Voltage, points> bias_v_{};
  Fraction bias_share_{}, bias_left_{1};
  Variance lasting_v2_{};
  Sum gain_sum_{};
  Misfit least_{}, next_least_{};
  Variance weights_{}, first_{}, second_{}, elsewhere_{};
  Soc mean_{};
  Soc moved_{};  ///< by counted charge, when the turn began
  std::uint8_t turn_ = 0;
  bool open_ = false;
};

}  // namespace bms::estimator
