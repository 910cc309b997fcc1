// The pack's three contactors: their order, and whether they did what was commanded.
//
//                 main+  main-  pre    leaves for
//   off             -      -     -     self_test      a truck or a charger makes a new request, and no fault forbids it
//                                      safe           a fault opens
//   self_test       -      -     -     precharge      after three parts of at least one test time each, see below
//                   relay
//   precharge       -      x     x     drive, charge  the DC link is full
//   drive           x      x     (x)   unloading      the request ends, a fault opens, or forbidden current flows
//   charge          x      x     (x)   the same; the charger is enabled. (x): until main+ has had time to close
//   unloading       x      x     -     opening        no current flows, or a fault or a forbidden current has used up
//                                                     its grace time
//   opening         -      -     -     off, safe      all are open and no current flows; safe with a fault
//   safe            -      -     -     off            no fault opens any more, and there is no request
//
// A severe fault opens at once from every state. Only a severe fault, a contact that opened by itself, and a current
// that should have ceased and did not, open under load. When a truck withdraws its request, the contactors stay closed
// until its current is zero. State and part of the self-test are stored three times; contradicting copies or an invalid
// state lead to safe, all open, with an internal fault.
//
// Both poles of the DC link are measured (dc_link.hpp). A main contactor may have an auxiliary contact.
//
//   self-test   all open. Precharge relay alone: L+ must become the pack, and a pole that it does not move is welded.
//               Main- alone: L- must become 0. Two samples in a row prove a weld.
//   precharge   with `gap` = difference between pack and DC link, at first `gap_0`, and the time constant RC:
//               full       gap <= 2 % of the pack; or after 3 RC, when the DC link moves by less than 0.5 % of the pack
//                          in half an RC, because a load divides the voltage with the resistor. In both cases gap <=
//                          closing current x closing loop, or half of it if a drive holds the DC link above the pack.
//               too slow   gap > gap_0 exp(-2 t / 3 RC) + a fifth of the pack, at the last half RC that is over; or
//                          not full after 7 RC. The resistor would burn.
//               too fast   gap < gap_0 / 8 within half an RC: a quarter of the time constant, the resistor is shorted.
//                          Visible if the samples are closer than half an RC and gap_0 is more than an eighth of the
//                          pack.
//   welded      with all outputs off a pole is held (weld_test.hpp), current flows, or an auxiliary contact is closed
//   not closed  with both outputs on a pole differs from the pack by a sixteenth of it, for 0.3 s (table). At once: by
//               a quarter of it, by an auxiliary contact, or by its interrupt. Also main- that does not close.
//
// No supply of the coils (an input that may be fitted) is a state and no fault: the contactors have opened, and close
// again with the next new request.
//
// A pack without a DC link (PackDesign::dc_link) closes from off to drive or charge; only its current shows a weld.
//
// Times are durations that stop at their limit, so nothing wraps. Integers only.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "measurement/sample.hpp"
#include "protection/contactor_plan.hpp"
#include "protection/dc_link.hpp"
#include "protection/guarded.hpp"
#include "protection/weld_test.hpp"

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

/// Contacts that move with the main contacts. Without them the voltages stand alone.
struct AuxiliaryContacts {
  bool fitted : 1 = false, main_plus_closed : 1 = false, main_minus_closed : 1 = false;

  constexpr bool operator==(const AuxiliaryContacts&) const = default;
};

struct ContactorInput {
  Request request = Request::none;
  bool open = false, open_now = false;  ///< a fault with this reaction is active
  bool charge_forbidden = false, discharge_forbidden = false;
  bool contact_lost = false;  ///< a main contact has opened by itself since the last step, perhaps only for a moment
  bool coils_dead = false;    ///< the coils have no supply, so nothing closes: by an emergency stop
  std::int32_t current_ua = measurement::no_reading, pack_uv = measurement::no_reading,
               link_plus_uv = measurement::no_reading, link_minus_uv = measurement::no_reading;
  AuxiliaryContacts auxiliary = {};
  std::uint32_t step_us;
};

/// Faults that the contactors detect.
struct ContactorEvents {
  bool precharge_failed : 1 = false, welded : 1 = false, not_closed : 1 = false;
};

class Contactors {
 public:
  static constexpr std::uint32_t grace_us = 5'000'000;  ///< for a truck to reduce its current when 0 A are allowed
  /// From a change of the outputs to the first reading that shows it: a contactor closes within 35 ms and opens within
  /// 15 ms, and the inputs follow within 15 ms. It is also the time in which main plus closes next to the relay.
  static constexpr std::uint32_t response_us = 75'000;

  constexpr explicit Contactors(const ContactorPlan& plan) : plan_(&plan) {}

  constexpr const Outputs& update(const ContactorInput& in) {
    const DcLink link = plan_->dc_link ? DcLink{in.pack_uv, in.link_plus_uv, in.link_minus_uv} : DcLink{};
    events_ = {};
    events_.welded = weld_detected_;
    if (in.open_now) not_closed_ = false;  // the table has it
    if (!intact()) enter(ContactorState::safe);
    count(in_state_us_, in.step_us, plan_->longest_us());
    count(unchanged_us_, in.step_us, response_us);
    const bool mains_open = outputs_visible() && !outputs_.main_plus && !outputs_.main_minus;
    weld_test_.update(mains_open, outputs_.precharge, link);
    if (in.request != last_request_) last_request_ = Request::none;
    step(in, link);
    events_.not_closed = events_.not_closed || not_closed_;
    const Outputs next = outputs_in(in);
    if (next != outputs_) unchanged_us_ = 0;
    return outputs_ = next;
  }

  constexpr ContactorState state() const { return static_cast<ContactorState>(state_.value() & state_mask); }
  constexpr bool intact() const { return state_.intact() && valid(state_.value()); }
  constexpr const ContactorEvents& events() const { return events_; }
  constexpr const Outputs& outputs() const { return outputs_; }
  /// Pole that was found welded last; none: no weld since the start.
  constexpr Pole welded_pole() const { return welded_pole_; }

 private:
  static constexpr std::uint32_t state_mask = 15, part_shift = 4, last_part = 2;
  /// exp(-k / 3) for k = 0 .. 13 half time constants, in 1/1024.
  static constexpr std::array<std::int16_t, ContactorPlan::max_half_time_constants> slowest_gap = {
      1024, 734, 526, 377, 270, 193, 139, 99, 71, 51, 37, 26, 19, 13};

  static constexpr bool valid(std::uint32_t value) {
    return value < contactor_state_count ||
           ((value & state_mask) == static_cast<std::uint32_t>(ContactorState::self_test) &&
            value >> part_shift <= last_part);
  }
  /// Part of the self-test: 0 all open, 1 precharge relay alone, 2 main minus alone.
  constexpr std::uint32_t part() const { return state_.value() >> part_shift; }

  constexpr void enter(ContactorState s, std::uint32_t test_part = 0) {
    state_.set(static_cast<std::uint32_t>(s) | test_part << part_shift);
    in_state_us_ = 0;
    proven_ = suspected_ = false;
    if (test_part == 0) weld_test_.restart();
    first_gap_uv_ = last_gap_uv_ = measurement::no_reading;
    last_half_ = 0;
    if (s != ContactorState::unloading) overrun_us_ = 0;  // a second reason does not restart the grace time
  }

  constexpr bool outputs_visible() const { return unchanged_us_ == response_us; }

  constexpr void step(const ContactorInput& in, const DcLink& link) {
    const ContactorState s = state();
    const bool may_close = s == ContactorState::self_test || s == ContactorState::precharge ||
                           s == ContactorState::drive || s == ContactorState::charge || s == ContactorState::unloading;
    if ((in.open_now || in.coils_dead) && may_close) return enter(ContactorState::opening);
    if (may_close && contact_opened(in, link)) return fail_to_close();
    switch (s) {
      case ContactorState::off:
        return in_off(in);
      case ContactorState::self_test:
        return in_self_test(in, link);
      case ContactorState::precharge:
        return in_precharge(in, link);
      case ContactorState::drive:
        return closed(in, link, Request::drive);
      case ContactorState::charge:
        return closed(in, link, Request::charge);
      case ContactorState::unloading:
        return in_unloading(in);
      case ContactorState::opening:
        return in_opening(in, link);
      case ContactorState::safe:
        return in_safe(in);
    }
  }

  constexpr Outputs outputs_in(const ContactorInput& in) const {
    const bool closing = plan_->dc_link && in_state_us_ < response_us;
    switch (state()) {
      case ContactorState::self_test:
        return {.main_plus = false, .main_minus = part() == 2, .precharge = part() == 1};
      case ContactorState::precharge:
        return {.main_plus = false, .main_minus = true, .precharge = true};
      case ContactorState::drive:
        return {.main_plus = true, .main_minus = true, .precharge = closing};
      case ContactorState::unloading:
        return {.main_plus = true, .main_minus = true};
      case ContactorState::charge:
        return {.main_plus = true,
                .main_minus = true,
                .precharge = closing,
                .charge_enable = in_state_us_ >= plan_->test_us && !in.charge_forbidden && !events_.not_closed};
      default:
        return {};
    }
  }

  /// Returns true if a main contact is certainly open although its output is on.
  constexpr bool contact_opened(const ContactorInput& in, const DcLink& link) const {
    if (!outputs_.main_plus && !outputs_.main_minus) return false;
    if (in.contact_lost) return true;
    if (!outputs_visible()) return false;
    if (in.auxiliary.fitted && ((outputs_.main_plus && !in.auxiliary.main_plus_closed) ||
                                (outputs_.main_minus && !in.auxiliary.main_minus_closed)))
      return true;
    return outputs_.main_plus && link.known() && link.pole_lost();
  }

  constexpr void fail_to_close() {
    enter(ContactorState::opening);
    not_closed_ = true;
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
    if (in.coils_dead) last_request_ = in.request;  // the release of an emergency stop must not start the truck
    if (in.request == Request::none || in.request == last_request_ || blocked(in) || events_.welded) return;
    last_request_ = in.request;
    if (plan_->dc_link)
      enter(ContactorState::self_test);
    else
      close(in);
  }

  constexpr void close(const ContactorInput& in) {
    enter(in.request == Request::drive ? ContactorState::drive : ContactorState::charge);
  }

  constexpr void in_self_test(const ContactorInput& in, const DcLink& link) {
    check_opened(in);
    if (link.known() && outputs_visible())
      proven_ = proven_ || part() == 0 || (part() == 1 ? link.plus_at_pack() : link.minus_at_zero());
    if (in.request == Request::none || blocked(in)) return enter(ContactorState::opening);
    if (suspect_weld() || in_state_us_ < plan_->test_us) return;
    if (!proven_) return fail_precharge(link);
    if (part() < last_part) return enter(ContactorState::self_test, part() + 1);
    const std::int32_t gap_uv = link.known() ? link.gap_uv() : measurement::no_reading;
    enter(ContactorState::precharge);
    first_gap_uv_ = last_gap_uv_ = gap_uv;
  }

  /// Returns true if this sample shows a weld. Two in a row prove it.
  constexpr bool suspect_weld() {
    const bool proven = events_.welded && suspected_;
    suspected_ = events_.welded;
    weld_detected_ = weld_detected_ || proven;
    if (proven) enter(ContactorState::opening);
    return events_.welded;
  }

  constexpr void fail_precharge(const DcLink& link) {
    if (outputs_.main_minus && link.known() && !link.minus_at_zero()) return fail_to_close();
    enter(ContactorState::opening);
    events_.precharge_failed = true;
  }

  constexpr void in_precharge(const ContactorInput& in, const DcLink& link) {
    if (in.request == Request::none || blocked(in)) return enter(ContactorState::opening);
    check_poles(in);
    if (suspect_weld()) return;
    const std::uint32_t half = in_state_us_ / plan_->half_time_constant_us;
    if (half >= ContactorPlan::max_half_time_constants) return fail_precharge(link);
    if (!link.known()) return;
    const std::int32_t gap_uv = link.gap_uv(), pack_uv = link.pack_uv;
    if (first_gap_uv_ == measurement::no_reading) first_gap_uv_ = last_gap_uv_ = gap_uv;
    const std::int32_t slowest_uv = first_gap_uv_ / 1024 * slowest_gap[half] + pack_uv / 5;
    const bool too_fast = half == 0 && first_gap_uv_ > pack_uv / 8 && gap_uv < first_gap_uv_ / 8;
    if (too_fast || gap_uv > slowest_uv) return fail_precharge(link);
    bool still = false;
    if (half != last_half_) {
      still = half >= 6 && magnitude(gap_uv - last_gap_uv_) < pack_uv / 200;
      last_gap_uv_ = gap_uv;
      last_half_ = static_cast<std::uint8_t>(half);
    }
    // above the pack half: the dividers' range may end there, and the DC link be higher
    const std::int32_t most_uv = plan_->max_closing_gap_uv;
    const bool near = gap_uv <= (link.link_uv() > pack_uv ? most_uv / 2 : most_uv);
    if ((still || gap_uv <= pack_uv / 50) && near && link.minus_at_zero()) close(in);
  }

  constexpr void closed(const ContactorInput& in, const DcLink& link, Request mine) {
    events_.not_closed = link.known() && link.pole_differs();
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

  constexpr bool rests(const ContactorInput& in) const {
    return in.current_ua != measurement::no_reading && magnitude(in.current_ua) <= plan_->rest_ua;
  }

  constexpr void in_opening(const ContactorInput& in, const DcLink& link) {
    if (in_state_us_ < plan_->test_us) return;  // an arc, or the mean over the last sample
    check_opened(in);
    const bool faulted = in.open || in.open_now;
    const bool certain = rests(in) && (link.known() || !plan_->dc_link);
    // Without readings a weld is neither proven nor excluded; nor can the contactors close again.
    if (not_closed_ || (!certain && in_state_us_ < ContactorPlan::without_readings_us)) return;
    if (faulted)
      enter(ContactorState::safe);
    else if (!events_.welded)
      enter(ContactorState::off);
  }

  constexpr void in_safe(const ContactorInput& in) {
    if (in_state_us_ >= plan_->test_us) check_opened(in);
    if (!in.open && !in.open_now && in.request == Request::none) enter(ContactorState::off);
  }

  /// Pole that is closed although its outputs are off.
  constexpr Pole closed_while_off(const ContactorInput& in) const {
    if (!outputs_visible()) return Pole::none;
    if (in.auxiliary.fitted && in.auxiliary.main_plus_closed && !outputs_.main_plus) return Pole::plus;
    if (in.auxiliary.fitted && in.auxiliary.main_minus_closed && !outputs_.main_minus) return Pole::minus;
    return weld_test_.pole();
  }

  constexpr void check_poles(const ContactorInput& in) {
    const Pole pole = closed_while_off(in);
    if (pole == Pole::none) return;
    events_.welded = true;
    if (pole != Pole::unknown || welded_pole_ == Pole::none) welded_pole_ = pole;
  }
  /// Checks for a weld while all contactors or one pole are open. Which pole, a current does not show.
  constexpr void check_opened(const ContactorInput& in) {
    check_poles(in);
    if (in.current_ua == measurement::no_reading || rests(in)) return;
    events_.welded = true;
    if (welded_pole_ == Pole::none) welded_pole_ = Pole::unknown;
  }

  const ContactorPlan* plan_;
  Guarded state_{static_cast<std::uint32_t>(ContactorState::off)};
  std::uint32_t in_state_us_ = 0, overrun_us_ = 0;
  std::uint32_t unchanged_us_ = 0;  ///< since the outputs changed, up to response_us
  std::int32_t first_gap_uv_ = measurement::no_reading, last_gap_uv_ = measurement::no_reading;  ///< of this precharge
  WeldTest weld_test_;
  std::uint8_t last_half_ = 0;            ///< half time constant of last_gap_uv_
  Request last_request_ = Request::none;  ///< the request that was followed last; only a new request is followed again
  Pole welded_pole_ = Pole::none;
  bool proven_ : 1 = false;         ///< the commanded contactor of this part has closed
  bool suspected_ : 1 = false;      ///< the last sample of the self-test showed a weld
  bool weld_detected_ : 1 = false;  ///< by the self-test; kept until the next start
  bool not_closed_ : 1 = false;     ///< kept until the table has it
  ContactorEvents events_;
  Outputs outputs_;
};

}  // namespace bms::protection
