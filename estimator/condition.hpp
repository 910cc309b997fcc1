// What a display, a vehicle and a workshop need in addition to an estimate: the quality of the SOC, a SOC that never
// jumps, the current limits, the remaining capacity and the resistance. Each sample updates them all here.
//
// Cost: two table look-ups a sample. The current limits take 64 steps of the model, once a second while they are
// wanted.
#pragma once

#include <cstdint>

#include "estimator/current_limits.hpp"
#include "estimator/display_soc.hpp"
#include "estimator/health.hpp"
#include "estimator/soc_estimator.hpp"
#include "estimator/soc_quality.hpp"
#include "measurement/sample.hpp"

namespace bms::estimator {

template <class Estimator>
class Condition {
 public:
  using S = typename Estimator::Scalar;
  using Model = typename Estimator::Model;

  /// Call it after the estimator's step with the same sample. limits_wanted: whether the current limits are needed.
  template <class Cell>
  constexpr void update(const Cell& cell, const measurement::Sample& sample, const Estimate<S>& estimate,
                        const Estimator& estimator, bool limits_wanted) {
    using namespace model;
    const std::uint32_t step_us = started_ ? since(sample.time_us) : 0;
    started_ = true;
    time_us_ = sample.time_us;
    const auto& laws = laws_of(cell);
    const auto& x = estimator.state().model_state;
    capacity_ = estimator.capacity();
    constexpr std::uint32_t unmeasured = current_missing | current_implausible,
                            unread = voltage_missing | voltage_implausible | voltage_stuck | voltage_rejected |
                                     not_started | not_a_number;
    const bool measured = (estimate.flags & unmeasured) == 0 && sample.current_ua != measurement::no_reading;
    const Current<S> current_a = measured ? Current<S>(laws.true_current(Model::without_offset(
                                                from_micro<Current<S>>(sample.current_ua), x, cell.noise)))
                                          : Current<S>(0);
    const StepInput<S> input{current_a, seconds<S>(step_us),
                             measurement::temperature_possible(sample.temperature_cdegc)
                                 ? laws.true_temperature(from_centi<Temperature<S>>(sample.temperature_cdegc))
                                 : Temperature<S>(assumed_ambient_c)};
    const auto at = look_up(OperatingPoint{cell, input, Model::mechanism_states(x)}, estimate.soc, interval_);
    const Rate<S> per_s = current_a * cell.limits.soc_per_as;
    const Soc<S> counted = input.duration_s * per_s;

    soc_quality_ = quality_.update(estimate, at, input, counted, step_us / 1'000, cell.noise.resistance_error);
    if ((estimate.flags & not_started) == 0) display_soc_ = display_.update(estimate.soc, counted, input.duration_s);
    if (measured && (estimate.flags & unread) == 0)
      resistance_.update(Voltage<S>(from_micro<Voltage<S>>(sample.voltage_uv) - estimate.voltage_predicted_v),
                         Voltage<S>(at.r0_ohm * input.current_a), cell.noise.voltage_v2);
    else
      resistance_.interrupt();
    if (limits_wanted && (!limits_known_ || sample.time_us - limited_us_ >= limits_every_us)) {
      limits_known_ = true;
      limited_us_ = sample.time_us;
      const Voltage<S> margin_v = root<Voltage<S>>(at.error_v2),
                       most_v = (cell.limits.voltage_max_v - cell.limits.voltage_min_v) * Fraction<S>(0.125);
      const Voltage<S> kept_v = margin_v < most_v ? margin_v : most_v;
      const auto limits = [&](int duration_s) __attribute__((noinline)) {
        return current_limits<Model>(cell, x, estimate.soc, estimate.soc_sigma, input.temperature_c,
                                     TimeStep<S>(duration_s), kept_v);
      };
      limits_now_ = limits(1);
      limits_10s_ = limits(10);
    }
  }

  constexpr const typename SocQuality<S>::Result& quality() const { return soc_quality_; }
  constexpr const arithmetic::Soc<S>& display_soc() const { return display_soc_; }
  constexpr bool limits_known() const { return limits_known_; }                 ///< whether they have been computed
  constexpr const CurrentLimits<S>& limits_now() const { return limits_now_; }  ///< for one second
  constexpr const CurrentLimits<S>& limits_10s() const { return limits_10s_; }
  constexpr Health<S> capacity() const { return capacity_.health(); }  ///< the estimator's
  constexpr Health<S> resistance() const { return resistance_.health(); }
  /// Capacity and resistance of an earlier run, before the first sample. resistance_ppm, sigma_ppm: > 0.
  constexpr void restore(const LearnedRatio<S>& capacity, std::int32_t resistance_ppm, std::int32_t sigma_ppm) {
    capacity_ = capacity;
    resistance_.restore(resistance_ppm, sigma_ppm);
  }

 private:
  static constexpr std::uint32_t limits_every_us = 1'000'000, longest_step_us = 60'000'000;

  constexpr std::uint32_t since(std::uint64_t time_us) const {
    if (time_us <= time_us_) return 0;
    const std::uint64_t us = time_us - time_us_;
    return us < longest_step_us ? static_cast<std::uint32_t>(us) : longest_step_us;
  }

  SocQuality<S> quality_;
  typename SocQuality<S>::Result soc_quality_;
  DisplaySoc<S> display_;
  arithmetic::Soc<S> display_soc_{};
  CurrentLimits<S> limits_now_, limits_10s_;
  LearnedRatio<S> capacity_{CapacityHealth<S>::initial_sigma};
  ResistanceHealth<S> resistance_;
  std::uint64_t time_us_ = 0, limited_us_ = 0;
  std::uint8_t interval_ = 0;
  bool started_ = false, limits_known_ = false;
};

}  // namespace bms::estimator
