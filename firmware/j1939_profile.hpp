// The battery in messages that chargers and displays of other makers know, beside its own: DC_SOURCE_STATUS_1, 2, 3, 4,
// 6 and 11 of RV-C, a J1939 whose layouts are open (can/j1939_profile.dbc; where they come from: can/messages.md).
// Build option BMS_VEHICLE_PROFILE=j1939.
//
// Each by its cycle time, in the samples' own time, while somebody listens. Nothing is received: no address is claimed,
// no request answered. They have no end-to-end protection: what opens contactors goes by the battery's own messages. An
// allowed discharging current has no place in them but DischargeOn. Cost: six frames of 160 bits at worst, seven a
// second: 0.5 % of 250 kbit/s.
#pragma once

#include <cstdint>
#include <tuple>

#include "firmware/cycle.hpp"
#include "firmware/messages.hpp"
#include "hal/can.hpp"
#include "j1939_messages.hpp"  // generated from can/j1939_profile.dbc
#include "measurement/pack_sample.hpp"
#include "protection/protection.hpp"

namespace bms::firmware {

namespace j1939 {

using namespace can::j1939;

inline constexpr std::uint32_t instance = 1, soc_known_priority = 120, current_unknown = 0xFFFF'FFFF;

constexpr std::uint32_t flag(bool b) { return b ? 1 : 0; }

/// Discharging above 0, 1 mA, 2,000,000 A off.
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

template <std::size_t Cells>
constexpr DcSourceStatus1 status_1(const measurement::PackSample<Cells>& pack) {
  auto m = message_of_instance<DcSourceStatus1>();
  m.voltage = messages::volts(pack.pack_uv);
  m.current = offset_milliamperes(pack.current_ua);
  return m;
}

template <std::size_t Cells, class Condition>
constexpr DcSourceStatus2 status_2(const measurement::PackSample<Cells>& pack, const Condition& condition,
                                   bool soc_known) {
  auto m = message_of_instance<DcSourceStatus2>();
  m.source_temperature = messages::degrees(pack.temperature_cdegc[0]);
  if (soc_known) m.state_of_charge = messages::percent(condition.display_soc());
  return m;
}

template <class Condition>
constexpr DcSourceStatus3 status_3(const Condition& condition, float capacity_ah, bool soc_known) {
  auto m = message_of_instance<DcSourceStatus3>();
  m.state_of_health = messages::percent(condition.capacity().ratio);
  if (soc_known)
    m.capacity_remaining =
        capacity_ah * messages::number(condition.capacity().ratio) * messages::number(condition.display_soc());
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
  constexpr std::uint32_t above =
      bit(Fault::cell_overvoltage) | bit(Fault::cell_overvoltage_severe) | bit(Fault::pack_overvoltage);
  constexpr std::uint32_t below = bit(Fault::cell_undervoltage) | bit(Fault::cell_undervoltage_severe) |
                                  bit(Fault::pack_undervoltage) | bit(Fault::deep_discharge);
  auto m = message_of_instance<DcSourceStatus6>();
  m.high_voltage_limit = flag((d.faults & (above | bit(Fault::cell_overvoltage_warning))) != 0);
  m.high_voltage_disconnect = flag((d.faults & above) != 0 && !d.outputs.main_plus);
  m.low_voltage_limit = flag((d.faults & (below | bit(Fault::cell_undervoltage_warning))) != 0);
  m.low_voltage_disconnect = flag((d.faults & below) != 0 && !d.outputs.main_plus);
  return m;
}

template <std::size_t Cells, class Condition>
constexpr DcSourceStatus11 status_11(const measurement::PackSample<Cells>& pack, const Condition& condition,
                                     const protection::Decision& d, const protection::ProtectionPlan& plan,
                                     float capacity_ah) {
  auto m = message_of_instance<DcSourceStatus11>();
  const bool closed = d.outputs.main_plus && d.outputs.main_minus;
  m.discharge_on = flag(closed && d.allowed.discharge_ua > 0);
  m.charge_on = flag(closed && d.allowed.charge_ua > 0);
  m.charge_detected = flag(pack.current_ua != measurement::no_reading && pack.current_ua > plan.contactors.rest_ua);
  m.full_capacity = capacity_ah * messages::number(condition.capacity().ratio);
  return m;
}

}  // namespace j1939

class J1939Profile {
 public:
  /// soc_known: the estimator has started. capacity_ah: of the cell file.
  template <std::size_t Cells, class Condition>
  void publish(const measurement::PackSample<Cells>& pack, const Condition& condition, const protection::Decision& d,
               const protection::ProtectionPlan& plan, float capacity_ah, bool soc_known) {
    if (!hal::can_listening()) return;
    now_us_ = static_cast<std::uint32_t>(pack.time_us);
    send_if_due<j1939::DcSourceStatus1>([&] { return j1939::status_1(pack); });
    send_if_due<j1939::DcSourceStatus2>([&] { return j1939::status_2(pack, condition, soc_known); });
    send_if_due<j1939::DcSourceStatus3>([&] { return j1939::status_3(condition, capacity_ah, soc_known); });
    send_if_due<j1939::DcSourceStatus4>([&] { return j1939::status_4(d, plan); });
    send_if_due<j1939::DcSourceStatus6>([&] { return j1939::status_6(d); });
    send_if_due<j1939::DcSourceStatus11>([&] { return j1939::status_11(pack, condition, d, plan, capacity_ah); });
  }

  constexpr void receive(const can::Frame&) {}

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
    if (std::get<SendState<Message>>(sent_).due(now_us_, Message::cycle_us)) hal::can_send(message().frame());
  }

  typename SendStatesOf<can::j1939::Messages>::type sent_{};
  std::uint32_t now_us_ = 0;
};

}  // namespace bms::firmware
