// A battery of a group between its contactors and the bus: what it sends about itself, which request its contactors
// follow, and the limits that it publishes.
//
//   request    that of the truck or the charger, which every battery receives; none while the group does not let this
//              battery close. The contactors follow a request that begins, so a grant starts their self-test
//   leave      the contactors open at once, without a fault: when nothing arrives from a leader, and after the end of
//              a request when the truck draws nothing. The current between batteries that differ does not end by
//              itself, so the contactors of one alone would wait for ever. The batteries that remain hold the DC link,
//              so a contact opens at a small voltage
//   limits     of the whole group if this battery leads, else 0: only the leader speaks with truck and charger
//
// Call update() with every sample, after the frames of the bus were received, and send frames().
#pragma once

#include <array>
#include <cstdint>

#include "measurement/sample.hpp"
#include "parallel/group_bus.hpp"
#include "parallel/parallel_battery.hpp"
#include "protection/contactors.hpp"

namespace bms::parallel {

class GroupMember {
 public:
  /// Of this battery. open_circuit_uv: measurement::no_reading while it is not known.
  struct Input {
    protection::Request request = protection::Request::none;
    protection::ContactorState state = protection::ContactorState::off;
    std::int32_t open_circuit_uv = measurement::no_reading, current_ua = measurement::no_reading;
    std::int32_t allowed_discharge_ua = 0, allowed_charge_ua = 0;
    std::int32_t rest_ua = 0;  ///< below it no current flows; of one battery
    bool charge_wanted = false;
  };
  struct Order {
    protection::Request request = protection::Request::none;
    bool leave = false;  ///< for ContactorInput::coils_dead, which opens without a fault
    std::int32_t discharge_ua = 0, charge_ua = 0;
  };

  constexpr explicit GroupMember(const Design& design) : logic_(design) { own_.node = design.node; }

  constexpr void receive(const can::Frame& frame, std::uint64_t time_us) {
    if (const auto presence = bus_.receive(frame)) logic_.receive(*presence, time_us);
  }

  constexpr Order update(const Input& in, std::uint64_t time_us) {
    own_.state = state_of(in);
    own_.open_circuit_uv = in.open_circuit_uv;
    own_.current_ua = in.current_ua == measurement::no_reading ? 0 : in.current_ua;
    own_.allowed_discharge_ua = in.allowed_discharge_ua;
    own_.allowed_charge_ua = in.allowed_charge_ua;
    own_.charge_wanted = in.charge_wanted;
    const Decision& d = logic_.step(own_, static_cast<Request>(in.request), time_us);
    const bool asked = in.request != protection::Request::none;
    const bool stays = closing(in.state) ? d.may_close : d.may_close && !d.must_open;
    return {.request = asked && stays ? in.request : protection::Request::none,
            .leave = own_.state == State::connected && (d.leaderless || (!asked && truck_rests(d, in.rest_ua))),
            .discharge_ua = d.group_discharge_ua,
            .charge_ua = d.group_charge_ua};
  }

  /// For the bus, after update().
  constexpr std::array<can::Frame, 2> frames() { return bus_.frames(own_); }
  const Decision& decision() const { return logic_.decision(); }

 private:
  static_assert(static_cast<int>(Request::drive) == static_cast<int>(protection::Request::drive) &&
                static_cast<int>(Request::charge) == static_cast<int>(protection::Request::charge));

  static constexpr bool closing(protection::ContactorState s) {
    return s == protection::ContactorState::self_test || s == protection::ContactorState::precharge;
  }
  static constexpr bool truck_rests(const Decision& d, std::int32_t rest_ua) {
    const std::int64_t most_ua = static_cast<std::int64_t>(d.connected) * rest_ua;
    return d.total_ua >= -most_ua && d.total_ua <= most_ua;
  }
  /// A fault keeps the contactors in safe.
  static constexpr State state_of(const Input& in) {
    using enum protection::ContactorState;
    if (in.state == drive || in.state == charge || in.state == unloading) return State::connected;
    const bool able = in.state == off || closing(in.state);
    return able && in.open_circuit_uv != measurement::no_reading ? State::open : State::unable;
  }

  ParallelBattery logic_;
  GroupBus bus_;
  Presence own_;
};

}  // namespace bms::parallel
