// The pack's three contactors: their order, and whether they did what was commanded.
//
//                 main+  main-  pre    leaves for
//   off             -      -     -     self_test      a truck or a charger makes a new request, and no fault forbids it
//                                      safe           a fault opens
//   self_test       -      -     -     precharge      after three parts of one test time each: all open, precharge
//                   relay
//                                                     alone, main- alone. A DC link that rises proves that the other
//                                                     pole is welded.
//   precharge       -      x     x     drive, charge  DC link at 15/16 of the pack; until then it follows an RC curve
//   drive           x      x     -     unloading      the request ends, a fault opens, or forbidden current flows
//   charge          x      x     -     the same; the charger is enabled
//   unloading       x      x     -     opening        no current flows, or a fault or a forbidden current has used up
//                                                     its grace time
//   opening         -      -     -     off, safe      weld check: the DC link falls by an eighth and no current flows;
//                                                     safe with a fault
//   safe            -      -     -     off            no fault opens any more, and there is no request
//
// A severe fault opens at once from every state. Only a severe fault, and a current that should have ceased and did
// not, open under load. When a truck withdraws its request, the contactors stay closed until its current is zero. The
// state is stored three times; contradicting copies or an invalid state lead to safe, all open, with an internal fault.
//
//   precharge   dc_link(t) = pack (1 - exp(-t / RC)). It is compared with the curve at the last half time constant that
//               is over, minus a fifth of the pack. A slower rise means a load or a short circuit on the DC link, and
//               the resistor would burn. After six time constants the precharge has failed.
//   welded      the DC link stays at 7/8 of the pack while all are open, it rises by an eighth with one pole closed, or
//               current flows while open
//   not closed  0.3 s after closing (table) the DC link is still a sixteenth below the pack
//
// Times are durations that stop at their limit, so nothing wraps. Integers only.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "measurement/sample.hpp"
#include "protection/guarded.hpp"
#include "protection/pack_design.hpp"

namespace bms::protection {

enum class ContactorState : std::uint8_t { off, self_test, precharge, drive, charge, unloading, opening, safe };
inline constexpr std::size_t contactor_state_count = 8;
inline constexpr std::array<const char*, contactor_state_count> contactor_state_names = {
    "off", "self-test", "precharge", "drive", "charge", "unloading", "opening", "safe"};

enum class Request : std::uint8_t { none, drive, charge };

/// One bit each, because a flipped bit in a whole byte could give a bool that is neither true nor false.
struct Outputs {
  bool main_plus : 1 = false, main_minus : 1 = false, precharge : 1 = false, charge_enable : 1 = false;

  constexpr bool any_closed() const { return main_plus || main_minus || precharge; }
  constexpr bool operator==(const Outputs&) const = default;
};

struct ContactorPlan {
  std::uint32_t test_us, half_time_constant_us, dc_link_discharge_us;
  std::int32_t rest_ua;

  /// Limit up to which the time in a state is counted.
  constexpr std::uint32_t longest_us() const {
    return std::max({3 * test_us, 12 * half_time_constant_us, dc_link_discharge_us});
  }
};

constexpr ContactorPlan contactor_plan(const PackDesign& d) {
  const std::uint32_t half_us = in_us(d.precharge_time_constant_s / 2);
  return {std::max(half_us, in_us(3 * d.sample_period_s)), half_us, in_us(d.dc_link_discharge_s),
          in_micro(d.rest_current_c_rate * d.capacity_ah)};
}

struct ContactorInput {
  Request request = Request::none;
  bool open = false, open_now = false;  ///< a fault with this reaction is active
  bool charge_forbidden = false, discharge_forbidden = false;
  std::int32_t current_ua = measurement::no_reading, pack_uv = measurement::no_reading,
               dc_link_uv = measurement::no_reading;
  std::uint32_t step_us;
};

/// Faults that the contactors detect.
struct ContactorEvents {
  bool precharge_failed : 1 = false, welded : 1 = false, not_closed : 1 = false;
};

class Contactors {
 public:
  static constexpr std::uint32_t grace_us = 5'000'000;  ///< for a truck to reduce its current when 0 A are allowed

  constexpr explicit Contactors(const ContactorPlan& plan) : plan_(&plan) {}

  constexpr const Outputs& update(const ContactorInput& in) {
    events_ = {};
    events_.welded = weld_detected_;
    if (!intact()) enter(ContactorState::safe);
    count(in_state_us_, in.step_us, plan_->longest_us());
    if (in.request != last_request_) last_request_ = Request::none;
    step(in);
    return outputs_ = outputs_in(in);
  }

  constexpr ContactorState state() const { return static_cast<ContactorState>(state_.value()); }
  constexpr bool intact() const { return state_.intact() && state_.value() < contactor_state_count; }
  constexpr const ContactorEvents& events() const { return events_; }
  constexpr const Outputs& outputs() const { return outputs_; }

 private:
  static constexpr std::uint32_t max_half_time_constants = 12;
  /// 1 - exp(-k / 2) - 1/5 for k = 0 .. 11, in 1/1024.
  static constexpr std::array<std::int32_t, max_half_time_constants> min_precharge_curve = {
      0, 198, 442, 591, 681, 735, 768, 788, 800, 808, 812, 815};

  constexpr void enter(ContactorState s) {
    state_.set(static_cast<std::uint32_t>(s));
    in_state_us_ = 0;
    dc_link_at_entry_uv_ = measurement::no_reading;
    if (s != ContactorState::unloading) overrun_us_ = 0;  // a second reason does not restart the grace time
  }

  constexpr void step(const ContactorInput& in) {
    const ContactorState s = state();
    const bool may_close = s == ContactorState::self_test || s == ContactorState::precharge ||
                           s == ContactorState::drive || s == ContactorState::charge || s == ContactorState::unloading;
    if (in.open_now && may_close) return enter(ContactorState::opening);
    switch (s) {
      case ContactorState::off:
        return in_off(in);
      case ContactorState::self_test:
        return in_self_test(in);
      case ContactorState::precharge:
        return in_precharge(in);
      case ContactorState::drive:
        return closed(in, Request::drive);
      case ContactorState::charge:
        return closed(in, Request::charge);
      case ContactorState::unloading:
        return in_unloading(in);
      case ContactorState::opening:
        return in_opening(in);
      case ContactorState::safe:
        return in_safe(in);
    }
  }

  constexpr Outputs outputs_in(const ContactorInput& in) const {
    switch (state()) {
      case ContactorState::self_test:
        return {.main_plus = false, .main_minus = part() == 2, .precharge = part() == 1};
      case ContactorState::precharge:
        return {.main_plus = false, .main_minus = true, .precharge = true};
      case ContactorState::drive:
      case ContactorState::unloading:
        return {.main_plus = true, .main_minus = true};
      case ContactorState::charge:
        return {.main_plus = true,
                .main_minus = true,
                .precharge = false,
                .charge_enable = in_state_us_ >= plan_->test_us && !in.charge_forbidden && !events_.not_closed};
      default:
        return {};
    }
  }

  constexpr bool blocked(const ContactorInput& in) const {
    return in.open || (in.request == Request::drive && in.discharge_forbidden) ||
           (in.request == Request::charge && in.charge_forbidden);
  }

  static constexpr void count(std::uint32_t& us, std::uint32_t step_us, std::uint32_t most) {
    us = us >= most || step_us >= most - us ? most : us + step_us;
  }

  constexpr void in_off(const ContactorInput& in) {
    check_opened(in);
    if (in.open || in.open_now) return enter(ContactorState::safe);
    if (in.request == Request::none || in.request == last_request_ || blocked(in) || events_.welded) return;
    last_request_ = in.request;
    enter(ContactorState::self_test);
  }

  /// Part of the self-test: 0 all open, 1 precharge relay alone, 2 main minus alone.
  constexpr std::uint32_t part() const {
    if (in_state_us_ < plan_->test_us) return 0;
    return in_state_us_ - plan_->test_us < plan_->test_us ? 1 : 2;
  }

  constexpr void in_self_test(const ContactorInput& in) {
    check_opened(in);
    const bool known = in.dc_link_uv != measurement::no_reading && in.pack_uv != measurement::no_reading &&
                       in.current_ua != measurement::no_reading;
    if (known && dc_link_at_entry_uv_ != measurement::no_reading &&
        in.dc_link_uv - dc_link_at_entry_uv_ > in.pack_uv / 8)
      events_.welded = weld_detected_ = true;
    if (known && (dc_link_at_entry_uv_ == measurement::no_reading || in.dc_link_uv < dc_link_at_entry_uv_))
      dc_link_at_entry_uv_ = in.dc_link_uv;
    if (events_.welded) return enter(ContactorState::opening);
    if (in.request == Request::none || blocked(in)) return enter(ContactorState::opening);
    if (!known && in_state_us_ >= 2 * plan_->test_us) return fail_precharge();
    if (in_state_us_ >= 2 * plan_->test_us && in_state_us_ - 2 * plan_->test_us >= plan_->test_us)
      enter(ContactorState::precharge);
  }

  constexpr void fail_precharge() {
    enter(ContactorState::opening);
    events_.precharge_failed = true;
  }

  constexpr void in_precharge(const ContactorInput& in) {
    if (in.request == Request::none || blocked(in)) return enter(ContactorState::opening);
    const std::uint32_t halves = in_state_us_ / plan_->half_time_constant_us;
    if (halves >= max_half_time_constants) return fail_precharge();
    if (in.dc_link_uv == measurement::no_reading || in.pack_uv == measurement::no_reading) return;
    if (in.dc_link_uv < part_of(in.pack_uv, min_precharge_curve[halves])) return fail_precharge();
    if (in.dc_link_uv >= part_of(in.pack_uv, 960))
      enter(in.request == Request::drive ? ContactorState::drive : ContactorState::charge);
  }

  constexpr void closed(const ContactorInput& in, Request mine) {
    if (in.dc_link_uv != measurement::no_reading && in.pack_uv != measurement::no_reading)
      events_.not_closed = in.dc_link_uv < part_of(in.pack_uv, 960);
    count_grace(in, forbidden_current_flows(in));
    if (overrun_us_ == grace_us) return enter(ContactorState::opening);
    if (in.request != mine || in.open) enter(ContactorState::unloading);
  }

  constexpr void in_unloading(const ContactorInput& in) {
    const bool flows = in.current_ua == measurement::no_reading || magnitude(in.current_ua) > plan_->rest_ua;
    count_grace(in, in.open || forbidden_current_flows(in));
    if (!flows || overrun_us_ == grace_us) enter(ContactorState::opening);
  }

  constexpr bool forbidden_current_flows(const ContactorInput& in) const {
    return in.current_ua != measurement::no_reading && ((in.charge_forbidden && in.current_ua > plan_->rest_ua) ||
                                                        (in.discharge_forbidden && in.current_ua < -plan_->rest_ua));
  }
  /// Counts the time in which a current flows that has to cease. A missing reading does not restart it.
  constexpr void count_grace(const ContactorInput& in, bool to_cease) {
    if (to_cease)
      count(overrun_us_, in.step_us, grace_us);
    else if (in.current_ua != measurement::no_reading)
      overrun_us_ = 0;
  }

  constexpr void in_opening(const ContactorInput& in) {
    const bool faulted = in.open || in.open_now;
    const bool fell = in.dc_link_uv != measurement::no_reading && in.pack_uv != measurement::no_reading &&
                      in.dc_link_uv < part_of(in.pack_uv, 896);
    const bool rests = in.current_ua != measurement::no_reading && magnitude(in.current_ua) <= plan_->rest_ua,
               flows = in.current_ua != measurement::no_reading && !rests;
    if (fell && rests && in_state_us_ >= plan_->test_us)
      return enter(faulted ? ContactorState::safe : ContactorState::off);
    check_opened(in);
    if (in_state_us_ < plan_->test_us || (!flows && in_state_us_ < plan_->dc_link_discharge_us))
      events_.welded = weld_detected_;  // the DC link may still fall; unknown is not welded
    if (in_state_us_ < plan_->dc_link_discharge_us) return;
    // Without readings a weld is neither proven nor excluded; nor can the contactors close again.
    if (faulted)
      enter(ContactorState::safe);
    else if (!events_.welded)
      enter(ContactorState::off);
  }

  constexpr void in_safe(const ContactorInput& in) {
    if (in_state_us_ >= plan_->dc_link_discharge_us) check_opened(in);
    if (!in.open && !in.open_now && in.request == Request::none) enter(ContactorState::off);
  }

  /// Checks for a weld while all contactors or one pole are open.
  constexpr void check_opened(const ContactorInput& in) {
    const bool flows = in.current_ua != measurement::no_reading && magnitude(in.current_ua) > plan_->rest_ua;
    const bool stands = in.dc_link_uv != measurement::no_reading && in.pack_uv != measurement::no_reading &&
                        in.pack_uv > 0 && in.dc_link_uv >= part_of(in.pack_uv, 896);
    events_.welded = weld_detected_ || flows || stands;
  }

  static constexpr std::int32_t part_of(std::int32_t uv, std::int32_t of_1024) {
    return static_cast<std::int32_t>(static_cast<std::int64_t>(uv) * of_1024 / 1024);
  }

  const ContactorPlan* plan_;
  Guarded state_{static_cast<std::uint32_t>(ContactorState::off)};
  std::uint32_t in_state_us_ = 0, overrun_us_ = 0;
  Request last_request_ = Request::none;  ///< the request that was followed last; only a new request is followed again
  std::int32_t dc_link_at_entry_uv_ = measurement::no_reading;  ///< lowest DC link in this self-test
  ContactorEvents events_;
  bool weld_detected_ : 1 = false;  ///< by the self-test; kept until the next start
  Outputs outputs_;
};

}  // namespace bms::protection
