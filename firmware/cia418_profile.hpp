// The battery as a CANopen battery module (CiA 418) for chargers of CiA 419. Build option: BMS_VEHICLE_PROFILE=cia418
// with the node numbers BMS_CANOPEN_NODE (battery, 1) and BMS_CANOPEN_CHARGER (charger, 10).
//
// While the node is operational it sends the charger's first three receive PDOs every 0.2 s, in their default mapping:
//
//   200h + charger   6010 temperature, 6000 battery status
//   300h + charger   6010 temperature, 6000 battery status, 6060 voltage
//   400h + charger   6070 requested charging current, 6081 state of charge
//
//   6000     u8    bit 0: ready to charge
//   6001     u8    status of the charger, written by the charger; only stored, because no text confirms its bits
//   6010     i16   0.125 degC; 7FFFh: not known
//   6020.1   u8    battery type; 0: not specified
//   6020.2   u16   capacity [Ah]
//   6020.3   u16   highest charging current [A]
//   6020.4   u16   number of cells
//   6060     u32   V / 1024; all ones: not known
//   6070     u16   A / 16
//   6081     u8    %; FFh: not known
//
// The charger's heartbeat (700h + charger) starts and ends the charge: power_requests.hpp.
//
// firmware/can/messages.md names the sources, and the points that no text confirms. CANopen has no end-to-end
// protection: use the battery's own messages for everything that opens contactors. Cost: 0.7 % of a bus of 250 kbit/s.
// An SDO request is answered with the next sample.
//
// If the charger has a bus of its own (BMS_CHARGER_BUS), the battery is a node of the truck's bus, too: with the same
// number and objects and a state of its own, but without PDOs and without a charger.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <string_view>
#include <tuple>
#include <type_traits>

#include "firmware/canopen.hpp"
#include "firmware/charge_control.hpp"
#include "firmware/cycle.hpp"
#include "firmware/messages.hpp"
#include "firmware/power_requests.hpp"
#include "firmware/snapshot.hpp"
#include "hal/accepted_frames.hpp"
#include "hal/charger_bus.hpp"

namespace bms::firmware {

class Cia418Profile {
 public:
  static constexpr std::uint32_t cycle_us = 200'000;
  struct Pdo {
    const char* name;
    std::uint16_t id;
    std::uint8_t length;
  };
  static constexpr std::array<Pdo, 3> pdos{{{"Cia418Status", 0x200 + hal::canopen_charger, 3},
                                            {"Cia418Voltage", 0x300 + hal::canopen_charger, 7},
                                            {"Cia418Request", 0x400 + hal::canopen_charger, 3}}};

  /// Updates the objects, then sends what is due.
  template <class Estimator, std::size_t Cells>
  void publish(const Snapshot<Estimator, Cells>& now) {
    control_.update(now, {.present = charger_.present(now.pack.time_us)});
    update_objects(now);
    const auto now_us = static_cast<std::uint32_t>(now.pack.time_us);
    if (hal::has_charger_bus && hal::can_listening()) truck_node_.update_heartbeat(now_us);
    if (!control_.speaks() || !hal::charger_listening()) return;
    node_.update_heartbeat(now_us);
    if (node_.state() == canopen::NodeState::operational && cycle_.due(now_us, cycle_us)) send_pdos();
  }

  void receive(const can::Frame& frame, std::uint64_t now_us) {
    charger_.receive(frame, now_us);
    if (control_.speaks()) node_.receive(frame, *this);
  }
  /// A frame of the truck's bus, which is not that of the charger.
  void receive_from_truck(const can::Frame& frame) { truck_node_.receive(frame, *this); }

  /// An operational charger asks for a charge until its heartbeat ends or has another state, or the battery is full.
  constexpr ChargerState charger(std::uint64_t now_us) const {
    return {charger_.present(now_us), charger_.operational(now_us) && control_.wanted()};
  }
  constexpr const ChargeControl& control() const { return control_; }
  constexpr ChargeControl& control() { return control_; }

  /// Object dictionary, for the SDO server.
  canopen::Entry read(std::uint16_t index, std::uint8_t sub) const {
    if (index == 0x1018)
      return sub_entry({4, 0, 0, 0, 0}, {1, 4, 4, 4, 4}, sub);  // identity: there is no vendor number
    if (index == 0x6020) return sub_entry({4, 0, capacity_, max_current_, cells_}, {1, 1, 2, 2, 2}, sub);
    const canopen::Entry entry = plain_entry(index);
    return entry.abort_code == canopen::AbortCode::none && sub != 0
               ? canopen::Entry{.abort_code = canopen::AbortCode::no_such_sub_index}
               : entry;
  }

  canopen::AbortCode write(std::uint16_t index, std::uint8_t sub, std::uint32_t value, std::uint8_t length) {
    const canopen::Entry entry = read(index, sub);
    if (entry.abort_code != canopen::AbortCode::none) return entry.abort_code;
    if (index != 0x6001) return canopen::AbortCode::read_only;
    if (length != entry.length) return canopen::AbortCode::wrong_length;
    charger_status_ = static_cast<std::uint8_t>(value);
    return canopen::AbortCode::none;
  }

 private:
  static constexpr std::int16_t no_value = 0x7FFF;
  static constexpr std::uint32_t device_type = 418;
  static constexpr std::string_view device_name = "greybox-bms battery";

  template <class Estimator, std::size_t Cells>
  void update_objects(const Snapshot<Estimator, Cells>& now) {
    const std::int32_t allowed_ua = hal::has_group_bus ? control_.current_ua() : now.decision.allowed.charge_ua;
    const bool enabled = hal::has_group_bus || now.decision.outputs.charge_enable;
    const bool charge_me = enabled && allowed_ua > 0 && control_.wanted();
    const std::int16_t cdegc = now.pack.temperature_cdegc[0];
    temperature_ = measurement::temperature_possible(cdegc) ? static_cast<std::int16_t>(cdegc * 2 / 25) : no_value;
    status_ = charge_me ? 1 : 0;
    voltage_ = now.pack.pack_uv >= 0
                   ? static_cast<std::uint32_t>(static_cast<std::int64_t>(now.pack.pack_uv) * 1'024 / 1'000'000)
                   : 0xFFFF'FFFF;
    current_requested_ =
        charge_me ? static_cast<std::uint16_t>(std::min<std::int32_t>(allowed_ua / 62'500, 0xFFFF)) : 0;
    soc_ = now.soc_known() ? rounded(messages::percent(now.condition.display_soc()), 100) : 0xFF;
    capacity_ = static_cast<std::uint16_t>(now.capacity_ah + 0.5F);
    max_current_ = static_cast<std::uint16_t>(now.plan.derating.charge_max_ua / 1'000'000);
    cells_ = now.plan.cells;
  }

  /// Rounds to an integer from 0 to `most`; not-a-number becomes 0.
  static constexpr std::uint8_t rounded(float value, std::uint8_t most) {
    if (!(value > 0)) return 0;
    const float clamped = value > static_cast<float>(most) ? static_cast<float>(most) : value;
    return static_cast<std::uint8_t>(clamped + 0.5F);
  }

  static canopen::Entry sub_entry(const std::array<std::uint32_t, 5>& values,
                                  const std::array<std::uint8_t, 5>& lengths, std::uint8_t sub) {
    if (sub >= values.size()) return {.abort_code = canopen::AbortCode::no_such_sub_index};
    return {values[sub], lengths[sub]};
  }

  canopen::Entry plain_entry(std::uint16_t index) const {
    switch (index) {
      case 0x1000:
        return {device_type, 4};
      case 0x1001:
        return {0, 1};  // error register: the faults are in the message Faults
      case 0x1008:
        return {.text = device_name};
      case 0x1017:
        return {canopen::Node::heartbeat_us / 1'000, 2};
      case 0x6000:
        return {status_, 1};
      case 0x6001:
        return {charger_status_, 1};
      case 0x6010:
        return {static_cast<std::uint16_t>(temperature_), 2};
      case 0x6060:
        return {voltage_, 4};
      case 0x6070:
        return {current_requested_, 2};
      case 0x6081:
        return {soc_, 1};
      default:
        return {.abort_code = canopen::AbortCode::no_such_object};
    }
  }

  void send_pdos() const {
    can::Frame status{pdos[0].id, pdos[0].length, {}}, voltage{pdos[1].id, pdos[1].length, {}},
        request{pdos[2].id, pdos[2].length, {}};
    hal::put_bytes(status.data, 0, temperature_);
    status.data[2] = status_;
    voltage.data = status.data;
    hal::put_bytes(voltage.data, 3, voltage_);
    hal::put_bytes(request.data, 0, current_requested_);
    request.data[2] = soc_;
    for (const can::Frame& pdo : {status, voltage, request}) hal::send_to_charger(pdo);
  }

  struct NoNode {
    constexpr void update_heartbeat(std::uint32_t) {}
    constexpr void receive(const can::Frame&, Cia418Profile&) {}
  };
  struct TruckNode : canopen::Node {
    TruckNode() : Node(static_cast<std::uint8_t>(hal::canopen_node), canopen::Bus::of_truck) {}
  };

  canopen::Node node_{static_cast<std::uint8_t>(hal::canopen_node)};
  [[no_unique_address]] std::conditional_t<hal::has_charger_bus, TruckNode, NoNode> truck_node_;
  canopen::Peer charger_{static_cast<std::uint8_t>(hal::canopen_charger)};
  ChargeControl control_;
  Cycle cycle_;
  std::uint32_t voltage_ = 0xFFFF'FFFF;
  std::int16_t temperature_ = no_value;
  std::uint16_t current_requested_ = 0, capacity_ = 0, max_current_ = 0;
  std::uint8_t status_ = 0, charger_status_ = 0, soc_ = 0xFF, cells_ = 0;
};

namespace cia418 {

/// Returns true if both node numbers are valid and no other frame has the identifier of a PDO.
constexpr bool pdo_ids_are_unique() {
  bool unique = hal::canopen_node >= 1 && hal::canopen_node <= 127 && hal::canopen_charger >= 1 &&
                hal::canopen_charger <= 127 && hal::canopen_node != hal::canopen_charger;
  for (const Cia418Profile::Pdo& pdo : Cia418Profile::pdos) {
    std::apply([&](auto... m) { ((unique = unique && m.id != pdo.id), ...); }, can::Messages{});
    for (const std::uint16_t id : hal::request_and_sample_ids) unique = unique && id != pdo.id;
  }
  return unique;
}
static_assert(hal::vehicle_profile != hal::VehicleProfile::cia418 || pdo_ids_are_unique(),
              "BMS_CANOPEN_NODE and BMS_CANOPEN_CHARGER must be two different nodes from 1 to 127, and no PDO may have "
              "the identifier of a battery message (which excludes chargers 16 to 29)");

}  // namespace cia418

}  // namespace bms::firmware
