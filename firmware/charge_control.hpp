// A charge from its begin to its end, for the profiles of chargers: what voltage and current the charger is asked for,
// and when the charge is over.
//
//   current    until the highest cell is near the voltage of the target; the current is AllowedCurrent.Charge
//   voltage    the charger holds the target, and its current falls
//   full       the current was below C/20 for a minute with a cell at the target
//   stalled    the charger gave less than C/20 for half an hour although more was allowed, below the target
//   too long   16 h in all, or 4 h at the target: a sensor or the charger is wrong
//   wrong      the charger reports an output that differs from the pack by more than a tenth for ten seconds: another
//              battery is connected to it, or its sensor is wrong
//
// Target: the voltage of each cell at which the allowed charge current begins to fall (derating.hpp), 6 % of the span
// below the limit: 3.55 V of 3.65 V. So the charger reduces its current before the battery has to. After each of the
// last four the charger has to go away before the next charge: the contactors are open meanwhile, so nothing discharges
// the battery. Memory: 72 bytes.
//
// In a group (firmware/parallel/) the leader alone speaks to the charger: it asks for what the group may carry until
// the charge of each connected battery is over. One that is full remains connected at the target meanwhile.
#pragma once

#include <algorithm>
#include <cstdint>

#include "board_config.hpp"  // generated from boards/<board>/board.cmake
#include "firmware/charge_of_group.hpp"
#include "firmware/snapshot.hpp"
#include "protection/contactors.hpp"

namespace bms::firmware {

enum class ChargePhase : std::uint8_t { idle, current, voltage, full, stalled, too_long, wrong };

/// What a charger says of itself.
struct ChargerReport {
  bool present = false;
  std::int32_t output_uv = measurement::no_reading;
};

class ChargeControl : public ChargeOfGroup<hal::has_group_bus> {
 public:
  static constexpr std::uint64_t tail_for_us = 60'000'000, stalled_after_us = 1'800'000'000,
                                 longest_us = 57'600'000'000, longest_at_target_us = 14'400'000'000,
                                 wrong_after_us = 10'000'000;
  static constexpr std::int32_t near_target_uv =
      30'000;  ///< of a cell: 1 %, two errors of its reading and of a charger

  /// Call with every sample.
  template <class Estimator, std::size_t Cells>
  void update(const Snapshot<Estimator, Cells>& now, const ChargerReport& charger) {
    const std::uint64_t step_us = started_ ? std::min<std::uint64_t>(now.pack.time_us - time_us_, 1'000'000) : 0;
    started_ = true;
    time_us_ = now.pack.time_us;
    const std::int32_t cell_uv = now.plan.derating.charge_voltage.from;
    target_uv_ =
        static_cast<std::int32_t>(std::min<std::int64_t>(std::int64_t{cell_uv} * now.plan.cells, 2'000'000'000));
    if (!charger.present) return begin();
    charging_ = now.decision.outputs.charge_enable && now.decision.state == protection::ContactorState::charge;
    allowed_ua_ = charging_ && wanted() ? now.decision.allowed.charge_ua : 0;
    if (!charging_ || !own_wanted()) return;
    std::int32_t highest_uv = 0;
    for (const std::int32_t uv : now.pack.cell_uv) {
      if (uv != measurement::no_reading) highest_uv = std::max(highest_uv, uv);
    }
    const auto tail_ua = static_cast<std::int32_t>(now.capacity_ah * (1e6F / 20));
    follow({.at_target = highest_uv >= cell_uv - near_target_uv,
            .tail = now.pack.current_ua != measurement::no_reading && now.pack.current_ua <= tail_ua,
            .more_allowed = allowed_ua_ > tail_ua,
            .wrong = differs(charger.output_uv, now.pack.pack_uv),
            .step_us = step_us});
  }

  /// The charger should charge: no charge has ended since it came.
  constexpr bool wanted() const { return group_wants(own_wanted()); }
  constexpr bool own_wanted() const { return phase_ <= ChargePhase::voltage; }
  constexpr ChargePhase phase() const { return phase_; }
  constexpr std::int32_t target_uv() const { return target_uv_; }
  /// Current to ask for [uA]; 0 unless the contactors are closed for charging.
  constexpr std::int32_t current_ua() const { return wanted() ? group_current_ua(allowed_ua_) : 0; }

 private:
  struct Seen {
    bool at_target, tail, more_allowed, wrong;
    std::uint64_t step_us;
  };

  static constexpr bool differs(std::int32_t output_uv, std::int32_t pack_uv) {
    return output_uv != measurement::no_reading && pack_uv > 0 &&
           std::max(output_uv - pack_uv, pack_uv - output_uv) > pack_uv / 10;
  }
  constexpr void follow(const Seen& now) {
    const auto count = [&](std::uint64_t& for_us, bool goes_on) { for_us = goes_on ? for_us + now.step_us : 0; };
    phase_ = now.at_target ? ChargePhase::voltage : ChargePhase::current;
    charge_us_ += now.step_us;
    if (now.at_target) target_us_ += now.step_us;
    count(tail_us_, now.tail && now.at_target);
    count(stalled_us_, now.tail && !now.at_target && now.more_allowed);
    count(wrong_us_, now.wrong);
    if (tail_us_ >= tail_for_us) phase_ = ChargePhase::full;
    if (stalled_us_ >= stalled_after_us) phase_ = ChargePhase::stalled;
    if (charge_us_ >= longest_us || target_us_ >= longest_at_target_us) phase_ = ChargePhase::too_long;
    if (wrong_us_ >= wrong_after_us) phase_ = ChargePhase::wrong;
  }
  constexpr void begin() {
    phase_ = ChargePhase::idle;
    charge_us_ = target_us_ = tail_us_ = stalled_us_ = wrong_us_ = 0;
    allowed_ua_ = 0;
  }

  std::uint64_t time_us_ = 0, charge_us_ = 0, target_us_ = 0, tail_us_ = 0, stalled_us_ = 0, wrong_us_ = 0;
  std::int32_t target_uv_ = 0, allowed_ua_ = 0;
  ChargePhase phase_ = ChargePhase::idle;
  bool started_ = false, charging_ = false;
};

}  // namespace bms::firmware
