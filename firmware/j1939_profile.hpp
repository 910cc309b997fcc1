// Sends DC_SOURCE_STATUS_1, 2, 3, 4, 6 and 11 of RV-C in addition to the battery's own messages, for chargers and
// displays of other makers. RV-C is a J1939 protocol with open layouts (firmware/can/j1939_profile.dbc; sources:
// firmware/can/messages.md). Build option: BMS_VEHICLE_PROFILE=j1939.
//
// Each message has its own cycle, in the time of the samples, and is sent while a node listens, from an address that is
// claimed (j1939_address.hpp). No other request is answered. There is no end-to-end protection: use the battery's own
// messages for everything that opens contactors. The allowed discharge current has no signal here, only DischargeOn.
// Cost: six frames of at most 160 bits, seven per second: 0.5 % of 250 kbit/s.
#pragma once

#include <cstdint>
#include <tuple>

#include "firmware/cycle.hpp"
#include "firmware/j1939_address.hpp"
#include "firmware/messages.hpp"
#include "firmware/power_requests.hpp"
#include "firmware/snapshot.hpp"
#include "hal/can.hpp"
#include "j1939_messages.hpp"  // generated from firmware/can/j1939_profile.dbc

namespace bms::firmware {

namespace j1939 {

using namespace can::j1939;

inline constexpr std::uint32_t instance = 1, soc_known_priority = 120, current_unknown = 0xFFFF'FFFF;

constexpr std::uint32_t flag(bool b) { return b ? 1 : 0; }

/// Converts to units of 1 mA with an offset of 2,000,000 A. Here discharging is positive.
constexpr std::uint32_t offset_milliamperes(std::int32_t current_ua) {
  return current_ua == measurement::no_reading ? current_unknown
                                               : static_cast<std::uint32_t>(2'000'000'000 - current_ua / 1'000);
}

template <class Message>
constexpr Message message_of_instance() {
  Message m;
  m.instance = instance;
  m.device_priority = soc_known_priority;
  return m;
}

template <class Estimator, std::size_t Cells>
constexpr DcSourceStatus1 status_1(const Snapshot<Estimator, Cells>& now) {
  auto m = message_of_instance<DcSourceStatus1>();
  m.voltage = messages::volts(now.pack.pack_uv);
  m.current = offset_milliamperes(now.pack.current_ua);
  return m;
}

template <class Estimator, std::size_t Cells>
constexpr DcSourceStatus2 status_2(const Snapshot<Estimator, Cells>& now) {
  auto m = message_of_instance<DcSourceStatus2>();
  m.source_temperature = messages::degrees(now.pack.temperature_cdegc[0]);
  if (now.soc_known()) m.state_of_charge = messages::percent(now.condition.display_soc());
  return m;
}

template <class Estimator, std::size_t Cells>
constexpr DcSourceStatus3 status_3(const Snapshot<Estimator, Cells>& now) {
  auto m = message_of_instance<DcSourceStatus3>();
  const auto capacity_ratio = now.condition.capacity().ratio;
  m.state_of_health = messages::percent(capacity_ratio);
  if (now.soc_known())
    m.capacity_remaining =
        now.capacity_ah * messages::number(capacity_ratio) * messages::number(now.condition.display_soc());
  return m;
}

constexpr DcSourceStatus4 status_4(const protection::Decision& d, const protection::ProtectionPlan& plan) {
  auto m = message_of_instance<DcSourceStatus4>();
  m.desired_charge_state = d.allowed.charge_ua > 0 ? DcSourceStatus4::desired_charge_state_constant_voltage_or_current
                                                   : DcSourceStatus4::desired_charge_state_do_not_charge;
  m.desired_voltage = static_cast<float>(plan.cells) * messages::volts(plan.derating.charge_voltage.to);
  m.desired_current = messages::amperes(d.allowed.charge_ua);
  m.battery_type = DcSourceStatus4::battery_type_lithium_iron_phosphate;
  return m;
}

constexpr DcSourceStatus6 status_6(const protection::Decision& d) {
  using protection::bit, protection::Fault;
  constexpr protection::FaultSet above =
      bit(Fault::cell_overvoltage) | bit(Fault::cell_overvoltage_severe) | bit(Fault::pack_overvoltage);
  constexpr protection::FaultSet below = bit(Fault::cell_undervoltage) | bit(Fault::cell_undervoltage_severe) |
                                         bit(Fault::pack_undervoltage) | bit(Fault::deep_discharge);
  auto m = message_of_instance<DcSourceStatus6>();
  m.high_voltage_limit = flag((d.faults & (above | bit(Fault::cell_overvoltage_warning))) != 0);
  m.high_voltage_disconnect = flag((d.faults & above) != 0 && !d.outputs.main_plus);
  m.low_voltage_limit = flag((d.faults & (below | bit(Fault::cell_undervoltage_warning))) != 0);
  m.low_voltage_disconnect = flag((d.faults & below) != 0 && !d.outputs.main_plus);
  return m;
}

template <class Estimator, std::size_t Cells>
constexpr DcSourceStatus11 status_11(const Snapshot<Estimator, Cells>& now) {
  auto m = message_of_instance<DcSourceStatus11>();
  const protection::Decision& d = now.decision;
  const std::int32_t current_ua = now.pack.current_ua;
  const bool closed = d.outputs.main_plus && d.outputs.main_minus;
  m.discharge_on = flag(closed && d.allowed.discharge_ua > 0);
  m.charge_on = flag(closed && d.allowed.charge_ua > 0);
  m.charge_detected = flag(current_ua != measurement::no_reading && current_ua > now.plan.contactors.rest_ua);
  m.full_capacity = now.capacity_ah * messages::number(now.condition.capacity().ratio);
  return m;
}

}  // namespace j1939

class J1939Profile {
 public:
  /// Sends the messages that are due.
  template <class Estimator, std::size_t Cells>
  void publish(const Snapshot<Estimator, Cells>& now) {
    if (!hal::can_listening()) return address_.stop();
    now_us_ = static_cast<std::uint32_t>(now.pack.time_us);
    if (!address_.update(now.pack.time_us)) return;
    send_if_due<j1939::DcSourceStatus1>([&] { return j1939::status_1(now); });
    send_if_due<j1939::DcSourceStatus2>([&] { return j1939::status_2(now); });
    send_if_due<j1939::DcSourceStatus3>([&] { return j1939::status_3(now); });
    send_if_due<j1939::DcSourceStatus4>([&] { return j1939::status_4(now.decision, now.plan); });
    send_if_due<j1939::DcSourceStatus6>([&] { return j1939::status_6(now.decision); });
    send_if_due<j1939::DcSourceStatus11>([&] { return j1939::status_11(now); });
  }

  void receive(const can::Frame& frame, std::uint64_t now_us) { address_.receive(frame, now_us); }
  constexpr ChargerState charger(std::uint64_t) const { return {}; }

 private:
  template <class Message>
  struct SendState : Cycle {};
  template <class>
  struct SendStatesOf;
  template <class... Message>
  struct SendStatesOf<std::tuple<Message...>> {
    using type = std::tuple<SendState<Message>...>;
  };

  template <class Message, class Make>
  void send_if_due(Make&& message) {
    if (!std::get<SendState<Message>>(sent_).due(now_us_, Message::cycle_us)) return;
    can::Frame frame = message().frame();
    frame.id = (frame.id & ~std::uint32_t{0xFF}) | address_.value();
    hal::can_send(frame);
  }

  j1939::Address address_{j1939::Name{}.value()};
  typename SendStatesOf<can::j1939::Messages>::type sent_{};
  std::uint32_t now_us_ = 0;
};

}  // namespace bms::firmware
