// Generated from j1939_profile.dbc by ./bms messages. Do not edit.
// SHA-256 of that file: 165c958f0f4a17d8ce66c639941e9d431375ed52b097450d6dc58f7c2c52a070
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <tuple>

#include "can/codec.hpp"

namespace bms::can::j1939 {

/// Sensor readings; RV-C DGN 1FFFD.
struct DcSourceStatus1 {
  static constexpr const char* name = "DcSourceStatus1";
  static constexpr std::uint32_t id = 0x19fffd80;
  static constexpr std::uint32_t cycle_us = 1000000;  ///< 0: not cyclic
  static constexpr SignalLayout instance_layout = {0, 8, false, 1.0F, 0.0F, 0.0F, 250.0F, false, 0};
  std::uint32_t instance = 0;  ///< Instance of the battery on the bus: 1.
  static constexpr SignalLayout device_priority_layout = {8, 8, false, 1.0F, 0.0F, 0.0F, 250.0F, false, 0};
  std::uint32_t device_priority = 0;  ///< 120: the source knows its state of charge.
  static constexpr SignalLayout voltage_layout = {16, 16, false, 0.05F, 0.0F, 0.0F, 3276.6F, true, 65535};
  float voltage = unknown;  ///< [V] Pack voltage.
  static constexpr SignalLayout current_layout = {32, 32, false, 0.001F, 2000000.0F, -2000000.0F, 2294967.294F, true, -1};
  std::uint32_t current = 0;  ///< [A] Positive: discharging. The sign is opposite to that of the battery's own messages.

  constexpr can::Frame frame() const {
    can::Frame out{id, 8, {0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF}, true};
    put<instance_layout>(out, instance);
    put<device_priority_layout>(out, device_priority);
    put<voltage_layout>(out, voltage);
    put<current_layout>(out, current);
    return out;
  }
  static constexpr DcSourceStatus1 of(const can::Frame& frame) {
    DcSourceStatus1 out;
    out.instance = get<instance_layout, decltype(out.instance)>(frame);
    out.device_priority = get<device_priority_layout, decltype(out.device_priority)>(frame);
    out.voltage = get<voltage_layout, decltype(out.voltage)>(frame);
    out.current = get<current_layout, decltype(out.current)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("Instance", "", instance, instance_layout);
    see("DevicePriority", "", device_priority, device_priority_layout);
    see("Voltage", "V", voltage, voltage_layout);
    see("Current", "A", current, current_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("Instance", "Instance of the battery on the bus: 1.", std::span<const ValueName>());
    see("DevicePriority", "120: the source knows its state of charge.", std::span<const ValueName>());
    see("Voltage", "Pack voltage.", std::span<const ValueName>());
    see("Current", "Positive: discharging. The sign is opposite to that of the battery's own messages.", std::span<const ValueName>());
  }
};

/// State of charge and temperature; RV-C DGN 1FFFC.
struct DcSourceStatus2 {
  static constexpr const char* name = "DcSourceStatus2";
  static constexpr std::uint32_t id = 0x19fffc80;
  static constexpr std::uint32_t cycle_us = 1000000;  ///< 0: not cyclic
  static constexpr SignalLayout instance_layout = {0, 8, false, 1.0F, 0.0F, 0.0F, 250.0F, false, 0};
  std::uint32_t instance = 0;  ///< Instance of the battery on the bus: 1.
  static constexpr SignalLayout device_priority_layout = {8, 8, false, 1.0F, 0.0F, 0.0F, 250.0F, false, 0};
  std::uint32_t device_priority = 0;  ///< 120: the source knows its state of charge.
  static constexpr SignalLayout source_temperature_layout = {16, 16, false, 0.03125F, 273.0F, -273.0F, 1774.90625F, true, 65535};
  float source_temperature = unknown;  ///< [degC] Temperature of the first sensor.
  static constexpr SignalLayout state_of_charge_layout = {32, 8, false, 0.5F, 0.0F, 0.0F, 125.0F, true, 255};
  float state_of_charge = unknown;  ///< [%] State of charge for a display.

  constexpr can::Frame frame() const {
    can::Frame out{id, 8, {0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF}, true};
    put<instance_layout>(out, instance);
    put<device_priority_layout>(out, device_priority);
    put<source_temperature_layout>(out, source_temperature);
    put<state_of_charge_layout>(out, state_of_charge);
    return out;
  }
  static constexpr DcSourceStatus2 of(const can::Frame& frame) {
    DcSourceStatus2 out;
    out.instance = get<instance_layout, decltype(out.instance)>(frame);
    out.device_priority = get<device_priority_layout, decltype(out.device_priority)>(frame);
    out.source_temperature = get<source_temperature_layout, decltype(out.source_temperature)>(frame);
    out.state_of_charge = get<state_of_charge_layout, decltype(out.state_of_charge)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("Instance", "", instance, instance_layout);
    see("DevicePriority", "", device_priority, device_priority_layout);
    see("SourceTemperature", "degC", source_temperature, source_temperature_layout);
    see("StateOfCharge", "%", state_of_charge, state_of_charge_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("Instance", "Instance of the battery on the bus: 1.", std::span<const ValueName>());
    see("DevicePriority", "120: the source knows its state of charge.", std::span<const ValueName>());
    see("SourceTemperature", "Temperature of the first sensor.", std::span<const ValueName>());
    see("StateOfCharge", "State of charge for a display.", std::span<const ValueName>());
  }
};

/// State of health and remaining capacity; RV-C DGN 1FFFB.
struct DcSourceStatus3 {
  static constexpr const char* name = "DcSourceStatus3";
  static constexpr std::uint32_t id = 0x19fffb80;
  static constexpr std::uint32_t cycle_us = 1000000;  ///< 0: not cyclic
  static constexpr SignalLayout instance_layout = {0, 8, false, 1.0F, 0.0F, 0.0F, 250.0F, false, 0};
  std::uint32_t instance = 0;  ///< Instance of the battery on the bus: 1.
  static constexpr SignalLayout device_priority_layout = {8, 8, false, 1.0F, 0.0F, 0.0F, 250.0F, false, 0};
  std::uint32_t device_priority = 0;  ///< 120: the source knows its state of charge.
  static constexpr SignalLayout state_of_health_layout = {16, 8, false, 0.5F, 0.0F, 0.0F, 125.0F, true, 255};
  float state_of_health = unknown;  ///< [%] Capacity relative to that of the cell file.
  static constexpr SignalLayout capacity_remaining_layout = {24, 16, false, 1.0F, 0.0F, 0.0F, 65530.0F, true, 65535};
  float capacity_remaining = unknown;  ///< [Ah] Remaining charge.

  constexpr can::Frame frame() const {
    can::Frame out{id, 8, {0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF}, true};
    put<instance_layout>(out, instance);
    put<device_priority_layout>(out, device_priority);
    put<state_of_health_layout>(out, state_of_health);
    put<capacity_remaining_layout>(out, capacity_remaining);
    return out;
  }
  static constexpr DcSourceStatus3 of(const can::Frame& frame) {
    DcSourceStatus3 out;
    out.instance = get<instance_layout, decltype(out.instance)>(frame);
    out.device_priority = get<device_priority_layout, decltype(out.device_priority)>(frame);
    out.state_of_health = get<state_of_health_layout, decltype(out.state_of_health)>(frame);
    out.capacity_remaining = get<capacity_remaining_layout, decltype(out.capacity_remaining)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("Instance", "", instance, instance_layout);
    see("DevicePriority", "", device_priority, device_priority_layout);
    see("StateOfHealth", "%", state_of_health, state_of_health_layout);
    see("CapacityRemaining", "Ah", capacity_remaining, capacity_remaining_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("Instance", "Instance of the battery on the bus: 1.", std::span<const ValueName>());
    see("DevicePriority", "120: the source knows its state of charge.", std::span<const ValueName>());
    see("StateOfHealth", "Capacity relative to that of the cell file.", std::span<const ValueName>());
    see("CapacityRemaining", "Remaining charge.", std::span<const ValueName>());
  }
};

/// Request to a charger; RV-C DGN 1FEC9.
struct DcSourceStatus4 {
  static constexpr const char* name = "DcSourceStatus4";
  static constexpr std::uint32_t id = 0x19fec980;
  static constexpr std::uint32_t cycle_us = 500000;  ///< 0: not cyclic
  static constexpr SignalLayout instance_layout = {0, 8, false, 1.0F, 0.0F, 0.0F, 250.0F, false, 0};
  std::uint32_t instance = 0;  ///< Instance of the battery on the bus: 1.
  static constexpr SignalLayout device_priority_layout = {8, 8, false, 1.0F, 0.0F, 0.0F, 250.0F, false, 0};
  std::uint32_t device_priority = 0;  ///< 120: the source knows its state of charge.
  static constexpr SignalLayout desired_charge_state_layout = {16, 8, false, 1.0F, 0.0F, 0.0F, 7.0F, false, 0};
  std::uint32_t desired_charge_state = 0;  ///< Do not charge: no charging current is allowed now.
  static constexpr std::uint32_t desired_charge_state_do_not_charge = 1;
  static constexpr std::uint32_t desired_charge_state_constant_voltage_or_current = 7;
  static constexpr SignalLayout desired_voltage_layout = {24, 16, false, 0.05F, 0.0F, 0.0F, 3276.6F, true, 65535};
  float desired_voltage = unknown;  ///< [V] Maximum: upper voltage limit of a cell times the number of cells.
  static constexpr SignalLayout desired_current_layout = {40, 16, false, 0.05F, 1600.0F, 0.0F, 1676.6F, true, 65535};
  float desired_current = unknown;  ///< [A] Maximum: AllowedCurrent.Charge.
  static constexpr SignalLayout battery_type_layout = {56, 4, false, 1.0F, 0.0F, 0.0F, 15.0F, false, 0};
  std::uint32_t battery_type = 0;  ///< Cell chemistry.
  static constexpr std::uint32_t battery_type_lithium_iron_phosphate = 3;
  static constexpr std::uint32_t battery_type_not_known = 15;

  constexpr can::Frame frame() const {
    can::Frame out{id, 8, {0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF}, true};
    put<instance_layout>(out, instance);
    put<device_priority_layout>(out, device_priority);
    put<desired_charge_state_layout>(out, desired_charge_state);
    put<desired_voltage_layout>(out, desired_voltage);
    put<desired_current_layout>(out, desired_current);
    put<battery_type_layout>(out, battery_type);
    return out;
  }
  static constexpr DcSourceStatus4 of(const can::Frame& frame) {
    DcSourceStatus4 out;
    out.instance = get<instance_layout, decltype(out.instance)>(frame);
    out.device_priority = get<device_priority_layout, decltype(out.device_priority)>(frame);
    out.desired_charge_state = get<desired_charge_state_layout, decltype(out.desired_charge_state)>(frame);
    out.desired_voltage = get<desired_voltage_layout, decltype(out.desired_voltage)>(frame);
    out.desired_current = get<desired_current_layout, decltype(out.desired_current)>(frame);
    out.battery_type = get<battery_type_layout, decltype(out.battery_type)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("Instance", "", instance, instance_layout);
    see("DevicePriority", "", device_priority, device_priority_layout);
    see("DesiredChargeState", "", desired_charge_state, desired_charge_state_layout);
    see("DesiredVoltage", "V", desired_voltage, desired_voltage_layout);
    see("DesiredCurrent", "A", desired_current, desired_current_layout);
    see("BatteryType", "", battery_type, battery_type_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("Instance", "Instance of the battery on the bus: 1.", std::span<const ValueName>());
    see("DevicePriority", "120: the source knows its state of charge.", std::span<const ValueName>());
    { static constexpr std::array<ValueName, 2> names{{ValueName{1, "do not charge"}, ValueName{7, "constant voltage or current"}}}; see("DesiredChargeState", "Do not charge: no charging current is allowed now.", std::span<const ValueName>(names)); }
    see("DesiredVoltage", "Maximum: upper voltage limit of a cell times the number of cells.", std::span<const ValueName>());
    see("DesiredCurrent", "Maximum: AllowedCurrent.Charge.", std::span<const ValueName>());
    { static constexpr std::array<ValueName, 2> names{{ValueName{3, "lithium iron phosphate"}, ValueName{15, "not known"}}}; see("BatteryType", "Cell chemistry.", std::span<const ValueName>(names)); }
  }
};

/// Voltage limits that are exceeded; RV-C DGN 1FEC7.
struct DcSourceStatus6 {
  static constexpr const char* name = "DcSourceStatus6";
  static constexpr std::uint32_t id = 0x19fec780;
  static constexpr std::uint32_t cycle_us = 1000000;  ///< 0: not cyclic
  static constexpr SignalLayout instance_layout = {0, 8, false, 1.0F, 0.0F, 0.0F, 250.0F, false, 0};
  std::uint32_t instance = 0;  ///< Instance of the battery on the bus: 1.
  static constexpr SignalLayout device_priority_layout = {8, 8, false, 1.0F, 0.0F, 0.0F, 250.0F, false, 0};
  std::uint32_t device_priority = 0;  ///< 120: the source knows its state of charge.
  static constexpr SignalLayout high_voltage_limit_layout = {16, 2, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t high_voltage_limit = 0;  ///< A cell or the pack is above or near an upper voltage limit.
  static constexpr std::uint32_t high_voltage_limit_no = 0;
  static constexpr std::uint32_t high_voltage_limit_yes = 1;
  static constexpr SignalLayout high_voltage_disconnect_layout = {18, 2, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t high_voltage_disconnect = 0;  ///< A cell or the pack is above a voltage limit and the contactors are open.
  static constexpr std::uint32_t high_voltage_disconnect_no = 0;
  static constexpr std::uint32_t high_voltage_disconnect_yes = 1;
  static constexpr SignalLayout low_voltage_limit_layout = {20, 2, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t low_voltage_limit = 0;  ///< A cell or the pack is below or near a lower voltage limit.
  static constexpr std::uint32_t low_voltage_limit_no = 0;
  static constexpr std::uint32_t low_voltage_limit_yes = 1;
  static constexpr SignalLayout low_voltage_disconnect_layout = {22, 2, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t low_voltage_disconnect = 0;  ///< A cell or the pack is below a voltage limit and the contactors are open.
  static constexpr std::uint32_t low_voltage_disconnect_no = 0;
  static constexpr std::uint32_t low_voltage_disconnect_yes = 1;

  constexpr can::Frame frame() const {
    can::Frame out{id, 8, {0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF}, true};
    put<instance_layout>(out, instance);
    put<device_priority_layout>(out, device_priority);
    put<high_voltage_limit_layout>(out, high_voltage_limit);
    put<high_voltage_disconnect_layout>(out, high_voltage_disconnect);
    put<low_voltage_limit_layout>(out, low_voltage_limit);
    put<low_voltage_disconnect_layout>(out, low_voltage_disconnect);
    return out;
  }
  static constexpr DcSourceStatus6 of(const can::Frame& frame) {
    DcSourceStatus6 out;
    out.instance = get<instance_layout, decltype(out.instance)>(frame);
    out.device_priority = get<device_priority_layout, decltype(out.device_priority)>(frame);
    out.high_voltage_limit = get<high_voltage_limit_layout, decltype(out.high_voltage_limit)>(frame);
    out.high_voltage_disconnect = get<high_voltage_disconnect_layout, decltype(out.high_voltage_disconnect)>(frame);
    out.low_voltage_limit = get<low_voltage_limit_layout, decltype(out.low_voltage_limit)>(frame);
    out.low_voltage_disconnect = get<low_voltage_disconnect_layout, decltype(out.low_voltage_disconnect)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("Instance", "", instance, instance_layout);
    see("DevicePriority", "", device_priority, device_priority_layout);
    see("HighVoltageLimit", "", high_voltage_limit, high_voltage_limit_layout);
    see("HighVoltageDisconnect", "", high_voltage_disconnect, high_voltage_disconnect_layout);
    see("LowVoltageLimit", "", low_voltage_limit, low_voltage_limit_layout);
    see("LowVoltageDisconnect", "", low_voltage_disconnect, low_voltage_disconnect_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("Instance", "Instance of the battery on the bus: 1.", std::span<const ValueName>());
    see("DevicePriority", "120: the source knows its state of charge.", std::span<const ValueName>());
    { static constexpr std::array<ValueName, 2> names{{ValueName{0, "no"}, ValueName{1, "yes"}}}; see("HighVoltageLimit", "A cell or the pack is above or near an upper voltage limit.", std::span<const ValueName>(names)); }
    { static constexpr std::array<ValueName, 2> names{{ValueName{0, "no"}, ValueName{1, "yes"}}}; see("HighVoltageDisconnect", "A cell or the pack is above a voltage limit and the contactors are open.", std::span<const ValueName>(names)); }
    { static constexpr std::array<ValueName, 2> names{{ValueName{0, "no"}, ValueName{1, "yes"}}}; see("LowVoltageLimit", "A cell or the pack is below or near a lower voltage limit.", std::span<const ValueName>(names)); }
    { static constexpr std::array<ValueName, 2> names{{ValueName{0, "no"}, ValueName{1, "yes"}}}; see("LowVoltageDisconnect", "A cell or the pack is below a voltage limit and the contactors are open.", std::span<const ValueName>(names)); }
  }
};

/// Allowed current directions and full capacity; RV-C DGN 1FEA5.
struct DcSourceStatus11 {
  static constexpr const char* name = "DcSourceStatus11";
  static constexpr std::uint32_t id = 0x19fea580;
  static constexpr std::uint32_t cycle_us = 1000000;  ///< 0: not cyclic
  static constexpr SignalLayout instance_layout = {0, 8, false, 1.0F, 0.0F, 0.0F, 250.0F, false, 0};
  std::uint32_t instance = 0;  ///< Instance of the battery on the bus: 1.
  static constexpr SignalLayout device_priority_layout = {8, 8, false, 1.0F, 0.0F, 0.0F, 250.0F, false, 0};
  std::uint32_t device_priority = 0;  ///< 120: the source knows its state of charge.
  static constexpr SignalLayout discharge_on_layout = {16, 2, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t discharge_on = 0;  ///< The contactors are closed and discharging is allowed.
  static constexpr std::uint32_t discharge_on_no = 0;
  static constexpr std::uint32_t discharge_on_yes = 1;
  static constexpr SignalLayout charge_on_layout = {18, 2, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t charge_on = 0;  ///< The contactors are closed and charging is allowed.
  static constexpr std::uint32_t charge_on_no = 0;
  static constexpr std::uint32_t charge_on_yes = 1;
  static constexpr SignalLayout charge_detected_layout = {20, 2, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t charge_detected = 0;  ///< Charging current flows.
  static constexpr std::uint32_t charge_detected_no = 0;
  static constexpr std::uint32_t charge_detected_yes = 1;
  static constexpr SignalLayout full_capacity_layout = {24, 16, false, 1.0F, 0.0F, 0.0F, 65530.0F, true, 65535};
  float full_capacity = unknown;  ///< [Ah] Capacity of the cell file times state of health.

  constexpr can::Frame frame() const {
    can::Frame out{id, 8, {0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF}, true};
    put<instance_layout>(out, instance);
    put<device_priority_layout>(out, device_priority);
    put<discharge_on_layout>(out, discharge_on);
    put<charge_on_layout>(out, charge_on);
    put<charge_detected_layout>(out, charge_detected);
    put<full_capacity_layout>(out, full_capacity);
    return out;
  }
  static constexpr DcSourceStatus11 of(const can::Frame& frame) {
    DcSourceStatus11 out;
    out.instance = get<instance_layout, decltype(out.instance)>(frame);
    out.device_priority = get<device_priority_layout, decltype(out.device_priority)>(frame);
    out.discharge_on = get<discharge_on_layout, decltype(out.discharge_on)>(frame);
    out.charge_on = get<charge_on_layout, decltype(out.charge_on)>(frame);
    out.charge_detected = get<charge_detected_layout, decltype(out.charge_detected)>(frame);
    out.full_capacity = get<full_capacity_layout, decltype(out.full_capacity)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("Instance", "", instance, instance_layout);
    see("DevicePriority", "", device_priority, device_priority_layout);
    see("DischargeOn", "", discharge_on, discharge_on_layout);
    see("ChargeOn", "", charge_on, charge_on_layout);
    see("ChargeDetected", "", charge_detected, charge_detected_layout);
    see("FullCapacity", "Ah", full_capacity, full_capacity_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("Instance", "Instance of the battery on the bus: 1.", std::span<const ValueName>());
    see("DevicePriority", "120: the source knows its state of charge.", std::span<const ValueName>());
    { static constexpr std::array<ValueName, 2> names{{ValueName{0, "no"}, ValueName{1, "yes"}}}; see("DischargeOn", "The contactors are closed and discharging is allowed.", std::span<const ValueName>(names)); }
    { static constexpr std::array<ValueName, 2> names{{ValueName{0, "no"}, ValueName{1, "yes"}}}; see("ChargeOn", "The contactors are closed and charging is allowed.", std::span<const ValueName>(names)); }
    { static constexpr std::array<ValueName, 2> names{{ValueName{0, "no"}, ValueName{1, "yes"}}}; see("ChargeDetected", "Charging current flows.", std::span<const ValueName>(names)); }
    see("FullCapacity", "Capacity of the cell file times state of health.", std::span<const ValueName>());
  }
};

/// All messages.
using Messages = std::tuple<DcSourceStatus1, DcSourceStatus2, DcSourceStatus3, DcSourceStatus4, DcSourceStatus6, DcSourceStatus11>;

}  // namespace bms::can::j1939
