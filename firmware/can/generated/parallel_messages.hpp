// Generated from parallel_bus.dbc by ./bms messages. Do not edit.
// SHA-256 of that file: 734b3c12533060a6541ca0947b7fc8f996d6b1c5e80d68344b9d39e277494a32
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <tuple>

#include "can/codec.hpp"

namespace bms::can::parallel {

/// State and voltage of battery 1.
struct Presence1 {
  static constexpr const char* name = "Presence1";
  static constexpr std::uint16_t id = 0x101;
  static constexpr std::uint32_t cycle_us = 100000;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 257;
  static constexpr SignalLayout state_layout = {12, 2, false, 1.0F, 0.0F, 0.0F, 2.0F, false, 0};
  std::uint32_t state = 0;  ///< Unable: a fault, or readings are missing.
  static constexpr std::uint32_t state_unable = 0;
  static constexpr std::uint32_t state_open = 1;
  static constexpr std::uint32_t state_connected = 2;
  static constexpr SignalLayout leader_layout = {14, 3, false, 1.0F, 0.0F, 0.0F, 4.0F, false, 0};
  std::uint32_t leader = 0;  ///< Node of the battery that this one follows; 0: none.
  static constexpr SignalLayout granted_layout = {17, 3, false, 1.0F, 0.0F, 0.0F, 4.0F, false, 0};
  std::uint32_t granted = 0;  ///< Of a leader: node of the battery that may close now; 0: none.
  static constexpr SignalLayout charge_wanted_layout = {20, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t charge_wanted = 0;  ///< Its charge by a charger is not over.
  static constexpr SignalLayout open_circuit_voltage_layout = {24, 16, false, 0.002F, 0.0F, 0.0F, 131.06F, true, 65535};
  float open_circuit_voltage = unknown;  ///< [V] Of the whole battery, by its estimator.
  static constexpr SignalLayout current_layout = {40, 16, true, 0.1F, 0.0F, -3276.7F, 3276.7F, true, -32768};
  float current = unknown;  ///< [A] Positive: charging.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<state_layout>(out, state);
    put<leader_layout>(out, leader);
    put<granted_layout>(out, granted);
    put<charge_wanted_layout>(out, charge_wanted);
    put<open_circuit_voltage_layout>(out, open_circuit_voltage);
    put<current_layout>(out, current);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr Presence1 of(const can::Frame& frame) {
    Presence1 out;
    out.state = get<state_layout, decltype(out.state)>(frame);
    out.leader = get<leader_layout, decltype(out.leader)>(frame);
    out.granted = get<granted_layout, decltype(out.granted)>(frame);
    out.charge_wanted = get<charge_wanted_layout, decltype(out.charge_wanted)>(frame);
    out.open_circuit_voltage = get<open_circuit_voltage_layout, decltype(out.open_circuit_voltage)>(frame);
    out.current = get<current_layout, decltype(out.current)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("State", "", state, state_layout);
    see("Leader", "", leader, leader_layout);
    see("Granted", "", granted, granted_layout);
    see("ChargeWanted", "", charge_wanted, charge_wanted_layout);
    see("OpenCircuitVoltage", "V", open_circuit_voltage, open_circuit_voltage_layout);
    see("Current", "A", current, current_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    { static constexpr std::array<ValueName, 3> names{{ValueName{0, "unable"}, ValueName{1, "open"}, ValueName{2, "connected"}}}; see("State", "Unable: a fault, or readings are missing.", std::span<const ValueName>(names)); }
    see("Leader", "Node of the battery that this one follows; 0: none.", std::span<const ValueName>());
    see("Granted", "Of a leader: node of the battery that may close now; 0: none.", std::span<const ValueName>());
    see("ChargeWanted", "Its charge by a charger is not over.", std::span<const ValueName>());
    see("OpenCircuitVoltage", "Of the whole battery, by its estimator.", std::span<const ValueName>());
    see("Current", "Positive: charging.", std::span<const ValueName>());
  }
};

/// State and voltage of battery 2.
struct Presence2 {
  static constexpr const char* name = "Presence2";
  static constexpr std::uint16_t id = 0x102;
  static constexpr std::uint32_t cycle_us = 100000;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 258;
  static constexpr SignalLayout state_layout = {12, 2, false, 1.0F, 0.0F, 0.0F, 2.0F, false, 0};
  std::uint32_t state = 0;  ///< Unable: a fault, or readings are missing.
  static constexpr std::uint32_t state_unable = 0;
  static constexpr std::uint32_t state_open = 1;
  static constexpr std::uint32_t state_connected = 2;
  static constexpr SignalLayout leader_layout = {14, 3, false, 1.0F, 0.0F, 0.0F, 4.0F, false, 0};
  std::uint32_t leader = 0;  ///< Node of the battery that this one follows; 0: none.
  static constexpr SignalLayout granted_layout = {17, 3, false, 1.0F, 0.0F, 0.0F, 4.0F, false, 0};
  std::uint32_t granted = 0;  ///< Of a leader: node of the battery that may close now; 0: none.
  static constexpr SignalLayout charge_wanted_layout = {20, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t charge_wanted = 0;  ///< Its charge by a charger is not over.
  static constexpr SignalLayout open_circuit_voltage_layout = {24, 16, false, 0.002F, 0.0F, 0.0F, 131.06F, true, 65535};
  float open_circuit_voltage = unknown;  ///< [V] Of the whole battery, by its estimator.
  static constexpr SignalLayout current_layout = {40, 16, true, 0.1F, 0.0F, -3276.7F, 3276.7F, true, -32768};
  float current = unknown;  ///< [A] Positive: charging.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<state_layout>(out, state);
    put<leader_layout>(out, leader);
    put<granted_layout>(out, granted);
    put<charge_wanted_layout>(out, charge_wanted);
    put<open_circuit_voltage_layout>(out, open_circuit_voltage);
    put<current_layout>(out, current);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr Presence2 of(const can::Frame& frame) {
    Presence2 out;
    out.state = get<state_layout, decltype(out.state)>(frame);
    out.leader = get<leader_layout, decltype(out.leader)>(frame);
    out.granted = get<granted_layout, decltype(out.granted)>(frame);
    out.charge_wanted = get<charge_wanted_layout, decltype(out.charge_wanted)>(frame);
    out.open_circuit_voltage = get<open_circuit_voltage_layout, decltype(out.open_circuit_voltage)>(frame);
    out.current = get<current_layout, decltype(out.current)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("State", "", state, state_layout);
    see("Leader", "", leader, leader_layout);
    see("Granted", "", granted, granted_layout);
    see("ChargeWanted", "", charge_wanted, charge_wanted_layout);
    see("OpenCircuitVoltage", "V", open_circuit_voltage, open_circuit_voltage_layout);
    see("Current", "A", current, current_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    { static constexpr std::array<ValueName, 3> names{{ValueName{0, "unable"}, ValueName{1, "open"}, ValueName{2, "connected"}}}; see("State", "Unable: a fault, or readings are missing.", std::span<const ValueName>(names)); }
    see("Leader", "Node of the battery that this one follows; 0: none.", std::span<const ValueName>());
    see("Granted", "Of a leader: node of the battery that may close now; 0: none.", std::span<const ValueName>());
    see("ChargeWanted", "Its charge by a charger is not over.", std::span<const ValueName>());
    see("OpenCircuitVoltage", "Of the whole battery, by its estimator.", std::span<const ValueName>());
    see("Current", "Positive: charging.", std::span<const ValueName>());
  }
};

/// State and voltage of battery 3.
struct Presence3 {
  static constexpr const char* name = "Presence3";
  static constexpr std::uint16_t id = 0x103;
  static constexpr std::uint32_t cycle_us = 100000;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 259;
  static constexpr SignalLayout state_layout = {12, 2, false, 1.0F, 0.0F, 0.0F, 2.0F, false, 0};
  std::uint32_t state = 0;  ///< Unable: a fault, or readings are missing.
  static constexpr std::uint32_t state_unable = 0;
  static constexpr std::uint32_t state_open = 1;
  static constexpr std::uint32_t state_connected = 2;
  static constexpr SignalLayout leader_layout = {14, 3, false, 1.0F, 0.0F, 0.0F, 4.0F, false, 0};
  std::uint32_t leader = 0;  ///< Node of the battery that this one follows; 0: none.
  static constexpr SignalLayout granted_layout = {17, 3, false, 1.0F, 0.0F, 0.0F, 4.0F, false, 0};
  std::uint32_t granted = 0;  ///< Of a leader: node of the battery that may close now; 0: none.
  static constexpr SignalLayout charge_wanted_layout = {20, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t charge_wanted = 0;  ///< Its charge by a charger is not over.
  static constexpr SignalLayout open_circuit_voltage_layout = {24, 16, false, 0.002F, 0.0F, 0.0F, 131.06F, true, 65535};
  float open_circuit_voltage = unknown;  ///< [V] Of the whole battery, by its estimator.
  static constexpr SignalLayout current_layout = {40, 16, true, 0.1F, 0.0F, -3276.7F, 3276.7F, true, -32768};
  float current = unknown;  ///< [A] Positive: charging.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<state_layout>(out, state);
    put<leader_layout>(out, leader);
    put<granted_layout>(out, granted);
    put<charge_wanted_layout>(out, charge_wanted);
    put<open_circuit_voltage_layout>(out, open_circuit_voltage);
    put<current_layout>(out, current);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr Presence3 of(const can::Frame& frame) {
    Presence3 out;
    out.state = get<state_layout, decltype(out.state)>(frame);
    out.leader = get<leader_layout, decltype(out.leader)>(frame);
    out.granted = get<granted_layout, decltype(out.granted)>(frame);
    out.charge_wanted = get<charge_wanted_layout, decltype(out.charge_wanted)>(frame);
    out.open_circuit_voltage = get<open_circuit_voltage_layout, decltype(out.open_circuit_voltage)>(frame);
    out.current = get<current_layout, decltype(out.current)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("State", "", state, state_layout);
    see("Leader", "", leader, leader_layout);
    see("Granted", "", granted, granted_layout);
    see("ChargeWanted", "", charge_wanted, charge_wanted_layout);
    see("OpenCircuitVoltage", "V", open_circuit_voltage, open_circuit_voltage_layout);
    see("Current", "A", current, current_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    { static constexpr std::array<ValueName, 3> names{{ValueName{0, "unable"}, ValueName{1, "open"}, ValueName{2, "connected"}}}; see("State", "Unable: a fault, or readings are missing.", std::span<const ValueName>(names)); }
    see("Leader", "Node of the battery that this one follows; 0: none.", std::span<const ValueName>());
    see("Granted", "Of a leader: node of the battery that may close now; 0: none.", std::span<const ValueName>());
    see("ChargeWanted", "Its charge by a charger is not over.", std::span<const ValueName>());
    see("OpenCircuitVoltage", "Of the whole battery, by its estimator.", std::span<const ValueName>());
    see("Current", "Positive: charging.", std::span<const ValueName>());
  }
};

/// State and voltage of battery 4.
struct Presence4 {
  static constexpr const char* name = "Presence4";
  static constexpr std::uint16_t id = 0x104;
  static constexpr std::uint32_t cycle_us = 100000;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 260;
  static constexpr SignalLayout state_layout = {12, 2, false, 1.0F, 0.0F, 0.0F, 2.0F, false, 0};
  std::uint32_t state = 0;  ///< Unable: a fault, or readings are missing.
  static constexpr std::uint32_t state_unable = 0;
  static constexpr std::uint32_t state_open = 1;
  static constexpr std::uint32_t state_connected = 2;
  static constexpr SignalLayout leader_layout = {14, 3, false, 1.0F, 0.0F, 0.0F, 4.0F, false, 0};
  std::uint32_t leader = 0;  ///< Node of the battery that this one follows; 0: none.
  static constexpr SignalLayout granted_layout = {17, 3, false, 1.0F, 0.0F, 0.0F, 4.0F, false, 0};
  std::uint32_t granted = 0;  ///< Of a leader: node of the battery that may close now; 0: none.
  static constexpr SignalLayout charge_wanted_layout = {20, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t charge_wanted = 0;  ///< Its charge by a charger is not over.
  static constexpr SignalLayout open_circuit_voltage_layout = {24, 16, false, 0.002F, 0.0F, 0.0F, 131.06F, true, 65535};
  float open_circuit_voltage = unknown;  ///< [V] Of the whole battery, by its estimator.
  static constexpr SignalLayout current_layout = {40, 16, true, 0.1F, 0.0F, -3276.7F, 3276.7F, true, -32768};
  float current = unknown;  ///< [A] Positive: charging.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<state_layout>(out, state);
    put<leader_layout>(out, leader);
    put<granted_layout>(out, granted);
    put<charge_wanted_layout>(out, charge_wanted);
    put<open_circuit_voltage_layout>(out, open_circuit_voltage);
    put<current_layout>(out, current);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr Presence4 of(const can::Frame& frame) {
    Presence4 out;
    out.state = get<state_layout, decltype(out.state)>(frame);
    out.leader = get<leader_layout, decltype(out.leader)>(frame);
    out.granted = get<granted_layout, decltype(out.granted)>(frame);
    out.charge_wanted = get<charge_wanted_layout, decltype(out.charge_wanted)>(frame);
    out.open_circuit_voltage = get<open_circuit_voltage_layout, decltype(out.open_circuit_voltage)>(frame);
    out.current = get<current_layout, decltype(out.current)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("State", "", state, state_layout);
    see("Leader", "", leader, leader_layout);
    see("Granted", "", granted, granted_layout);
    see("ChargeWanted", "", charge_wanted, charge_wanted_layout);
    see("OpenCircuitVoltage", "V", open_circuit_voltage, open_circuit_voltage_layout);
    see("Current", "A", current, current_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    { static constexpr std::array<ValueName, 3> names{{ValueName{0, "unable"}, ValueName{1, "open"}, ValueName{2, "connected"}}}; see("State", "Unable: a fault, or readings are missing.", std::span<const ValueName>(names)); }
    see("Leader", "Node of the battery that this one follows; 0: none.", std::span<const ValueName>());
    see("Granted", "Of a leader: node of the battery that may close now; 0: none.", std::span<const ValueName>());
    see("ChargeWanted", "Its charge by a charger is not over.", std::span<const ValueName>());
    see("OpenCircuitVoltage", "Of the whole battery, by its estimator.", std::span<const ValueName>());
    see("Current", "Positive: charging.", std::span<const ValueName>());
  }
};

/// Limits of battery 1.
struct BatteryLimits1 {
  static constexpr const char* name = "BatteryLimits1";
  static constexpr std::uint16_t id = 0x111;
  static constexpr std::uint32_t cycle_us = 100000;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 273;
  static constexpr SignalLayout discharge_layout = {16, 16, false, 0.1F, 0.0F, 0.0F, 6553.4F, true, 65535};
  float discharge = unknown;  ///< [A] Allowed discharge current of this battery.
  static constexpr SignalLayout charge_layout = {32, 16, false, 0.1F, 0.0F, 0.0F, 6553.4F, true, 65535};
  float charge = unknown;  ///< [A] Allowed charge current of this battery.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<discharge_layout>(out, discharge);
    put<charge_layout>(out, charge);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr BatteryLimits1 of(const can::Frame& frame) {
    BatteryLimits1 out;
    out.discharge = get<discharge_layout, decltype(out.discharge)>(frame);
    out.charge = get<charge_layout, decltype(out.charge)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("Discharge", "A", discharge, discharge_layout);
    see("Charge", "A", charge, charge_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("Discharge", "Allowed discharge current of this battery.", std::span<const ValueName>());
    see("Charge", "Allowed charge current of this battery.", std::span<const ValueName>());
  }
};

/// Limits of battery 2.
struct BatteryLimits2 {
  static constexpr const char* name = "BatteryLimits2";
  static constexpr std::uint16_t id = 0x112;
  static constexpr std::uint32_t cycle_us = 100000;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 274;
  static constexpr SignalLayout discharge_layout = {16, 16, false, 0.1F, 0.0F, 0.0F, 6553.4F, true, 65535};
  float discharge = unknown;  ///< [A] Allowed discharge current of this battery.
  static constexpr SignalLayout charge_layout = {32, 16, false, 0.1F, 0.0F, 0.0F, 6553.4F, true, 65535};
  float charge = unknown;  ///< [A] Allowed charge current of this battery.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<discharge_layout>(out, discharge);
    put<charge_layout>(out, charge);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr BatteryLimits2 of(const can::Frame& frame) {
    BatteryLimits2 out;
    out.discharge = get<discharge_layout, decltype(out.discharge)>(frame);
    out.charge = get<charge_layout, decltype(out.charge)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("Discharge", "A", discharge, discharge_layout);
    see("Charge", "A", charge, charge_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("Discharge", "Allowed discharge current of this battery.", std::span<const ValueName>());
    see("Charge", "Allowed charge current of this battery.", std::span<const ValueName>());
  }
};

/// Limits of battery 3.
struct BatteryLimits3 {
  static constexpr const char* name = "BatteryLimits3";
  static constexpr std::uint16_t id = 0x113;
  static constexpr std::uint32_t cycle_us = 100000;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 275;
  static constexpr SignalLayout discharge_layout = {16, 16, false, 0.1F, 0.0F, 0.0F, 6553.4F, true, 65535};
  float discharge = unknown;  ///< [A] Allowed discharge current of this battery.
  static constexpr SignalLayout charge_layout = {32, 16, false, 0.1F, 0.0F, 0.0F, 6553.4F, true, 65535};
  float charge = unknown;  ///< [A] Allowed charge current of this battery.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<discharge_layout>(out, discharge);
    put<charge_layout>(out, charge);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr BatteryLimits3 of(const can::Frame& frame) {
    BatteryLimits3 out;
    out.discharge = get<discharge_layout, decltype(out.discharge)>(frame);
    out.charge = get<charge_layout, decltype(out.charge)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("Discharge", "A", discharge, discharge_layout);
    see("Charge", "A", charge, charge_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("Discharge", "Allowed discharge current of this battery.", std::span<const ValueName>());
    see("Charge", "Allowed charge current of this battery.", std::span<const ValueName>());
  }
};

/// Limits of battery 4.
struct BatteryLimits4 {
  static constexpr const char* name = "BatteryLimits4";
  static constexpr std::uint16_t id = 0x114;
  static constexpr std::uint32_t cycle_us = 100000;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 276;
  static constexpr SignalLayout discharge_layout = {16, 16, false, 0.1F, 0.0F, 0.0F, 6553.4F, true, 65535};
  float discharge = unknown;  ///< [A] Allowed discharge current of this battery.
  static constexpr SignalLayout charge_layout = {32, 16, false, 0.1F, 0.0F, 0.0F, 6553.4F, true, 65535};
  float charge = unknown;  ///< [A] Allowed charge current of this battery.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<discharge_layout>(out, discharge);
    put<charge_layout>(out, charge);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr BatteryLimits4 of(const can::Frame& frame) {
    BatteryLimits4 out;
    out.discharge = get<discharge_layout, decltype(out.discharge)>(frame);
    out.charge = get<charge_layout, decltype(out.charge)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("Discharge", "A", discharge, discharge_layout);
    see("Charge", "A", charge, charge_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("Discharge", "Allowed discharge current of this battery.", std::span<const ValueName>());
    see("Charge", "Allowed charge current of this battery.", std::span<const ValueName>());
  }
};

/// All messages.
using Messages = std::tuple<Presence1, Presence2, Presence3, Presence4, BatteryLimits1, BatteryLimits2, BatteryLimits3, BatteryLimits4>;

}  // namespace bms::can::parallel
