// Monitor of the filter's consistency: the mean deviation of the voltage from the model over half an hour, as long as a
// model's error lasts.
//
//   d' = d + share (innovation + estimated voltage error - d)         share = time since the last check / 1800 s
//
// A filter that is right has d within its own standard deviation: model error, error of the overpotential, slope of the
// OCV times the sigma of the SOC. d beyond 3 of them is inconsistent: one false alarm in 370 half hours if the errors
// are normal. SocEstimator then opens the bank of hypotheses, with d^2 as a part of the model's error, because it may
// be the model that is wrong. The largest sigma of the last half hour counts, since d lags behind.
//
// The mean needs half an hour to show what a single voltage shows at once. One reading may be wrong; a deviation of
// more than 5 standard deviations at every check of three minutes is more than that: a cell that stays below the knee
// is empty.
//
// The overpotential counts in the same way: its mean over half an hour is a part of the voltage noise, because the
// error of a polarisation outlasts the load.
//
// A sample is checked when its time crosses a multiple of 2^26 us, about a minute: an ordinary step costs one
// comparison of the innovation with a limit, which it needs for outliers anyway. A load that repeats in whole minutes
// is seen at all its phases.
#pragma once

#include <cstdint>

#include "arithmetic/scalar.hpp"
#include "estimator/outlier_gate.hpp"

namespace bms::estimator {

template <class S>
class Consistency {
  using Voltage = arithmetic::Voltage<S>;
  using Variance = arithmetic::Variance<S>;
  using Fraction = arithmetic::Fraction<S>;

 public:
  static constexpr double mean_over_s = 1'800;
  static constexpr double max_sigmas = 3;
  /// The same for a deviation at every check of so long. Less often in a normal error, since each check is a chance.
  static constexpr double far_sigmas = 5, far_for_s = 180;
  /// Smallest standard deviation of any model's voltage over half an hour [V], whatever its cell file says.
  static constexpr double min_error_v = 0.005;
  static constexpr int turn_bits = 26;  ///< microseconds of a turn, as a power of two

  /// Whether a turn ends between two samples.
  static constexpr bool turn_ends(std::uint64_t before_us, std::uint64_t now_us) {
    return (static_cast<std::uint32_t>(before_us) ^ static_cast<std::uint32_t>(now_us)) >> turn_bits != 0;
  }
  /// The next sample is checked. Not inline: a conditional store would be counted in every step.
  [[gnu::noinline]] constexpr void force_check() { unchecked_below_v_ = Voltage(-1); }
  /// Whether a sample is to be checked: one that was asked for, the first one, and a suspect innovation, which may not
  /// be a number.
  constexpr bool is_due(const Voltage& innovation_v) const {
    return !(arithmetic::magnitude(innovation_v) <= unchecked_below_v_);
  }
  /// A sample is checked. every: so is the next one. Returns the time since the last one that was asked for, and 0 for
  /// a suspect one in between.
  constexpr std::uint64_t begin(std::uint64_t now_us, bool every) {
    if (unchecked_below_v_ > Voltage(0)) return 0;
    if (!every) unchecked_below_v_ = OutlierGate<S>::suspect_v();
    const std::uint64_t since_us = last_us_ != 0 ? now_us - last_us_ : 0;
    last_us_ = now_us;
    return since_us;
  }
  /// Weight of a check in the means.
  static constexpr Fraction share_of(const arithmetic::TimeStep<S>& seconds) {
    return seconds < arithmetic::TimeStep<S>(mean_over_s) ? Fraction(seconds * Fraction(1 / mean_over_s)) : Fraction(1);
  }

  /// deviation_v: of a reading from the model; overpotential_v: of the model; share: of this check in the means.
  constexpr void add(const Voltage& deviation_v, const Voltage& overpotential_v, const Fraction& share) {
    if (is_unjudged_) far_for_ = not_far();
    is_unjudged_ = true;
    deviation_v_ = deviation_v;
    mean_v_ = Voltage(mean_v_ + share * Voltage(deviation_v - mean_v_));
    overpotential_v_ = Voltage(overpotential_v_ + share * Voltage(overpotential_v - overpotential_v_));
    loads_v2_ = Variance(Variance(loads_v2_ - arithmetic::product<Variance>(loads_v2_, share)) +
                         arithmetic::product<Variance>(Variance(overpotential_v * overpotential_v), share));
  }
  /// The same deviation, while its scatter is asked for.
  constexpr void add_scatter(const Voltage& deviation_v, const Fraction& share) {
    const Fraction left = Fraction(Fraction(1) - share);
    filled_ = Fraction(share + filled_ * left);
    scatter_mean_v_ = Voltage(scatter_mean_v_ + share * Voltage(deviation_v - scatter_mean_v_));
    square_v2_ = Variance(arithmetic::product<Variance>(square_v2_, left) +
                          arithmetic::product<Variance>(Variance(deviation_v * deviation_v), share));
  }
  constexpr void restart_scatter() {
    filled_ = Fraction(0);
    scatter_mean_v_ = Voltage(0);
    square_v2_ = Variance{};
  }
  constexpr Variance variance() const { return mean_v_ * mean_v_; }
  /// Variance of the deviation about its mean, over the last half hour or since it was first asked for.
  constexpr Variance scatter_v2() const {
    if (!(filled_ > Fraction(0))) return Variance{};
    const Variance v2 =
        Variance(arithmetic::product<Variance>(square_v2_, filled_) - scatter_mean_v_ * scatter_mean_v_);
    return v2 > Variance(0) ? arithmetic::ratio<Variance>(v2, Variance(filled_ * filled_)) : Variance{};
  }
  /// Square of the relative error of the overpotential that would explain this scatter. model_v2: variance of the
  /// model's error without a load.
  constexpr Variance seen_error2(const Variance& model_v2) const {
    return arithmetic::ratio<Variance>(scatter_v2(), Variance(Variance(loads_v2_ - overpotential_v2()) + model_v2));
  }
  /// Square of the mean overpotential.
  constexpr Variance overpotential_v2() const { return overpotential_v_ * overpotential_v_; }
  /// Mean square of the overpotential.
  constexpr const Variance& loads_v2() const { return loads_v2_; }

  /// Returns true if the mean is so large, or not a number, that is_inconsistent() has to decide. Costs one comparison.
  constexpr bool is_suspect() const { return !(arithmetic::magnitude(mean_v_) <= Voltage(max_sigmas * min_error_v)); }
  /// expected_v2: variance that the filter expects of a deviation that lasts.
  constexpr bool is_inconsistent(const Variance& expected_v2, const Fraction& share) {
    expected_v2_ = Variance(expected_v2_ - arithmetic::product<Variance>(expected_v2_, share));
    if (expected_v2_ < expected_v2) expected_v2_ = expected_v2;
    if (is_unjudged_) add_to_far(share);
    return far_for_ >= Fraction(far_for_s / mean_over_s) || !is_within(variance(), max_sigmas);
  }
  /// The deviation so far is explained; the next sample is checked.
  constexpr void reset() {
    force_check();
    mean_v_ = Voltage(0);
    far_for_ = not_far();
    expected_v2_ = Variance{};
  }

 private:
  friend struct LaneAccess;

  static constexpr Fraction not_far() { return Fraction(-1); }
  constexpr bool is_within(const Variance& deviation_v2, double sigmas) const {
    return deviation_v2 <= arithmetic::product<Variance>(expected_v2_, arithmetic::Count<S>(sigmas * sigmas));
  }
  constexpr void add_to_far(const Fraction& share) {
    is_unjudged_ = false;
    if (is_within(deviation_v_ * deviation_v_, far_sigmas))
      far_for_ = not_far();
    else if (far_for_ < Fraction(0))
      far_for_ = Fraction(0);
    else if (far_for_ < Fraction(far_for_s / mean_over_s))
      far_for_ = Fraction(far_for_ + share);
  }

  Voltage unchecked_below_v_{-1};
  std::uint64_t last_us_ = 0;  ///< time of the last check that was asked for
  Voltage mean_v_{}, overpotential_v_{};
  Variance loads_v2_{};
  Fraction filled_{};  ///< weight of all samples so far in the two means that follow
  Voltage scatter_mean_v_{};
  Variance square_v2_{};
  Voltage deviation_v_{};        ///< of the last check
  Fraction far_for_{not_far()};  ///< time for which every check was far, in mean_over_s
  bool is_unjudged_ = false;     ///< the last check did not get to is_inconsistent()
  Variance expected_v2_{};
};

}  // namespace bms::estimator
