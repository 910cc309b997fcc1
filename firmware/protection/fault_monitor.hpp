// Applies the table to the quantities of a sample: active faults, first cause.
//
//   raised     The first sample beyond the threshold starts the delay. Each later step counts up if its sample is
//              beyond the threshold, and down if not. At 0 the delay is reset; at its end the fault is raised. Noise
//              around the threshold therefore counts by its mean effect, not by single samples (as the counter-based
//              debouncing of AUTOSAR's diagnostic event manager).
//   released   after every sample for the recovery time was at the release threshold or better; any other sample
//              restarts this time
//   unknown    A quantity that is unknown (measurement::no_reading) neither raises nor ends a fault; timers stop.
//   first      The fault that was raised first since the last clear; of several in one sample, the most severe. A
//              warning is replaced by the first fault, and a cause that ended by itself by the next fault.
//   latched    faults of Recovery::service; the firmware stores them and returns them at the next start
//
// The monitor stores durations, not times of day, and they stop at their limit, so nothing wraps. The set of active
// faults is guarded against flipped bits. Cost: README.md. Integers only.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "measurement/sample.hpp"
#include "protection/guarded.hpp"
#include "protection/table.hpp"

namespace bms::protection {

using Quantities = std::array<std::int32_t, quantity_count>;

/// All quantities measurement::no_reading.
constexpr Quantities unknown_quantities() {
  Quantities q{};
  q.fill(measurement::no_reading);
  return q;
}
constexpr std::int32_t& at(Quantities& q, Quantity which) { return q[static_cast<std::size_t>(which)]; }
constexpr std::int32_t at(const Quantities& q, Quantity which) { return q[static_cast<std::size_t>(which)]; }

enum class Clear : std::uint8_t { none, user, service };

struct FirstCause {
  std::uint8_t fault = no_fault;  ///< number of a Fault
  std::uint64_t time_us = 0;
};

class FaultMonitor {
 public:
  /// rules: must outlive this object. latched: latched() of the last run, from storage.
  constexpr FaultMonitor(const Rules& rules, FaultSet latched)
      : rules_(&rules),
        service_faults_(faults_with(rules, Recovery::service)),
        active_(latched & service_faults_),
        clearable_(latched & service_faults_) {}

  /// step_us: time since the last call. may_clear_latched: no contactor has closed since the start. Returns the faults
  /// that this sample raised, one bit each.
  constexpr FaultSet update(const Quantities& quantities, std::uint32_t step_us, std::uint64_t time_us, Clear clear,
                            bool may_clear_latched) {
    const Clear pressed = clear_before_ == Clear::none ? clear : Clear::none;  // a held key clears once
    clear_before_ = clear;
    if (!may_clear_latched) clearable_ = 0;
    const FaultSet before = active_.value();
    FaultSet now = before, mask = 1;
    for (std::size_t k = 0; k < fault_count; ++k, mask <<= 1) {
      const std::int32_t value = at(quantities, (*rules_)[k].quantity);
      if (value == measurement::no_reading) continue;
      if ((now & mask) == 0) {
        if (is_raised((*rules_)[k], timer_[k], value, step_us)) now |= mask;
      } else if (is_cleared((*rules_)[k], timer_[k], value, step_us, pressed, (clearable_ & mask) != 0)) {
        now &= ~mask;
      }
    }
    active_.set(now);
    const FaultSet raised = now & ~before;
    if (pressed != Clear::none && (first_.fault >= fault_count || !is_first(now))) {
      first_ = {};
      update_first_cause(before & now, 0, time_us);  // faults that the command could not end
    }
    update_first_cause(raised, before & now, time_us);
    return raised;
  }

  constexpr FaultSet active() const { return active_.value(); }
  constexpr FaultSet latched() const { return active_.value() & service_faults_; }
  constexpr const FirstCause& first() const { return first_; }
  constexpr bool intact() const { return active_.intact(); }
  /// Call if not intact(): sets every fault that any copy contains, and an internal fault.
  constexpr void fail_safe() { active_.set((active_.any() & all_faults) | bit(Fault::internal_fault)); }

 private:
  /// Inactive fault: how long its quantity has been beyond the threshold. Active fault: how long it has been good.
  struct Timer {
    std::uint32_t us = 0;
    bool runs = false;
  };

  static constexpr bool is_raised(const Rule& r, Timer& t, std::int32_t value, std::uint32_t step_us) {
    const bool beyond = r.sense == Sense::above ? value > r.threshold : value < r.threshold;
    if (!beyond) {
      if (!t.runs) return false;
      t.runs = t.us > step_us;
      t.us = t.runs ? t.us - step_us : 0;
      return false;
    }
    count(t, step_us, r.delay_us);
    if (t.us < r.delay_us) return false;
    t = {};
    return true;
  }
  static constexpr bool is_cleared(const Rule& r, Timer& t, std::int32_t value, std::uint32_t step_us, Clear pressed,
                                   bool clearable) {
    const bool good = r.sense == Sense::above ? value <= r.release : value >= r.release;
    if (!good) {
      t = {};
      return false;
    }
    count(t, step_us, r.recover_us);
    if (t.us < r.recover_us) return false;
    if (r.recovery == Recovery::on_clear && pressed == Clear::none) return false;
    if (r.recovery == Recovery::service && (pressed != Clear::service || !clearable)) return false;
    t = {};
    return true;
  }
  /// The first sample starts the timer, later ones advance it up to most_us.
  static constexpr void count(Timer& t, std::uint32_t step_us, std::uint32_t most_us) {
    if (t.runs) t.us = t.us >= most_us || step_us >= most_us - t.us ? most_us : t.us + step_us;
    t.runs = true;
  }

  constexpr bool is_first(FaultSet faults) const { return has(faults, static_cast<Fault>(first_.fault)); }

  constexpr void update_first_cause(FaultSet raised, FaultSet still, std::uint64_t time_us) {
    if (raised == 0) return;
    std::size_t most_severe = fault_count;
    for (std::size_t k = 0; k < fault_count; ++k, raised >>= 1) {
      if ((raised & 1) != 0 && (most_severe == fault_count || (*rules_)[k].reaction > (*rules_)[most_severe].reaction))
        most_severe = k;
    }
    const auto mild = [&](std::size_t k) { return (*rules_)[k].reaction <= Reaction::derate; };
    if (first_.fault < fault_count && is_first(still) && (!mild(first_.fault) || mild(most_severe))) return;
    first_ = {static_cast<std::uint8_t>(most_severe), time_us};
  }

  const Rules* rules_;
  FaultSet service_faults_;
  std::array<Timer, fault_count> timer_{};
  GuardedWord<FaultSet> active_;
  FaultSet clearable_;  ///< latched before the start: a service command may end them
  FirstCause first_;
  Clear clear_before_ = Clear::none;
};

}  // namespace bms::protection
