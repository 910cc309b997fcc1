// Charge above the allowed current, of each direction: how far a truck or charger has exceeded a derated or forbidden
// current, in one piece or in bursts.
//
//   e += (I - 1.05 allowed - 0.005C) dt, not below 0, in seconds of 1C: 3.6 s are 0.1 % of the capacity. Of the
//   continuous limit, if that is lower: 4.9 times a limit of 0.3C are only 1.5C, and would flow for the grace time of
//   5 s after the overload integral has forbidden them
//
//   1.05      errors of a 1 % sensor and a controller, as for the overload integral I2t
//   0.005C    the leak: offset of a 0.5 % sensor. In any hour e receives at most its threshold and 18 s: the table
//   opens
//             at 10.8 s, which bounds the charge above the allowed current to 0.8 % of the capacity in any hour
//   allowed   the larger of the published current and of that which cell and faults permit now. The published one
//             decreases by 1C per second, and it is 0 after a request has ended, while a load is lowered
//
// The row that forbids asks a truck to end its current, before the one that opens. While the contactors are open that
// is answered, and the discharge so far asks no more: its row would keep an obeying truck from driving for the 28
// minutes in which the leak empties e, and the bound above does not need it, because e itself stays. A charge goes on
// being forbidden, because that strands nobody, and a charger that does not obey would open under its current every two
// minutes.
//
// A current that is not derated at all adds nothing: the continuous limit has the overload integral I2t
// (overload.hpp), which carries pulses above it. The leak goes on while the contactors are open. Integers only.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>

#include "measurement/sample.hpp"
#include "protection/derating.hpp"
#include "protection/fault_monitor.hpp"
#include "protection/pack_design.hpp"

namespace bms::protection {

struct ExcessPlan {
  std::int32_t part_ua;  ///< 1C / 2^14
  std::int32_t charge_max_ua, discharge_max_ua;
};

constexpr ExcessPlan excess_plan(const PackDesign& d) {
  return {std::max(in_micro(d.capacity_ah / (1 << 14)), std::int32_t{1}), in_micro(d.limits.charge_current_max_a),
          in_micro(d.limits.discharge_current_max_a)};
}

class ExcessCharge {
 public:
  constexpr explicit ExcessCharge(const ExcessPlan& plan) : plan_(&plan) {}

  /// published, permitted: of the sample before. opened: all contactors are. step_us: time since the last call.
  constexpr void update(std::int32_t current_ua, const AllowedCurrent& published, const AllowedCurrent& permitted,
                        bool opened, std::uint32_t step_us, Quantities& q) {
    if (current_ua == measurement::no_reading) return;
    add(charge_us_, current_ua, std::max(published.charge_ua, permitted.charge_ua), plan_->charge_max_ua, step_us);
    add(discharge_us_, -current_ua, std::max(published.discharge_ua, permitted.discharge_ua), plan_->discharge_max_ua,
        step_us);
    at(q, Quantity::charge_excess_us) = charge_us_;
    answered_us_ = opened ? discharge_us_ : std::min(answered_us_, discharge_us_);
    at(q, Quantity::discharge_excess_us) = discharge_us_ - answered_us_;
    at(q, Quantity::largest_excess_us) = std::max(charge_us_, discharge_us_);
  }

 private:
  static constexpr std::int32_t leak = 82;  ///< 0.005C in 2^-14 of 1C

  constexpr void add(std::int32_t& excess_us, std::int32_t current_ua, std::int32_t allowed_ua, std::int32_t most_ua,
                     std::uint32_t step_us) const {
    constexpr std::int32_t least_ua = 1;
    const std::int32_t unit_ua = std::max(std::min(plan_->part_ua, most_ua >> 14), least_ua);
    const std::int32_t above_ua = current_ua > 0 ? current_ua - allowed_ua : 0, tolerance_ua = allowed_ua / 20;
    const bool counts = allowed_ua < most_ua && above_ua > tolerance_ua;
    if (!counts && excess_us == 0) return;
    const std::int32_t rate = ((counts ? above_ua - tolerance_ua : 0) - leak * plan_->part_ua) / unit_ua;
    const std::int64_t more_us = (static_cast<std::int64_t>(rate) * step_us) >> 14;
    excess_us = static_cast<std::int32_t>(
        std::clamp<std::int64_t>(excess_us + more_us, 0, std::numeric_limits<std::int32_t>::max()));
  }

  const ExcessPlan* plan_;
  std::int32_t charge_us_ = 0, discharge_us_ = 0;
  std::int32_t answered_us_ = 0;  ///< of discharge_us_, by an opening
};

}  // namespace bms::protection
