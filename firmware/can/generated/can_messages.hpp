// Generated from greybox_bms.dbc by ./bms messages. Do not edit.
// SHA-256 of that file: 7dea2096f5325e4188ba4676036235d2b9eae716b62fdaa1253837e10fc73902
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <tuple>

#include "can/codec.hpp"

namespace bms::can {

/// State of charge and its uncertainty; with every sample.
struct PackState {
  static constexpr const char* name = "PackState";
  static constexpr std::uint16_t id = 0x180;
  static constexpr std::uint32_t cycle_us = 0;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 384;
  static constexpr SignalLayout soc_quality_layout = {12, 4, false, 1.0F, 0.0F, 0.0F, 14.0F, true, 15};
  std::uint32_t soc_quality = 0;  ///< What the state of charge is based on now.
  static constexpr std::uint32_t soc_quality_not_started = 0;
  static constexpr std::uint32_t soc_quality_determined_by_the_voltage = 1;
  static constexpr std::uint32_t soc_quality_carried_by_counting = 2;
  static constexpr std::uint32_t soc_quality_more_than_one_state_of_charge_fits = 3;
  static constexpr std::uint32_t soc_quality_the_voltage_contradicts = 4;
  static constexpr std::uint32_t soc_quality_not_known = 15;
  static constexpr SignalLayout soc_layout = {16, 16, false, 0.002F, 0.0F, 0.0F, 125.0F, true, 65535};
  float soc = unknown;  ///< [%] Estimated state of charge. An estimate below 0 is sent as 0.
  static constexpr SignalLayout soc_sigma_layout = {32, 16, false, 0.002F, 0.0F, 0.0F, 125.0F, true, 65535};
  float soc_sigma = unknown;  ///< [%] Standard deviation.
  static constexpr SignalLayout soc_display_layout = {48, 16, false, 0.002F, 0.0F, 0.0F, 100.0F, true, 65535};
  float soc_display = unknown;  ///< [%] State of charge for a display: follows the estimate without jumps.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<soc_quality_layout>(out, soc_quality);
    put<soc_layout>(out, soc);
    put<soc_sigma_layout>(out, soc_sigma);
    put<soc_display_layout>(out, soc_display);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr PackState of(const can::Frame& frame) {
    PackState out;
    out.soc_quality = get<soc_quality_layout, decltype(out.soc_quality)>(frame);
    out.soc = get<soc_layout, decltype(out.soc)>(frame);
    out.soc_sigma = get<soc_sigma_layout, decltype(out.soc_sigma)>(frame);
    out.soc_display = get<soc_display_layout, decltype(out.soc_display)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("SocQuality", "", soc_quality, soc_quality_layout);
    see("Soc", "%", soc, soc_layout);
    see("SocSigma", "%", soc_sigma, soc_sigma_layout);
    see("SocDisplay", "%", soc_display, soc_display_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    { static constexpr std::array<ValueName, 6> names{{ValueName{0, "not started"}, ValueName{1, "determined by the voltage"}, ValueName{2, "carried by counting"}, ValueName{3, "more than one state of charge fits"}, ValueName{4, "the voltage contradicts"}, ValueName{15, "not known"}}}; see("SocQuality", "What the state of charge is based on now.", std::span<const ValueName>(names)); }
    see("Soc", "Estimated state of charge. An estimate below 0 is sent as 0.", std::span<const ValueName>());
    see("SocSigma", "Standard deviation.", std::span<const ValueName>());
    see("SocDisplay", "State of charge for a display: follows the estimate without jumps.", std::span<const ValueName>());
  }
};

/// Sensor readings; with every sample.
struct PackElectrical {
  static constexpr const char* name = "PackElectrical";
  static constexpr std::uint16_t id = 0x181;
  static constexpr std::uint32_t cycle_us = 0;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 385;
  static constexpr SignalLayout voltage_layout = {16, 16, false, 0.001F, 0.0F, 0.0F, 65.534F, true, 65535};
  float voltage = unknown;  ///< [V] Voltage at the terminals. Of a pack of more than 16 cells it is not known here, but in PackVoltage.
  static constexpr SignalLayout current_layout = {32, 16, true, 0.02F, 0.0F, -655.34F, 655.34F, true, -32768};
  float current = unknown;  ///< [A] Positive: charging.
  static constexpr SignalLayout temperature_layout = {48, 16, true, 0.01F, 0.0F, -60.0F, 150.0F, true, -32768};
  float temperature = unknown;  ///< [degC] Cell temperature.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<voltage_layout>(out, voltage);
    put<current_layout>(out, current);
    put<temperature_layout>(out, temperature);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr PackElectrical of(const can::Frame& frame) {
    PackElectrical out;
    out.voltage = get<voltage_layout, decltype(out.voltage)>(frame);
    out.current = get<current_layout, decltype(out.current)>(frame);
    out.temperature = get<temperature_layout, decltype(out.temperature)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("Voltage", "V", voltage, voltage_layout);
    see("Current", "A", current, current_layout);
    see("Temperature", "degC", temperature, temperature_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("Voltage", "Voltage at the terminals. Of a pack of more than 16 cells it is not known here, but in PackVoltage.", std::span<const ValueName>());
    see("Current", "Positive: charging.", std::span<const ValueName>());
    see("Temperature", "Cell temperature.", std::span<const ValueName>());
  }
};

/// Flags and counters; the last frame of every sample.
struct Status {
  static constexpr const char* name = "Status";
  static constexpr std::uint16_t id = 0x182;
  static constexpr std::uint32_t cycle_us = 0;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 386;
  static constexpr SignalLayout reset_cause_layout = {12, 4, false, 1.0F, 0.0F, 0.0F, 15.0F, false, 0};
  std::uint32_t reset_cause = 0;  ///< Cause of the last start of the firmware.
  static constexpr std::uint32_t reset_cause_unknown = 0;
  static constexpr std::uint32_t reset_cause_power_on = 1;
  static constexpr std::uint32_t reset_cause_pin = 2;
  static constexpr std::uint32_t reset_cause_software = 3;
  static constexpr std::uint32_t reset_cause_watchdog = 4;
  static constexpr std::uint32_t reset_cause_brown_out = 5;
  static constexpr std::uint32_t reset_cause_low_power = 6;
  static constexpr SignalLayout flags_layout = {16, 32, false, 1.0F, 0.0F, 0.0F, 4294967295.0F, false, 0};
  std::uint32_t flags = 0;  ///< Bits that say why the estimate is less accurate than usual: estimator/estimate.hpp.
  static constexpr SignalLayout sample_counter_layout = {48, 16, false, 1.0F, 0.0F, 0.0F, 65535.0F, false, 0};
  std::uint32_t sample_counter = 0;  ///< Samples since the start, including samples that were not published; wraps.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<reset_cause_layout>(out, reset_cause);
    put<flags_layout>(out, flags);
    put<sample_counter_layout>(out, sample_counter);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr Status of(const can::Frame& frame) {
    Status out;
    out.reset_cause = get<reset_cause_layout, decltype(out.reset_cause)>(frame);
    out.flags = get<flags_layout, decltype(out.flags)>(frame);
    out.sample_counter = get<sample_counter_layout, decltype(out.sample_counter)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("ResetCause", "", reset_cause, reset_cause_layout);
    see("Flags", "", flags, flags_layout);
    see("SampleCounter", "", sample_counter, sample_counter_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    { static constexpr std::array<ValueName, 7> names{{ValueName{0, "unknown"}, ValueName{1, "power on"}, ValueName{2, "pin"}, ValueName{3, "software"}, ValueName{4, "watchdog"}, ValueName{5, "brown-out"}, ValueName{6, "low power"}}}; see("ResetCause", "Cause of the last start of the firmware.", std::span<const ValueName>(names)); }
    see("Flags", "Bits that say why the estimate is less accurate than usual: estimator/estimate.hpp.", std::span<const ValueName>());
    see("SampleCounter", "Samples since the start, including samples that were not published; wraps.", std::span<const ValueName>());
  }
};

/// Firmware version and cell file.
struct Identity {
  static constexpr const char* name = "Identity";
  static constexpr std::uint16_t id = 0x183;
  static constexpr std::uint32_t cycle_us = 1000000;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 387;
  static constexpr SignalLayout version_patch_layout = {12, 4, false, 1.0F, 0.0F, 0.0F, 15.0F, false, 0};
  std::uint32_t version_patch = 0;  ///< Firmware version.
  static constexpr SignalLayout cell_hash_layout = {16, 32, false, 1.0F, 0.0F, 0.0F, 4294967295.0F, false, 0};
  std::uint32_t cell_hash = 0;  ///< First 32 bits of the SHA-256 of the cell file.
  static constexpr SignalLayout version_minor_layout = {48, 8, false, 1.0F, 0.0F, 0.0F, 255.0F, false, 0};
  std::uint32_t version_minor = 0;  ///< Firmware version.
  static constexpr SignalLayout version_major_layout = {56, 8, false, 1.0F, 0.0F, 0.0F, 255.0F, false, 0};
  std::uint32_t version_major = 0;  ///< Firmware version.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<version_patch_layout>(out, version_patch);
    put<cell_hash_layout>(out, cell_hash);
    put<version_minor_layout>(out, version_minor);
    put<version_major_layout>(out, version_major);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr Identity of(const can::Frame& frame) {
    Identity out;
    out.version_patch = get<version_patch_layout, decltype(out.version_patch)>(frame);
    out.cell_hash = get<cell_hash_layout, decltype(out.cell_hash)>(frame);
    out.version_minor = get<version_minor_layout, decltype(out.version_minor)>(frame);
    out.version_major = get<version_major_layout, decltype(out.version_major)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("VersionPatch", "", version_patch, version_patch_layout);
    see("CellHash", "", cell_hash, cell_hash_layout);
    see("VersionMinor", "", version_minor, version_minor_layout);
    see("VersionMajor", "", version_major, version_major_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("VersionPatch", "Firmware version.", std::span<const ValueName>());
    see("CellHash", "First 32 bits of the SHA-256 of the cell file.", std::span<const ValueName>());
    see("VersionMinor", "Firmware version.", std::span<const ValueName>());
    see("VersionMajor", "Firmware version.", std::span<const ValueName>());
  }
};

/// Where a processor fault ended the last run. Sent once, if there was one.
struct LastFaultAddress {
  static constexpr const char* name = "LastFaultAddress";
  static constexpr std::uint16_t id = 0x184;
  static constexpr std::uint32_t cycle_us = 0;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 388;
  static constexpr SignalLayout program_counter_layout = {16, 32, false, 1.0F, 0.0F, 0.0F, 4294967295.0F, false, 0};
  std::uint32_t program_counter = 0;  ///< Address of the instruction.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<program_counter_layout>(out, program_counter);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr LastFaultAddress of(const can::Frame& frame) {
    LastFaultAddress out;
    out.program_counter = get<program_counter_layout, decltype(out.program_counter)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("ProgramCounter", "", program_counter, program_counter_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("ProgramCounter", "Address of the instruction.", std::span<const ValueName>());
  }
};

/// Cause of the processor fault. Sent after LastFaultAddress.
struct LastFaultCause {
  static constexpr const char* name = "LastFaultCause";
  static constexpr std::uint16_t id = 0x185;
  static constexpr std::uint32_t cycle_us = 0;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 389;
  static constexpr SignalLayout configurable_fault_status_layout = {16, 32, false, 1.0F, 0.0F, 0.0F, 4294967295.0F, false, 0};
  std::uint32_t configurable_fault_status = 0;  ///< CFSR register (ARMv7-M architecture, B3.2.15).

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<configurable_fault_status_layout>(out, configurable_fault_status);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr LastFaultCause of(const can::Frame& frame) {
    LastFaultCause out;
    out.configurable_fault_status = get<configurable_fault_status_layout, decltype(out.configurable_fault_status)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("ConfigurableFaultStatus", "", configurable_fault_status, configurable_fault_status_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("ConfigurableFaultStatus", "CFSR register (ARMv7-M architecture, B3.2.15).", std::span<const ValueName>());
  }
};

/// Currents that keep the cell within its limits according to the model, at most the limits of the cell file.
struct CurrentLimits {
  static constexpr const char* name = "CurrentLimits";
  static constexpr std::uint16_t id = 0x186;
  static constexpr std::uint32_t cycle_us = 1000000;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 390;
  static constexpr SignalLayout discharge_now_layout = {16, 12, false, 0.2F, 0.0F, 0.0F, 818.8F, true, 4095};
  float discharge_now = unknown;  ///< [A] For one second.
  static constexpr SignalLayout charge_now_layout = {28, 12, false, 0.2F, 0.0F, 0.0F, 818.8F, true, 4095};
  float charge_now = unknown;  ///< [A] For one second.
  static constexpr SignalLayout discharge_ten_seconds_layout = {40, 12, false, 0.2F, 0.0F, 0.0F, 818.8F, true, 4095};
  float discharge_ten_seconds = unknown;  ///< [A] For ten seconds.
  static constexpr SignalLayout charge_ten_seconds_layout = {52, 12, false, 0.2F, 0.0F, 0.0F, 818.8F, true, 4095};
  float charge_ten_seconds = unknown;  ///< [A] For ten seconds.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<discharge_now_layout>(out, discharge_now);
    put<charge_now_layout>(out, charge_now);
    put<discharge_ten_seconds_layout>(out, discharge_ten_seconds);
    put<charge_ten_seconds_layout>(out, charge_ten_seconds);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr CurrentLimits of(const can::Frame& frame) {
    CurrentLimits out;
    out.discharge_now = get<discharge_now_layout, decltype(out.discharge_now)>(frame);
    out.charge_now = get<charge_now_layout, decltype(out.charge_now)>(frame);
    out.discharge_ten_seconds = get<discharge_ten_seconds_layout, decltype(out.discharge_ten_seconds)>(frame);
    out.charge_ten_seconds = get<charge_ten_seconds_layout, decltype(out.charge_ten_seconds)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("DischargeNow", "A", discharge_now, discharge_now_layout);
    see("ChargeNow", "A", charge_now, charge_now_layout);
    see("DischargeTenSeconds", "A", discharge_ten_seconds, discharge_ten_seconds_layout);
    see("ChargeTenSeconds", "A", charge_ten_seconds, charge_ten_seconds_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("DischargeNow", "For one second.", std::span<const ValueName>());
    see("ChargeNow", "For one second.", std::span<const ValueName>());
    see("DischargeTenSeconds", "For ten seconds.", std::span<const ValueName>());
    see("ChargeTenSeconds", "For ten seconds.", std::span<const ValueName>());
  }
};

/// State of health compared with the cell file, estimated in normal use.
struct Health {
  static constexpr const char* name = "Health";
  static constexpr std::uint16_t id = 0x187;
  static constexpr std::uint32_t cycle_us = 1000000;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 391;
  static constexpr SignalLayout capacity_layout = {16, 12, false, 0.05F, 0.0F, 0.0F, 204.7F, true, 4095};
  float capacity = unknown;  ///< [%] 100 %: as in the cell file.
  static constexpr SignalLayout capacity_sigma_layout = {28, 12, false, 0.01F, 0.0F, 0.0F, 40.94F, true, 4095};
  float capacity_sigma = unknown;  ///< [%] Standard deviation.
  static constexpr SignalLayout resistance_layout = {40, 12, false, 0.2F, 0.0F, 0.0F, 818.8F, true, 4095};
  float resistance = unknown;  ///< [%] 100 %: as in the cell file.
  static constexpr SignalLayout resistance_sigma_layout = {52, 12, false, 0.02F, 0.0F, 0.0F, 81.88F, true, 4095};
  float resistance_sigma = unknown;  ///< [%] Standard deviation.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<capacity_layout>(out, capacity);
    put<capacity_sigma_layout>(out, capacity_sigma);
    put<resistance_layout>(out, resistance);
    put<resistance_sigma_layout>(out, resistance_sigma);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr Health of(const can::Frame& frame) {
    Health out;
    out.capacity = get<capacity_layout, decltype(out.capacity)>(frame);
    out.capacity_sigma = get<capacity_sigma_layout, decltype(out.capacity_sigma)>(frame);
    out.resistance = get<resistance_layout, decltype(out.resistance)>(frame);
    out.resistance_sigma = get<resistance_sigma_layout, decltype(out.resistance_sigma)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("Capacity", "%", capacity, capacity_layout);
    see("CapacitySigma", "%", capacity_sigma, capacity_sigma_layout);
    see("Resistance", "%", resistance, resistance_layout);
    see("ResistanceSigma", "%", resistance_sigma, resistance_sigma_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("Capacity", "100 %: as in the cell file.", std::span<const ValueName>());
    see("CapacitySigma", "Standard deviation.", std::span<const ValueName>());
    see("Resistance", "100 %: as in the cell file.", std::span<const ValueName>());
    see("ResistanceSigma", "Standard deviation.", std::span<const ValueName>());
  }
};

/// How long the state of charge has been based on coulomb counting alone.
struct SocAnchor {
  static constexpr const char* name = "SocAnchor";
  static constexpr std::uint16_t id = 0x188;
  static constexpr std::uint32_t cycle_us = 1000000;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 392;
  static constexpr SignalLayout observable_layout = {12, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t observable = 0;  ///< The voltage determines the state of charge now.
  static constexpr std::uint32_t observable_no = 0;
  static constexpr std::uint32_t observable_yes = 1;
  static constexpr SignalLayout seconds_since_anchor_layout = {16, 24, false, 1.0F, 0.0F, 0.0F, 16777214.0F, true, 16777215};
  float seconds_since_anchor = unknown;  ///< [s] Time since the voltage last determined the state of charge to 2 %.
  static constexpr SignalLayout charge_since_anchor_layout = {40, 16, false, 0.02F, 0.0F, 0.0F, 1310.68F, true, 65535};
  float charge_since_anchor = unknown;  ///< [%] Charge since then, charged plus discharged, relative to the capacity.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<observable_layout>(out, observable);
    put<seconds_since_anchor_layout>(out, seconds_since_anchor);
    put<charge_since_anchor_layout>(out, charge_since_anchor);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr SocAnchor of(const can::Frame& frame) {
    SocAnchor out;
    out.observable = get<observable_layout, decltype(out.observable)>(frame);
    out.seconds_since_anchor = get<seconds_since_anchor_layout, decltype(out.seconds_since_anchor)>(frame);
    out.charge_since_anchor = get<charge_since_anchor_layout, decltype(out.charge_since_anchor)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("Observable", "", observable, observable_layout);
    see("SecondsSinceAnchor", "s", seconds_since_anchor, seconds_since_anchor_layout);
    see("ChargeSinceAnchor", "%", charge_since_anchor, charge_since_anchor_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    { static constexpr std::array<ValueName, 2> names{{ValueName{0, "no"}, ValueName{1, "yes"}}}; see("Observable", "The voltage determines the state of charge now.", std::span<const ValueName>(names)); }
    see("SecondsSinceAnchor", "Time since the voltage last determined the state of charge to 2 %.", std::span<const ValueName>());
    see("ChargeSinceAnchor", "Charge since then, charged plus discharged, relative to the capacity.", std::span<const ValueName>());
  }
};

/// Internal voltages of the model; with every sample.
struct ModelDetail {
  static constexpr const char* name = "ModelDetail";
  static constexpr std::uint16_t id = 0x189;
  static constexpr std::uint32_t cycle_us = 0;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 393;
  static constexpr SignalLayout voltage_rc_layout = {16, 24, true, 1e-06F, 0.0F, -8.388607F, 8.388607F, true, -8388608};
  float voltage_rc = unknown;  ///< [V] Voltage of the RC circuit after the filter's correction.
  static constexpr SignalLayout voltage_predicted_layout = {40, 24, true, 1e-06F, 0.0F, -8.388607F, 8.388607F, true, -8388608};
  float voltage_predicted = unknown;  ///< [V] Terminal voltage that the model predicted before this sample.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<voltage_rc_layout>(out, voltage_rc);
    put<voltage_predicted_layout>(out, voltage_predicted);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr ModelDetail of(const can::Frame& frame) {
    ModelDetail out;
    out.voltage_rc = get<voltage_rc_layout, decltype(out.voltage_rc)>(frame);
    out.voltage_predicted = get<voltage_predicted_layout, decltype(out.voltage_predicted)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("VoltageRc", "V", voltage_rc, voltage_rc_layout);
    see("VoltagePredicted", "V", voltage_predicted, voltage_predicted_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("VoltageRc", "Voltage of the RC circuit after the filter's correction.", std::span<const ValueName>());
    see("VoltagePredicted", "Terminal voltage that the model predicted before this sample.", std::span<const ValueName>());
  }
};

/// Persistent sensor and model errors. Sent if the cell file makes them states of the filter.
struct SensorErrors {
  static constexpr const char* name = "SensorErrors";
  static constexpr std::uint16_t id = 0x18a;
  static constexpr std::uint32_t cycle_us = 1000000;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 394;
  static constexpr SignalLayout current_offset_layout = {16, 16, true, 0.001F, 0.0F, -32.767F, 32.767F, true, -32768};
  float current_offset = unknown;  ///< [A] The current sensor reads too high by this value.
  static constexpr SignalLayout current_offset_sigma_layout = {32, 16, false, 0.001F, 0.0F, 0.0F, 65.534F, true, 65535};
  float current_offset_sigma = unknown;  ///< [A] Standard deviation.
  static constexpr SignalLayout voltage_error_layout = {48, 16, true, 0.0001F, 0.0F, -3.2767F, 3.2767F, true, -32768};
  float voltage_error = unknown;  ///< [V] Measured voltage minus model voltage.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<current_offset_layout>(out, current_offset);
    put<current_offset_sigma_layout>(out, current_offset_sigma);
    put<voltage_error_layout>(out, voltage_error);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr SensorErrors of(const can::Frame& frame) {
    SensorErrors out;
    out.current_offset = get<current_offset_layout, decltype(out.current_offset)>(frame);
    out.current_offset_sigma = get<current_offset_sigma_layout, decltype(out.current_offset_sigma)>(frame);
    out.voltage_error = get<voltage_error_layout, decltype(out.voltage_error)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("CurrentOffset", "A", current_offset, current_offset_layout);
    see("CurrentOffsetSigma", "A", current_offset_sigma, current_offset_sigma_layout);
    see("VoltageError", "V", voltage_error, voltage_error_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("CurrentOffset", "The current sensor reads too high by this value.", std::span<const ValueName>());
    see("CurrentOffsetSigma", "Standard deviation.", std::span<const ValueName>());
    see("VoltageError", "Measured voltage minus model voltage.", std::span<const ValueName>());
  }
};

/// Cells 1 to 4, counted from the negative end.
struct CellVoltages1 {
  static constexpr const char* name = "CellVoltages1";
  static constexpr std::uint16_t id = 0x190;
  static constexpr std::uint32_t cycle_us = 500000;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 400;
  static constexpr SignalLayout cell1_layout = {12, 13, false, 0.001F, 0.0F, 0.0F, 8.19F, true, 8191};
  float cell1 = unknown;  ///< [V] Voltage of this cell. Not known if the pack has fewer cells.
  static constexpr SignalLayout cell2_layout = {25, 13, false, 0.001F, 0.0F, 0.0F, 8.19F, true, 8191};
  float cell2 = unknown;  ///< [V] Voltage of this cell. Not known if the pack has fewer cells.
  static constexpr SignalLayout cell3_layout = {38, 13, false, 0.001F, 0.0F, 0.0F, 8.19F, true, 8191};
  float cell3 = unknown;  ///< [V] Voltage of this cell. Not known if the pack has fewer cells.
  static constexpr SignalLayout cell4_layout = {51, 13, false, 0.001F, 0.0F, 0.0F, 8.19F, true, 8191};
  float cell4 = unknown;  ///< [V] Voltage of this cell. Not known if the pack has fewer cells.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<cell1_layout>(out, cell1);
    put<cell2_layout>(out, cell2);
    put<cell3_layout>(out, cell3);
    put<cell4_layout>(out, cell4);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr CellVoltages1 of(const can::Frame& frame) {
    CellVoltages1 out;
    out.cell1 = get<cell1_layout, decltype(out.cell1)>(frame);
    out.cell2 = get<cell2_layout, decltype(out.cell2)>(frame);
    out.cell3 = get<cell3_layout, decltype(out.cell3)>(frame);
    out.cell4 = get<cell4_layout, decltype(out.cell4)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("Cell1", "V", cell1, cell1_layout);
    see("Cell2", "V", cell2, cell2_layout);
    see("Cell3", "V", cell3, cell3_layout);
    see("Cell4", "V", cell4, cell4_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("Cell1", "Voltage of this cell. Not known if the pack has fewer cells.", std::span<const ValueName>());
    see("Cell2", "Voltage of this cell. Not known if the pack has fewer cells.", std::span<const ValueName>());
    see("Cell3", "Voltage of this cell. Not known if the pack has fewer cells.", std::span<const ValueName>());
    see("Cell4", "Voltage of this cell. Not known if the pack has fewer cells.", std::span<const ValueName>());
  }
};

/// Cells 5 to 8, counted from the negative end.
struct CellVoltages2 {
  static constexpr const char* name = "CellVoltages2";
  static constexpr std::uint16_t id = 0x191;
  static constexpr std::uint32_t cycle_us = 500000;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 401;
  static constexpr SignalLayout cell5_layout = {12, 13, false, 0.001F, 0.0F, 0.0F, 8.19F, true, 8191};
  float cell5 = unknown;  ///< [V] Voltage of this cell. Not known if the pack has fewer cells.
  static constexpr SignalLayout cell6_layout = {25, 13, false, 0.001F, 0.0F, 0.0F, 8.19F, true, 8191};
  float cell6 = unknown;  ///< [V] Voltage of this cell. Not known if the pack has fewer cells.
  static constexpr SignalLayout cell7_layout = {38, 13, false, 0.001F, 0.0F, 0.0F, 8.19F, true, 8191};
  float cell7 = unknown;  ///< [V] Voltage of this cell. Not known if the pack has fewer cells.
  static constexpr SignalLayout cell8_layout = {51, 13, false, 0.001F, 0.0F, 0.0F, 8.19F, true, 8191};
  float cell8 = unknown;  ///< [V] Voltage of this cell. Not known if the pack has fewer cells.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<cell5_layout>(out, cell5);
    put<cell6_layout>(out, cell6);
    put<cell7_layout>(out, cell7);
    put<cell8_layout>(out, cell8);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr CellVoltages2 of(const can::Frame& frame) {
    CellVoltages2 out;
    out.cell5 = get<cell5_layout, decltype(out.cell5)>(frame);
    out.cell6 = get<cell6_layout, decltype(out.cell6)>(frame);
    out.cell7 = get<cell7_layout, decltype(out.cell7)>(frame);
    out.cell8 = get<cell8_layout, decltype(out.cell8)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("Cell5", "V", cell5, cell5_layout);
    see("Cell6", "V", cell6, cell6_layout);
    see("Cell7", "V", cell7, cell7_layout);
    see("Cell8", "V", cell8, cell8_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("Cell5", "Voltage of this cell. Not known if the pack has fewer cells.", std::span<const ValueName>());
    see("Cell6", "Voltage of this cell. Not known if the pack has fewer cells.", std::span<const ValueName>());
    see("Cell7", "Voltage of this cell. Not known if the pack has fewer cells.", std::span<const ValueName>());
    see("Cell8", "Voltage of this cell. Not known if the pack has fewer cells.", std::span<const ValueName>());
  }
};

/// Cells 9 to 12, counted from the negative end.
struct CellVoltages3 {
  static constexpr const char* name = "CellVoltages3";
  static constexpr std::uint16_t id = 0x192;
  static constexpr std::uint32_t cycle_us = 500000;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 402;
  static constexpr SignalLayout cell9_layout = {12, 13, false, 0.001F, 0.0F, 0.0F, 8.19F, true, 8191};
  float cell9 = unknown;  ///< [V] Voltage of this cell. Not known if the pack has fewer cells.
  static constexpr SignalLayout cell10_layout = {25, 13, false, 0.001F, 0.0F, 0.0F, 8.19F, true, 8191};
  float cell10 = unknown;  ///< [V] Voltage of this cell. Not known if the pack has fewer cells.
  static constexpr SignalLayout cell11_layout = {38, 13, false, 0.001F, 0.0F, 0.0F, 8.19F, true, 8191};
  float cell11 = unknown;  ///< [V] Voltage of this cell. Not known if the pack has fewer cells.
  static constexpr SignalLayout cell12_layout = {51, 13, false, 0.001F, 0.0F, 0.0F, 8.19F, true, 8191};
  float cell12 = unknown;  ///< [V] Voltage of this cell. Not known if the pack has fewer cells.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<cell9_layout>(out, cell9);
    put<cell10_layout>(out, cell10);
    put<cell11_layout>(out, cell11);
    put<cell12_layout>(out, cell12);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr CellVoltages3 of(const can::Frame& frame) {
    CellVoltages3 out;
    out.cell9 = get<cell9_layout, decltype(out.cell9)>(frame);
    out.cell10 = get<cell10_layout, decltype(out.cell10)>(frame);
    out.cell11 = get<cell11_layout, decltype(out.cell11)>(frame);
    out.cell12 = get<cell12_layout, decltype(out.cell12)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("Cell9", "V", cell9, cell9_layout);
    see("Cell10", "V", cell10, cell10_layout);
    see("Cell11", "V", cell11, cell11_layout);
    see("Cell12", "V", cell12, cell12_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("Cell9", "Voltage of this cell. Not known if the pack has fewer cells.", std::span<const ValueName>());
    see("Cell10", "Voltage of this cell. Not known if the pack has fewer cells.", std::span<const ValueName>());
    see("Cell11", "Voltage of this cell. Not known if the pack has fewer cells.", std::span<const ValueName>());
    see("Cell12", "Voltage of this cell. Not known if the pack has fewer cells.", std::span<const ValueName>());
  }
};

/// Cells 13 to 16, counted from the negative end.
struct CellVoltages4 {
  static constexpr const char* name = "CellVoltages4";
  static constexpr std::uint16_t id = 0x193;
  static constexpr std::uint32_t cycle_us = 500000;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 403;
  static constexpr SignalLayout cell13_layout = {12, 13, false, 0.001F, 0.0F, 0.0F, 8.19F, true, 8191};
  float cell13 = unknown;  ///< [V] Voltage of this cell. Not known if the pack has fewer cells.
  static constexpr SignalLayout cell14_layout = {25, 13, false, 0.001F, 0.0F, 0.0F, 8.19F, true, 8191};
  float cell14 = unknown;  ///< [V] Voltage of this cell. Not known if the pack has fewer cells.
  static constexpr SignalLayout cell15_layout = {38, 13, false, 0.001F, 0.0F, 0.0F, 8.19F, true, 8191};
  float cell15 = unknown;  ///< [V] Voltage of this cell. Not known if the pack has fewer cells.
  static constexpr SignalLayout cell16_layout = {51, 13, false, 0.001F, 0.0F, 0.0F, 8.19F, true, 8191};
  float cell16 = unknown;  ///< [V] Voltage of this cell. Not known if the pack has fewer cells.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<cell13_layout>(out, cell13);
    put<cell14_layout>(out, cell14);
    put<cell15_layout>(out, cell15);
    put<cell16_layout>(out, cell16);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr CellVoltages4 of(const can::Frame& frame) {
    CellVoltages4 out;
    out.cell13 = get<cell13_layout, decltype(out.cell13)>(frame);
    out.cell14 = get<cell14_layout, decltype(out.cell14)>(frame);
    out.cell15 = get<cell15_layout, decltype(out.cell15)>(frame);
    out.cell16 = get<cell16_layout, decltype(out.cell16)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("Cell13", "V", cell13, cell13_layout);
    see("Cell14", "V", cell14, cell14_layout);
    see("Cell15", "V", cell15, cell15_layout);
    see("Cell16", "V", cell16, cell16_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("Cell13", "Voltage of this cell. Not known if the pack has fewer cells.", std::span<const ValueName>());
    see("Cell14", "Voltage of this cell. Not known if the pack has fewer cells.", std::span<const ValueName>());
    see("Cell15", "Voltage of this cell. Not known if the pack has fewer cells.", std::span<const ValueName>());
    see("Cell16", "Voltage of this cell. Not known if the pack has fewer cells.", std::span<const ValueName>());
  }
};

/// Cells 17 to 20, counted from the negative end. Sent by packs of more than 16 cells.
struct CellVoltages5 {
  static constexpr const char* name = "CellVoltages5";
  static constexpr std::uint16_t id = 0x1ac;
  static constexpr std::uint32_t cycle_us = 500000;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 428;
  static constexpr SignalLayout cell17_layout = {12, 13, false, 0.001F, 0.0F, 0.0F, 8.19F, true, 8191};
  float cell17 = unknown;  ///< [V] Voltage of this cell. Not known if the pack has fewer cells.
  static constexpr SignalLayout cell18_layout = {25, 13, false, 0.001F, 0.0F, 0.0F, 8.19F, true, 8191};
  float cell18 = unknown;  ///< [V] Voltage of this cell. Not known if the pack has fewer cells.
  static constexpr SignalLayout cell19_layout = {38, 13, false, 0.001F, 0.0F, 0.0F, 8.19F, true, 8191};
  float cell19 = unknown;  ///< [V] Voltage of this cell. Not known if the pack has fewer cells.
  static constexpr SignalLayout cell20_layout = {51, 13, false, 0.001F, 0.0F, 0.0F, 8.19F, true, 8191};
  float cell20 = unknown;  ///< [V] Voltage of this cell. Not known if the pack has fewer cells.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<cell17_layout>(out, cell17);
    put<cell18_layout>(out, cell18);
    put<cell19_layout>(out, cell19);
    put<cell20_layout>(out, cell20);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr CellVoltages5 of(const can::Frame& frame) {
    CellVoltages5 out;
    out.cell17 = get<cell17_layout, decltype(out.cell17)>(frame);
    out.cell18 = get<cell18_layout, decltype(out.cell18)>(frame);
    out.cell19 = get<cell19_layout, decltype(out.cell19)>(frame);
    out.cell20 = get<cell20_layout, decltype(out.cell20)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("Cell17", "V", cell17, cell17_layout);
    see("Cell18", "V", cell18, cell18_layout);
    see("Cell19", "V", cell19, cell19_layout);
    see("Cell20", "V", cell20, cell20_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("Cell17", "Voltage of this cell. Not known if the pack has fewer cells.", std::span<const ValueName>());
    see("Cell18", "Voltage of this cell. Not known if the pack has fewer cells.", std::span<const ValueName>());
    see("Cell19", "Voltage of this cell. Not known if the pack has fewer cells.", std::span<const ValueName>());
    see("Cell20", "Voltage of this cell. Not known if the pack has fewer cells.", std::span<const ValueName>());
  }
};

/// Cells 21 to 24, counted from the negative end. Sent by packs of more than 20 cells.
struct CellVoltages6 {
  static constexpr const char* name = "CellVoltages6";
  static constexpr std::uint16_t id = 0x1ad;
  static constexpr std::uint32_t cycle_us = 500000;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 429;
  static constexpr SignalLayout cell21_layout = {12, 13, false, 0.001F, 0.0F, 0.0F, 8.19F, true, 8191};
  float cell21 = unknown;  ///< [V] Voltage of this cell. Not known if the pack has fewer cells.
  static constexpr SignalLayout cell22_layout = {25, 13, false, 0.001F, 0.0F, 0.0F, 8.19F, true, 8191};
  float cell22 = unknown;  ///< [V] Voltage of this cell. Not known if the pack has fewer cells.
  static constexpr SignalLayout cell23_layout = {38, 13, false, 0.001F, 0.0F, 0.0F, 8.19F, true, 8191};
  float cell23 = unknown;  ///< [V] Voltage of this cell. Not known if the pack has fewer cells.
  static constexpr SignalLayout cell24_layout = {51, 13, false, 0.001F, 0.0F, 0.0F, 8.19F, true, 8191};
  float cell24 = unknown;  ///< [V] Voltage of this cell. Not known if the pack has fewer cells.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<cell21_layout>(out, cell21);
    put<cell22_layout>(out, cell22);
    put<cell23_layout>(out, cell23);
    put<cell24_layout>(out, cell24);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr CellVoltages6 of(const can::Frame& frame) {
    CellVoltages6 out;
    out.cell21 = get<cell21_layout, decltype(out.cell21)>(frame);
    out.cell22 = get<cell22_layout, decltype(out.cell22)>(frame);
    out.cell23 = get<cell23_layout, decltype(out.cell23)>(frame);
    out.cell24 = get<cell24_layout, decltype(out.cell24)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("Cell21", "V", cell21, cell21_layout);
    see("Cell22", "V", cell22, cell22_layout);
    see("Cell23", "V", cell23, cell23_layout);
    see("Cell24", "V", cell24, cell24_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("Cell21", "Voltage of this cell. Not known if the pack has fewer cells.", std::span<const ValueName>());
    see("Cell22", "Voltage of this cell. Not known if the pack has fewer cells.", std::span<const ValueName>());
    see("Cell23", "Voltage of this cell. Not known if the pack has fewer cells.", std::span<const ValueName>());
    see("Cell24", "Voltage of this cell. Not known if the pack has fewer cells.", std::span<const ValueName>());
  }
};

/// Voltage of a pack of more than 16 cells, which PackElectrical cannot hold. No other pack sends it.
struct PackVoltage {
  static constexpr const char* name = "PackVoltage";
  static constexpr std::uint16_t id = 0x1ae;
  static constexpr std::uint32_t cycle_us = 100000;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 430;
  static constexpr SignalLayout voltage_layout = {16, 16, false, 0.01F, 0.0F, 0.0F, 655.34F, true, 65535};
  float voltage = unknown;  ///< [V] Voltage at the terminals.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<voltage_layout>(out, voltage);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr PackVoltage of(const can::Frame& frame) {
    PackVoltage out;
    out.voltage = get<voltage_layout, decltype(out.voltage)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("Voltage", "V", voltage, voltage_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("Voltage", "Voltage at the terminals.", std::span<const ValueName>());
  }
};

/// Cells with the highest and the lowest voltage.
struct CellExtremes {
  static constexpr const char* name = "CellExtremes";
  static constexpr std::uint16_t id = 0x194;
  static constexpr std::uint32_t cycle_us = 500000;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 404;
  static constexpr SignalLayout highest_voltage_layout = {12, 13, false, 0.001F, 0.0F, 0.0F, 8.19F, true, 8191};
  float highest_voltage = unknown;  ///< [V] Of the cells.
  static constexpr SignalLayout lowest_voltage_layout = {25, 13, false, 0.001F, 0.0F, 0.0F, 8.19F, true, 8191};
  float lowest_voltage = unknown;  ///< [V] Of the cells.
  static constexpr SignalLayout highest_cell_layout = {38, 5, false, 1.0F, 0.0F, 0.0F, 30.0F, true, 31};
  std::uint32_t highest_cell = 0;  ///< Number of the cell with the highest voltage, from 1. Cells 31 and 32 are not known here; CellVoltages8 has their voltages.
  static constexpr SignalLayout lowest_cell_layout = {43, 5, false, 1.0F, 0.0F, 0.0F, 30.0F, true, 31};
  std::uint32_t lowest_cell = 0;  ///< Number of the cell with the lowest voltage, from 1. Cells 31 and 32 are not known here; CellVoltages8 has their voltages.
  static constexpr SignalLayout soc_spread_layout = {48, 16, false, 0.002F, 0.0F, 0.0F, 125.0F, true, 65535};
  float soc_spread = unknown;  ///< [%] State of charge of the fullest cell minus that of the emptiest cell.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<highest_voltage_layout>(out, highest_voltage);
    put<lowest_voltage_layout>(out, lowest_voltage);
    put<highest_cell_layout>(out, highest_cell);
    put<lowest_cell_layout>(out, lowest_cell);
    put<soc_spread_layout>(out, soc_spread);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr CellExtremes of(const can::Frame& frame) {
    CellExtremes out;
    out.highest_voltage = get<highest_voltage_layout, decltype(out.highest_voltage)>(frame);
    out.lowest_voltage = get<lowest_voltage_layout, decltype(out.lowest_voltage)>(frame);
    out.highest_cell = get<highest_cell_layout, decltype(out.highest_cell)>(frame);
    out.lowest_cell = get<lowest_cell_layout, decltype(out.lowest_cell)>(frame);
    out.soc_spread = get<soc_spread_layout, decltype(out.soc_spread)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("HighestVoltage", "V", highest_voltage, highest_voltage_layout);
    see("LowestVoltage", "V", lowest_voltage, lowest_voltage_layout);
    see("HighestCell", "", highest_cell, highest_cell_layout);
    see("LowestCell", "", lowest_cell, lowest_cell_layout);
    see("SocSpread", "%", soc_spread, soc_spread_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("HighestVoltage", "Of the cells.", std::span<const ValueName>());
    see("LowestVoltage", "Of the cells.", std::span<const ValueName>());
    see("HighestCell", "Number of the cell with the highest voltage, from 1. Cells 31 and 32 are not known here; CellVoltages8 has their voltages.", std::span<const ValueName>());
    see("LowestCell", "Number of the cell with the lowest voltage, from 1. Cells 31 and 32 are not known here; CellVoltages8 has their voltages.", std::span<const ValueName>());
    see("SocSpread", "State of charge of the fullest cell minus that of the emptiest cell.", std::span<const ValueName>());
  }
};

/// Temperature sensors of the pack.
struct Temperatures {
  static constexpr const char* name = "Temperatures";
  static constexpr std::uint16_t id = 0x195;
  static constexpr std::uint32_t cycle_us = 1000000;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 405;
  static constexpr SignalLayout temperature1_layout = {12, 12, false, 0.1F, 60.0F, -60.0F, 349.4F, true, 4095};
  float temperature1 = unknown;  ///< [degC] Temperature of this sensor. Not known if the sensor does not exist.
  static constexpr SignalLayout temperature2_layout = {24, 12, false, 0.1F, 60.0F, -60.0F, 349.4F, true, 4095};
  float temperature2 = unknown;  ///< [degC] Temperature of this sensor. Not known if the sensor does not exist.
  static constexpr SignalLayout temperature3_layout = {36, 12, false, 0.1F, 60.0F, -60.0F, 349.4F, true, 4095};
  float temperature3 = unknown;  ///< [degC] Temperature of this sensor. Not known if the sensor does not exist.
  static constexpr SignalLayout temperature4_layout = {48, 12, false, 0.1F, 60.0F, -60.0F, 349.4F, true, 4095};
  float temperature4 = unknown;  ///< [degC] Temperature of this sensor. Not known if the sensor does not exist.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<temperature1_layout>(out, temperature1);
    put<temperature2_layout>(out, temperature2);
    put<temperature3_layout>(out, temperature3);
    put<temperature4_layout>(out, temperature4);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr Temperatures of(const can::Frame& frame) {
    Temperatures out;
    out.temperature1 = get<temperature1_layout, decltype(out.temperature1)>(frame);
    out.temperature2 = get<temperature2_layout, decltype(out.temperature2)>(frame);
    out.temperature3 = get<temperature3_layout, decltype(out.temperature3)>(frame);
    out.temperature4 = get<temperature4_layout, decltype(out.temperature4)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("Temperature1", "degC", temperature1, temperature1_layout);
    see("Temperature2", "degC", temperature2, temperature2_layout);
    see("Temperature3", "degC", temperature3, temperature3_layout);
    see("Temperature4", "degC", temperature4, temperature4_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("Temperature1", "Temperature of this sensor. Not known if the sensor does not exist.", std::span<const ValueName>());
    see("Temperature2", "Temperature of this sensor. Not known if the sensor does not exist.", std::span<const ValueName>());
    see("Temperature3", "Temperature of this sensor. Not known if the sensor does not exist.", std::span<const ValueName>());
    see("Temperature4", "Temperature of this sensor. Not known if the sensor does not exist.", std::span<const ValueName>());
  }
};

/// With SampleVoltage and SampleTime: the estimator's input, bit for bit. A recording of them replays to the same estimates. Sent with every sample while the log of samples is on.
struct SampleCurrent {
  static constexpr const char* name = "SampleCurrent";
  static constexpr std::uint16_t id = 0x199;
  static constexpr std::uint32_t cycle_us = 0;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 409;
  static constexpr SignalLayout current_ua_layout = {12, 32, true, 1.0F, 0.0F, -2147483648.0F, 2147483647.0F, false, 0};
  std::int32_t current_ua = 0;  ///< [uA] Mean since the previous sample, positive: charging. The lowest value: no reading.
  static constexpr SignalLayout sample_counter_layout = {44, 16, false, 1.0F, 0.0F, 0.0F, 65535.0F, false, 0};
  std::uint32_t sample_counter = 0;  ///< As in Status.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<current_ua_layout>(out, current_ua);
    put<sample_counter_layout>(out, sample_counter);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr SampleCurrent of(const can::Frame& frame) {
    SampleCurrent out;
    out.current_ua = get<current_ua_layout, decltype(out.current_ua)>(frame);
    out.sample_counter = get<sample_counter_layout, decltype(out.sample_counter)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("CurrentUa", "uA", current_ua, current_ua_layout);
    see("SampleCounter", "", sample_counter, sample_counter_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("CurrentUa", "Mean since the previous sample, positive: charging. The lowest value: no reading.", std::span<const ValueName>());
    see("SampleCounter", "As in Status.", std::span<const ValueName>());
  }
};

/// After SampleCurrent.
struct SampleVoltage {
  static constexpr const char* name = "SampleVoltage";
  static constexpr std::uint16_t id = 0x19a;
  static constexpr std::uint32_t cycle_us = 0;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 410;
  static constexpr SignalLayout voltage_uv_layout = {12, 32, true, 1.0F, 0.0F, -2147483648.0F, 2147483647.0F, false, 0};
  std::int32_t voltage_uv = 0;  ///< [uV] Cell voltage; of a pack, the mean of its cells. The lowest value: no reading.
  static constexpr SignalLayout temperature_cdegc_layout = {44, 16, true, 1.0F, 0.0F, -32768.0F, 32767.0F, false, 0};
  std::int32_t temperature_cdegc = 0;  ///< Temperature in 0.01 degrees C; of a pack, the mean of its sensors. The lowest value: no reading.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<voltage_uv_layout>(out, voltage_uv);
    put<temperature_cdegc_layout>(out, temperature_cdegc);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr SampleVoltage of(const can::Frame& frame) {
    SampleVoltage out;
    out.voltage_uv = get<voltage_uv_layout, decltype(out.voltage_uv)>(frame);
    out.temperature_cdegc = get<temperature_cdegc_layout, decltype(out.temperature_cdegc)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("VoltageUv", "uV", voltage_uv, voltage_uv_layout);
    see("TemperatureCdegc", "", temperature_cdegc, temperature_cdegc_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("VoltageUv", "Cell voltage; of a pack, the mean of its cells. The lowest value: no reading.", std::span<const ValueName>());
    see("TemperatureCdegc", "Temperature in 0.01 degrees C; of a pack, the mean of its sensors. The lowest value: no reading.", std::span<const ValueName>());
  }
};

/// After SampleVoltage. Completes the sample.
struct SampleTime {
  static constexpr const char* name = "SampleTime";
  static constexpr std::uint16_t id = 0x19b;
  static constexpr std::uint32_t cycle_us = 0;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 411;
  static constexpr SignalLayout time_low_layout = {12, 32, false, 1.0F, 0.0F, 0.0F, 4294967295.0F, false, 0};
  std::uint32_t time_low = 0;  ///< Microseconds since boot, low 32 bits.
  static constexpr SignalLayout time_high_layout = {44, 16, false, 1.0F, 0.0F, 0.0F, 65535.0F, false, 0};
  std::uint32_t time_high = 0;  ///< The next 16 bits.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<time_low_layout>(out, time_low);
    put<time_high_layout>(out, time_high);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr SampleTime of(const can::Frame& frame) {
    SampleTime out;
    out.time_low = get<time_low_layout, decltype(out.time_low)>(frame);
    out.time_high = get<time_high_layout, decltype(out.time_high)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("TimeLow", "", time_low, time_low_layout);
    see("TimeHigh", "", time_high, time_high_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("TimeLow", "Microseconds since boot, low 32 bits.", std::span<const ValueName>());
    see("TimeHigh", "The next 16 bits.", std::span<const ValueName>());
  }
};

/// Hash of the estimates, for comparison with a replay. Sent with every sample while the log of samples is on.
struct EstimateHash {
  static constexpr const char* name = "EstimateHash";
  static constexpr std::uint16_t id = 0x19c;
  static constexpr std::uint32_t cycle_us = 0;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 412;
  static constexpr SignalLayout hash_layout = {12, 32, false, 1.0F, 0.0F, 0.0F, 4294967295.0F, false, 0};
  std::uint32_t hash = 0;  ///< FNV-1a, 32 bits, over the words of all estimates since the start, low byte first.
  static constexpr SignalLayout sample_counter_layout = {44, 16, false, 1.0F, 0.0F, 0.0F, 65535.0F, false, 0};
  std::uint32_t sample_counter = 0;  ///< As in Status.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<hash_layout>(out, hash);
    put<sample_counter_layout>(out, sample_counter);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr EstimateHash of(const can::Frame& frame) {
    EstimateHash out;
    out.hash = get<hash_layout, decltype(out.hash)>(frame);
    out.sample_counter = get<sample_counter_layout, decltype(out.sample_counter)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("Hash", "", hash, hash_layout);
    see("SampleCounter", "", sample_counter, sample_counter_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("Hash", "FNV-1a, 32 bits, over the words of all estimates since the start, low byte first.", std::span<const ValueName>());
    see("SampleCounter", "As in Status.", std::span<const ValueName>());
  }
};

/// Starting point of the estimator. Sent before the first sample while the log of samples is on.
struct StartingSoc {
  static constexpr const char* name = "StartingSoc";
  static constexpr std::uint16_t id = 0x19d;
  static constexpr std::uint32_t cycle_us = 0;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 413;
  static constexpr SignalLayout soc_ppb_layout = {12, 32, true, 1.0F, 0.0F, -2147483648.0F, 2147483647.0F, false, 0};
  std::int32_t soc_ppb = 0;  ///< State of charge in units of 1e-9.
  static constexpr SignalLayout given_layout = {44, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t given = 0;  ///< Whether a starting point was given. If not, the first voltage determines it.
  static constexpr std::uint32_t given_no = 0;
  static constexpr std::uint32_t given_yes = 1;

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<soc_ppb_layout>(out, soc_ppb);
    put<given_layout>(out, given);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr StartingSoc of(const can::Frame& frame) {
    StartingSoc out;
    out.soc_ppb = get<soc_ppb_layout, decltype(out.soc_ppb)>(frame);
    out.given = get<given_layout, decltype(out.given)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("SocPpb", "", soc_ppb, soc_ppb_layout);
    see("Given", "", given, given_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("SocPpb", "State of charge in units of 1e-9.", std::span<const ValueName>());
    { static constexpr std::array<ValueName, 2> names{{ValueName{0, "no"}, ValueName{1, "yes"}}}; see("Given", "Whether a starting point was given. If not, the first voltage determines it.", std::span<const ValueName>(names)); }
  }
};

/// After StartingSoc.
struct StartingSigma {
  static constexpr const char* name = "StartingSigma";
  static constexpr std::uint16_t id = 0x19e;
  static constexpr std::uint32_t cycle_us = 0;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 414;
  static constexpr SignalLayout sigma_ppb_layout = {12, 32, true, 1.0F, 0.0F, -2147483648.0F, 2147483647.0F, false, 0};
  std::int32_t sigma_ppb = 0;  ///< Standard deviation in units of 1e-9.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<sigma_ppb_layout>(out, sigma_ppb);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr StartingSigma of(const can::Frame& frame) {
    StartingSigma out;
    out.sigma_ppb = get<sigma_ppb_layout, decltype(out.sigma_ppb)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("SigmaPpb", "", sigma_ppb, sigma_ppb_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("SigmaPpb", "Standard deviation in units of 1e-9.", std::span<const ValueName>());
  }
};

/// Command from the vehicle or a workshop. A frame with a wrong CRC or with the counter of the previous command is ignored.
struct Command {
  static constexpr const char* name = "Command";
  static constexpr std::uint16_t id = 0x1a0;
  static constexpr std::uint32_t cycle_us = 0;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 416;
  static constexpr SignalLayout code_layout = {12, 8, false, 1.0F, 0.0F, 0.0F, 255.0F, false, 0};
  std::uint32_t code = 0;  ///< Command code.
  static constexpr std::uint32_t code_clear_faults = 1;
  static constexpr std::uint32_t code_log_of_samples = 2;
  static constexpr std::uint32_t code_set_time = 3;
  static constexpr std::uint32_t code_request = 4;
  static constexpr std::uint32_t code_voltage_gain = 5;
  static constexpr std::uint32_t code_voltage_offset = 6;
  static constexpr std::uint32_t code_current_gain = 7;
  static constexpr std::uint32_t code_current_offset = 8;
  static constexpr std::uint32_t code_stored_data = 9;
  static constexpr std::uint32_t code_read_parameters = 10;
  static constexpr std::uint32_t code_set_parameter = 11;
  static constexpr std::uint32_t code_apply_parameters = 12;
  static constexpr std::uint32_t code_switch_off = 13;
  static constexpr SignalLayout argument_layout = {20, 32, false, 1.0F, 0.0F, 0.0F, 4294967295.0F, false, 0};
  std::uint32_t argument = 0;  ///< clear faults: 0, or 1 by a workshop; log of samples: 1 on, 0 off; set time: seconds since 1970-01-01 UTC; request: 0 none, 1 drive, 2 charge, to be repeated within 5 s; corrections of the measuring chain, signed: gains up to 50,000 ppm, offsets up to 100,000 uV and 5,000,000 uA (boards/porting.md); stored data: 0 for all of it, or the first of its 39 parts plus 256 times their number; one part is sent with each sample; read parameters: as stored data; set parameter: its value, signed, in the unit of its number; apply parameters: CRC-32 of all values; switch off: 0, for transport and storage; the battery switches itself off after 2 s with open contactors, and key or plug switch it on again.
  static constexpr SignalLayout parameter_layout = {52, 8, false, 1.0F, 0.0F, 0.0F, 255.0F, false, 0};
  std::uint32_t parameter = 0;  ///< Number of the parameter for set parameter (ParameterValue), 0 for a new set; otherwise 0.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<code_layout>(out, code);
    put<argument_layout>(out, argument);
    put<parameter_layout>(out, parameter);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr Command of(const can::Frame& frame) {
    Command out;
    out.code = get<code_layout, decltype(out.code)>(frame);
    out.argument = get<argument_layout, decltype(out.argument)>(frame);
    out.parameter = get<parameter_layout, decltype(out.parameter)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("Code", "", code, code_layout);
    see("Argument", "", argument, argument_layout);
    see("Parameter", "", parameter, parameter_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    { static constexpr std::array<ValueName, 13> names{{ValueName{1, "clear faults"}, ValueName{2, "log of samples"}, ValueName{3, "set time"}, ValueName{4, "request"}, ValueName{5, "voltage gain"}, ValueName{6, "voltage offset"}, ValueName{7, "current gain"}, ValueName{8, "current offset"}, ValueName{9, "stored data"}, ValueName{10, "read parameters"}, ValueName{11, "set parameter"}, ValueName{12, "apply parameters"}, ValueName{13, "switch off"}}}; see("Code", "Command code.", std::span<const ValueName>(names)); }
    see("Argument", "clear faults: 0, or 1 by a workshop; log of samples: 1 on, 0 off; set time: seconds since 1970-01-01 UTC; request: 0 none, 1 drive, 2 charge, to be repeated within 5 s; corrections of the measuring chain, signed: gains up to 50,000 ppm, offsets up to 100,000 uV and 5,000,000 uA (boards/porting.md); stored data: 0 for all of it, or the first of its 39 parts plus 256 times their number; one part is sent with each sample; read parameters: as stored data; set parameter: its value, signed, in the unit of its number; apply parameters: CRC-32 of all values; switch off: 0, for transport and storage; the battery switches itself off after 2 s with open contactors, and key or plug switch it on again.", std::span<const ValueName>());
    see("Parameter", "Number of the parameter for set parameter (ParameterValue), 0 for a new set; otherwise 0.", std::span<const ValueName>());
  }
};

/// Answer to every command that was received correctly.
struct CommandAnswer {
  static constexpr const char* name = "CommandAnswer";
  static constexpr std::uint16_t id = 0x1a1;
  static constexpr std::uint32_t cycle_us = 0;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 417;
  static constexpr SignalLayout code_layout = {12, 8, false, 1.0F, 0.0F, 0.0F, 255.0F, false, 0};
  std::uint32_t code = 0;  ///< Code of the command.
  static constexpr std::uint32_t code_clear_faults = 1;
  static constexpr std::uint32_t code_log_of_samples = 2;
  static constexpr std::uint32_t code_set_time = 3;
  static constexpr std::uint32_t code_request = 4;
  static constexpr std::uint32_t code_voltage_gain = 5;
  static constexpr std::uint32_t code_voltage_offset = 6;
  static constexpr std::uint32_t code_current_gain = 7;
  static constexpr std::uint32_t code_current_offset = 8;
  static constexpr std::uint32_t code_stored_data = 9;
  static constexpr std::uint32_t code_read_parameters = 10;
  static constexpr std::uint32_t code_set_parameter = 11;
  static constexpr std::uint32_t code_apply_parameters = 12;
  static constexpr std::uint32_t code_switch_off = 13;
  static constexpr SignalLayout result_layout = {20, 4, false, 1.0F, 0.0F, 0.0F, 15.0F, false, 0};
  std::uint32_t result = 0;  ///< Result of the command.
  static constexpr std::uint32_t result_done = 0;
  static constexpr std::uint32_t result_refused = 1;
  static constexpr std::uint32_t result_no_such_command = 2;
  static constexpr std::uint32_t result_not_authorised = 3;
  static constexpr SignalLayout command_counter_layout = {24, 4, false, 1.0F, 0.0F, 0.0F, 14.0F, false, 0};
  std::uint32_t command_counter = 0;  ///< Counter of the command.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<code_layout>(out, code);
    put<result_layout>(out, result);
    put<command_counter_layout>(out, command_counter);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr CommandAnswer of(const can::Frame& frame) {
    CommandAnswer out;
    out.code = get<code_layout, decltype(out.code)>(frame);
    out.result = get<result_layout, decltype(out.result)>(frame);
    out.command_counter = get<command_counter_layout, decltype(out.command_counter)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("Code", "", code, code_layout);
    see("Result", "", result, result_layout);
    see("CommandCounter", "", command_counter, command_counter_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    { static constexpr std::array<ValueName, 13> names{{ValueName{1, "clear faults"}, ValueName{2, "log of samples"}, ValueName{3, "set time"}, ValueName{4, "request"}, ValueName{5, "voltage gain"}, ValueName{6, "voltage offset"}, ValueName{7, "current gain"}, ValueName{8, "current offset"}, ValueName{9, "stored data"}, ValueName{10, "read parameters"}, ValueName{11, "set parameter"}, ValueName{12, "apply parameters"}, ValueName{13, "switch off"}}}; see("Code", "Code of the command.", std::span<const ValueName>(names)); }
    { static constexpr std::array<ValueName, 4> names{{ValueName{0, "done"}, ValueName{1, "refused"}, ValueName{2, "no such command"}, ValueName{3, "not authorised"}}}; see("Result", "Result of the command.", std::span<const ValueName>(names)); }
    see("CommandCounter", "Counter of the command.", std::span<const ValueName>());
  }
};

/// Faults of the pack, one bit each: firmware/protection/README.md. More of them: MoreFaults. Also sent at once when a fault begins or ends.
struct Faults {
  static constexpr const char* name = "Faults";
  static constexpr std::uint16_t id = 0x196;
  static constexpr std::uint32_t cycle_us = 100000;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 406;
  static constexpr SignalLayout cell_overvoltage_warning_layout = {16, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t cell_overvoltage_warning = 0;  ///< A cell is near its upper voltage limit: currents are halved.
  static constexpr SignalLayout cell_overvoltage_layout = {17, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t cell_overvoltage = 0;  ///< A cell is above its upper voltage limit: no charging.
  static constexpr SignalLayout cell_overvoltage_severe_layout = {18, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t cell_overvoltage_severe = 0;  ///< A cell is far above its upper voltage limit: contactors opened at once.
  static constexpr SignalLayout cell_undervoltage_warning_layout = {19, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t cell_undervoltage_warning = 0;  ///< A cell is near its lower voltage limit: currents are halved.
  static constexpr SignalLayout cell_undervoltage_layout = {20, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t cell_undervoltage = 0;  ///< A cell is below its lower voltage limit: no discharging.
  static constexpr SignalLayout cell_undervoltage_severe_layout = {21, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t cell_undervoltage_severe = 0;  ///< A cell is far below its lower voltage limit: contactors opened at once.
  static constexpr SignalLayout pack_overvoltage_layout = {22, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t pack_overvoltage = 0;  ///< The pack voltage, measured separately, is above its upper limit.
  static constexpr SignalLayout pack_undervoltage_layout = {23, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t pack_undervoltage = 0;  ///< The pack voltage, measured separately, is below its lower limit.
  static constexpr SignalLayout charge_overcurrent_layout = {24, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t charge_overcurrent = 0;  ///< The charging current was too high for too long.
  static constexpr SignalLayout discharge_overcurrent_layout = {25, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t discharge_overcurrent = 0;  ///< The discharging current was too high for too long.
  static constexpr SignalLayout short_circuit_layout = {26, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t short_circuit = 0;  ///< The current is as high as in a short circuit.
  static constexpr SignalLayout overtemperature_warning_layout = {27, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t overtemperature_warning = 0;  ///< A cell is near its highest temperature: currents are halved.
  static constexpr SignalLayout overtemperature_layout = {28, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t overtemperature = 0;  ///< A cell is above its highest temperature.
  static constexpr SignalLayout charge_overtemperature_layout = {29, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t charge_overtemperature = 0;  ///< A cell is too warm for charging.
  static constexpr SignalLayout undertemperature_layout = {30, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t undertemperature = 0;  ///< A cell is below its lowest temperature: no discharging.
  static constexpr SignalLayout charge_undertemperature_layout = {31, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t charge_undertemperature = 0;  ///< A cell is too cold for charging: lithium plating.
  static constexpr SignalLayout open_wire_layout = {32, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t open_wire = 0;  ///< A sense wire is broken: two neighbouring readings shifted in opposite directions.
  static constexpr SignalLayout imbalance_layout = {33, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t imbalance = 0;  ///< The cell voltages differ too much.
  static constexpr SignalLayout current_implausible_layout = {34, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t current_implausible = 0;  ///< The current reading has contradicted the model for a minute.
  static constexpr SignalLayout sum_mismatch_layout = {35, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t sum_mismatch = 0;  ///< The sum of the cell voltages differs from the pack voltage.
  static constexpr SignalLayout voltage_missing_layout = {36, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t voltage_missing = 0;  ///< A cell voltage is not measured.
  static constexpr SignalLayout voltage_stuck_layout = {37, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t voltage_stuck = 0;  ///< The reading of a cell does not change while the others do.
  static constexpr SignalLayout current_missing_layout = {38, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t current_missing = 0;  ///< The current is not measured.
  static constexpr SignalLayout temperature_lost_layout = {39, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t temperature_lost = 0;  ///< A temperature sensor gives no reading.
  static constexpr SignalLayout temperature_stuck_layout = {40, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t temperature_stuck = 0;  ///< The reading of a temperature sensor does not change while the others do.
  static constexpr SignalLayout deep_discharge_layout = {41, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t deep_discharge = 0;  ///< A cell has been discharged too deeply to be charged again: inspect or replace it.
  static constexpr SignalLayout precharge_failed_layout = {42, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t precharge_failed = 0;  ///< The DC-link voltage did not rise as expected.
  static constexpr SignalLayout contactor_welded_layout = {43, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t contactor_welded = 0;  ///< A contactor does not open.
  static constexpr SignalLayout contactor_not_closed_layout = {44, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t contactor_not_closed = 0;  ///< A contactor does not close.
  static constexpr SignalLayout samples_missing_layout = {45, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t samples_missing = 0;  ///< No samples arrive.
  static constexpr SignalLayout internal_fault_layout = {46, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t internal_fault = 0;  ///< The firmware found an internal error, or the watchdog reset it.
  static constexpr SignalLayout storage_fault_layout = {47, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t storage_fault = 0;  ///< Records cannot be stored.
  static constexpr SignalLayout first_cause_layout = {48, 6, false, 1.0F, 0.0F, 0.0F, 50.0F, true, 63};
  std::uint32_t first_cause = 0;  ///< First fault since the last clear: number of its bit in the table plus 1; from 33 on a fault of MoreFaults.
  static constexpr std::uint32_t first_cause_none = 0;
  static constexpr std::uint32_t first_cause_cell_overvoltage_warning = 1;
  static constexpr std::uint32_t first_cause_cell_overvoltage = 2;
  static constexpr std::uint32_t first_cause_cell_overvoltage_severe = 3;
  static constexpr std::uint32_t first_cause_cell_undervoltage_warning = 4;
  static constexpr std::uint32_t first_cause_cell_undervoltage = 5;
  static constexpr std::uint32_t first_cause_cell_undervoltage_severe = 6;
  static constexpr std::uint32_t first_cause_pack_overvoltage = 7;
  static constexpr std::uint32_t first_cause_pack_undervoltage = 8;
  static constexpr std::uint32_t first_cause_charge_overcurrent = 9;
  static constexpr std::uint32_t first_cause_discharge_overcurrent = 10;
  static constexpr std::uint32_t first_cause_short_circuit = 11;
  static constexpr std::uint32_t first_cause_overtemperature_warning = 12;
  static constexpr std::uint32_t first_cause_overtemperature = 13;
  static constexpr std::uint32_t first_cause_charge_overtemperature = 14;
  static constexpr std::uint32_t first_cause_undertemperature = 15;
  static constexpr std::uint32_t first_cause_charge_undertemperature = 16;
  static constexpr std::uint32_t first_cause_open_wire = 17;
  static constexpr std::uint32_t first_cause_imbalance = 18;
  static constexpr std::uint32_t first_cause_current_implausible = 19;
  static constexpr std::uint32_t first_cause_sum_mismatch = 20;
  static constexpr std::uint32_t first_cause_voltage_missing = 21;
  static constexpr std::uint32_t first_cause_voltage_stuck = 22;
  static constexpr std::uint32_t first_cause_current_missing = 23;
  static constexpr std::uint32_t first_cause_temperature_lost = 24;
  static constexpr std::uint32_t first_cause_temperature_stuck = 25;
  static constexpr std::uint32_t first_cause_deep_discharge = 26;
  static constexpr std::uint32_t first_cause_precharge_failed = 27;
  static constexpr std::uint32_t first_cause_contactor_welded = 28;
  static constexpr std::uint32_t first_cause_contactor_not_closed = 29;
  static constexpr std::uint32_t first_cause_samples_missing = 30;
  static constexpr std::uint32_t first_cause_internal_fault = 31;
  static constexpr std::uint32_t first_cause_storage_fault = 32;
  static constexpr std::uint32_t first_cause_second_line_tripped = 33;
  static constexpr std::uint32_t first_cause_second_line_failed = 34;
  static constexpr std::uint32_t first_cause_current_sensors_differ = 35;
  static constexpr std::uint32_t first_cause_temperature_unknown = 36;
  static constexpr std::uint32_t first_cause_current_unrequested = 37;
  static constexpr std::uint32_t first_cause_allowed_current_exceeded = 38;
  static constexpr std::uint32_t first_cause_charge_limit_exceeded = 39;
  static constexpr std::uint32_t first_cause_discharge_limit_exceeded = 40;
  static constexpr std::uint32_t first_cause_limit_not_obeyed = 41;
  static constexpr std::uint32_t first_cause_supply_dip = 42;
  static constexpr std::uint32_t first_cause_thermistor_shorted = 43;
  static constexpr std::uint32_t first_cause_second_current_missing = 44;
  static constexpr std::uint32_t first_cause_interlock_open = 45;
  static constexpr std::uint32_t first_cause_crash = 46;
  static constexpr std::uint32_t first_cause_insulation_low = 47;
  static constexpr std::uint32_t first_cause_insulation_unknown = 48;
  static constexpr std::uint32_t first_cause_front_end_hot = 49;
  static constexpr std::uint32_t first_cause_group_incomplete = 50;
  static constexpr std::uint32_t first_cause_not_known = 63;

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<cell_overvoltage_warning_layout>(out, cell_overvoltage_warning);
    put<cell_overvoltage_layout>(out, cell_overvoltage);
    put<cell_overvoltage_severe_layout>(out, cell_overvoltage_severe);
    put<cell_undervoltage_warning_layout>(out, cell_undervoltage_warning);
    put<cell_undervoltage_layout>(out, cell_undervoltage);
    put<cell_undervoltage_severe_layout>(out, cell_undervoltage_severe);
    put<pack_overvoltage_layout>(out, pack_overvoltage);
    put<pack_undervoltage_layout>(out, pack_undervoltage);
    put<charge_overcurrent_layout>(out, charge_overcurrent);
    put<discharge_overcurrent_layout>(out, discharge_overcurrent);
    put<short_circuit_layout>(out, short_circuit);
    put<overtemperature_warning_layout>(out, overtemperature_warning);
    put<overtemperature_layout>(out, overtemperature);
    put<charge_overtemperature_layout>(out, charge_overtemperature);
    put<undertemperature_layout>(out, undertemperature);
    put<charge_undertemperature_layout>(out, charge_undertemperature);
    put<open_wire_layout>(out, open_wire);
    put<imbalance_layout>(out, imbalance);
    put<current_implausible_layout>(out, current_implausible);
    put<sum_mismatch_layout>(out, sum_mismatch);
    put<voltage_missing_layout>(out, voltage_missing);
    put<voltage_stuck_layout>(out, voltage_stuck);
    put<current_missing_layout>(out, current_missing);
    put<temperature_lost_layout>(out, temperature_lost);
    put<temperature_stuck_layout>(out, temperature_stuck);
    put<deep_discharge_layout>(out, deep_discharge);
    put<precharge_failed_layout>(out, precharge_failed);
    put<contactor_welded_layout>(out, contactor_welded);
    put<contactor_not_closed_layout>(out, contactor_not_closed);
    put<samples_missing_layout>(out, samples_missing);
    put<internal_fault_layout>(out, internal_fault);
    put<storage_fault_layout>(out, storage_fault);
    put<first_cause_layout>(out, first_cause);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr Faults of(const can::Frame& frame) {
    Faults out;
    out.cell_overvoltage_warning = get<cell_overvoltage_warning_layout, decltype(out.cell_overvoltage_warning)>(frame);
    out.cell_overvoltage = get<cell_overvoltage_layout, decltype(out.cell_overvoltage)>(frame);
    out.cell_overvoltage_severe = get<cell_overvoltage_severe_layout, decltype(out.cell_overvoltage_severe)>(frame);
    out.cell_undervoltage_warning = get<cell_undervoltage_warning_layout, decltype(out.cell_undervoltage_warning)>(frame);
    out.cell_undervoltage = get<cell_undervoltage_layout, decltype(out.cell_undervoltage)>(frame);
    out.cell_undervoltage_severe = get<cell_undervoltage_severe_layout, decltype(out.cell_undervoltage_severe)>(frame);
    out.pack_overvoltage = get<pack_overvoltage_layout, decltype(out.pack_overvoltage)>(frame);
    out.pack_undervoltage = get<pack_undervoltage_layout, decltype(out.pack_undervoltage)>(frame);
    out.charge_overcurrent = get<charge_overcurrent_layout, decltype(out.charge_overcurrent)>(frame);
    out.discharge_overcurrent = get<discharge_overcurrent_layout, decltype(out.discharge_overcurrent)>(frame);
    out.short_circuit = get<short_circuit_layout, decltype(out.short_circuit)>(frame);
    out.overtemperature_warning = get<overtemperature_warning_layout, decltype(out.overtemperature_warning)>(frame);
    out.overtemperature = get<overtemperature_layout, decltype(out.overtemperature)>(frame);
    out.charge_overtemperature = get<charge_overtemperature_layout, decltype(out.charge_overtemperature)>(frame);
    out.undertemperature = get<undertemperature_layout, decltype(out.undertemperature)>(frame);
    out.charge_undertemperature = get<charge_undertemperature_layout, decltype(out.charge_undertemperature)>(frame);
    out.open_wire = get<open_wire_layout, decltype(out.open_wire)>(frame);
    out.imbalance = get<imbalance_layout, decltype(out.imbalance)>(frame);
    out.current_implausible = get<current_implausible_layout, decltype(out.current_implausible)>(frame);
    out.sum_mismatch = get<sum_mismatch_layout, decltype(out.sum_mismatch)>(frame);
    out.voltage_missing = get<voltage_missing_layout, decltype(out.voltage_missing)>(frame);
    out.voltage_stuck = get<voltage_stuck_layout, decltype(out.voltage_stuck)>(frame);
    out.current_missing = get<current_missing_layout, decltype(out.current_missing)>(frame);
    out.temperature_lost = get<temperature_lost_layout, decltype(out.temperature_lost)>(frame);
    out.temperature_stuck = get<temperature_stuck_layout, decltype(out.temperature_stuck)>(frame);
    out.deep_discharge = get<deep_discharge_layout, decltype(out.deep_discharge)>(frame);
    out.precharge_failed = get<precharge_failed_layout, decltype(out.precharge_failed)>(frame);
    out.contactor_welded = get<contactor_welded_layout, decltype(out.contactor_welded)>(frame);
    out.contactor_not_closed = get<contactor_not_closed_layout, decltype(out.contactor_not_closed)>(frame);
    out.samples_missing = get<samples_missing_layout, decltype(out.samples_missing)>(frame);
    out.internal_fault = get<internal_fault_layout, decltype(out.internal_fault)>(frame);
    out.storage_fault = get<storage_fault_layout, decltype(out.storage_fault)>(frame);
    out.first_cause = get<first_cause_layout, decltype(out.first_cause)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("CellOvervoltageWarning", "", cell_overvoltage_warning, cell_overvoltage_warning_layout);
    see("CellOvervoltage", "", cell_overvoltage, cell_overvoltage_layout);
    see("CellOvervoltageSevere", "", cell_overvoltage_severe, cell_overvoltage_severe_layout);
    see("CellUndervoltageWarning", "", cell_undervoltage_warning, cell_undervoltage_warning_layout);
    see("CellUndervoltage", "", cell_undervoltage, cell_undervoltage_layout);
    see("CellUndervoltageSevere", "", cell_undervoltage_severe, cell_undervoltage_severe_layout);
    see("PackOvervoltage", "", pack_overvoltage, pack_overvoltage_layout);
    see("PackUndervoltage", "", pack_undervoltage, pack_undervoltage_layout);
    see("ChargeOvercurrent", "", charge_overcurrent, charge_overcurrent_layout);
    see("DischargeOvercurrent", "", discharge_overcurrent, discharge_overcurrent_layout);
    see("ShortCircuit", "", short_circuit, short_circuit_layout);
    see("OvertemperatureWarning", "", overtemperature_warning, overtemperature_warning_layout);
    see("Overtemperature", "", overtemperature, overtemperature_layout);
    see("ChargeOvertemperature", "", charge_overtemperature, charge_overtemperature_layout);
    see("Undertemperature", "", undertemperature, undertemperature_layout);
    see("ChargeUndertemperature", "", charge_undertemperature, charge_undertemperature_layout);
    see("OpenWire", "", open_wire, open_wire_layout);
    see("Imbalance", "", imbalance, imbalance_layout);
    see("CurrentImplausible", "", current_implausible, current_implausible_layout);
    see("SumMismatch", "", sum_mismatch, sum_mismatch_layout);
    see("VoltageMissing", "", voltage_missing, voltage_missing_layout);
    see("VoltageStuck", "", voltage_stuck, voltage_stuck_layout);
    see("CurrentMissing", "", current_missing, current_missing_layout);
    see("TemperatureLost", "", temperature_lost, temperature_lost_layout);
    see("TemperatureStuck", "", temperature_stuck, temperature_stuck_layout);
    see("DeepDischarge", "", deep_discharge, deep_discharge_layout);
    see("PrechargeFailed", "", precharge_failed, precharge_failed_layout);
    see("ContactorWelded", "", contactor_welded, contactor_welded_layout);
    see("ContactorNotClosed", "", contactor_not_closed, contactor_not_closed_layout);
    see("SamplesMissing", "", samples_missing, samples_missing_layout);
    see("InternalFault", "", internal_fault, internal_fault_layout);
    see("StorageFault", "", storage_fault, storage_fault_layout);
    see("FirstCause", "", first_cause, first_cause_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("CellOvervoltageWarning", "A cell is near its upper voltage limit: currents are halved.", std::span<const ValueName>());
    see("CellOvervoltage", "A cell is above its upper voltage limit: no charging.", std::span<const ValueName>());
    see("CellOvervoltageSevere", "A cell is far above its upper voltage limit: contactors opened at once.", std::span<const ValueName>());
    see("CellUndervoltageWarning", "A cell is near its lower voltage limit: currents are halved.", std::span<const ValueName>());
    see("CellUndervoltage", "A cell is below its lower voltage limit: no discharging.", std::span<const ValueName>());
    see("CellUndervoltageSevere", "A cell is far below its lower voltage limit: contactors opened at once.", std::span<const ValueName>());
    see("PackOvervoltage", "The pack voltage, measured separately, is above its upper limit.", std::span<const ValueName>());
    see("PackUndervoltage", "The pack voltage, measured separately, is below its lower limit.", std::span<const ValueName>());
    see("ChargeOvercurrent", "The charging current was too high for too long.", std::span<const ValueName>());
    see("DischargeOvercurrent", "The discharging current was too high for too long.", std::span<const ValueName>());
    see("ShortCircuit", "The current is as high as in a short circuit.", std::span<const ValueName>());
    see("OvertemperatureWarning", "A cell is near its highest temperature: currents are halved.", std::span<const ValueName>());
    see("Overtemperature", "A cell is above its highest temperature.", std::span<const ValueName>());
    see("ChargeOvertemperature", "A cell is too warm for charging.", std::span<const ValueName>());
    see("Undertemperature", "A cell is below its lowest temperature: no discharging.", std::span<const ValueName>());
    see("ChargeUndertemperature", "A cell is too cold for charging: lithium plating.", std::span<const ValueName>());
    see("OpenWire", "A sense wire is broken: two neighbouring readings shifted in opposite directions.", std::span<const ValueName>());
    see("Imbalance", "The cell voltages differ too much.", std::span<const ValueName>());
    see("CurrentImplausible", "The current reading has contradicted the model for a minute.", std::span<const ValueName>());
    see("SumMismatch", "The sum of the cell voltages differs from the pack voltage.", std::span<const ValueName>());
    see("VoltageMissing", "A cell voltage is not measured.", std::span<const ValueName>());
    see("VoltageStuck", "The reading of a cell does not change while the others do.", std::span<const ValueName>());
    see("CurrentMissing", "The current is not measured.", std::span<const ValueName>());
    see("TemperatureLost", "A temperature sensor gives no reading.", std::span<const ValueName>());
    see("TemperatureStuck", "The reading of a temperature sensor does not change while the others do.", std::span<const ValueName>());
    see("DeepDischarge", "A cell has been discharged too deeply to be charged again: inspect or replace it.", std::span<const ValueName>());
    see("PrechargeFailed", "The DC-link voltage did not rise as expected.", std::span<const ValueName>());
    see("ContactorWelded", "A contactor does not open.", std::span<const ValueName>());
    see("ContactorNotClosed", "A contactor does not close.", std::span<const ValueName>());
    see("SamplesMissing", "No samples arrive.", std::span<const ValueName>());
    see("InternalFault", "The firmware found an internal error, or the watchdog reset it.", std::span<const ValueName>());
    see("StorageFault", "Records cannot be stored.", std::span<const ValueName>());
    { static constexpr std::array<ValueName, 52> names{{ValueName{0, "none"}, ValueName{1, "cell overvoltage warning"}, ValueName{2, "cell overvoltage"}, ValueName{3, "cell overvoltage severe"}, ValueName{4, "cell undervoltage warning"}, ValueName{5, "cell undervoltage"}, ValueName{6, "cell undervoltage severe"}, ValueName{7, "pack overvoltage"}, ValueName{8, "pack undervoltage"}, ValueName{9, "charge overcurrent"}, ValueName{10, "discharge overcurrent"}, ValueName{11, "short circuit"}, ValueName{12, "overtemperature warning"}, ValueName{13, "overtemperature"}, ValueName{14, "charge overtemperature"}, ValueName{15, "undertemperature"}, ValueName{16, "charge undertemperature"}, ValueName{17, "open wire"}, ValueName{18, "imbalance"}, ValueName{19, "current implausible"}, ValueName{20, "sum mismatch"}, ValueName{21, "voltage missing"}, ValueName{22, "voltage stuck"}, ValueName{23, "current missing"}, ValueName{24, "temperature lost"}, ValueName{25, "temperature stuck"}, ValueName{26, "deep discharge"}, ValueName{27, "precharge failed"}, ValueName{28, "contactor welded"}, ValueName{29, "contactor not closed"}, ValueName{30, "samples missing"}, ValueName{31, "internal fault"}, ValueName{32, "storage fault"}, ValueName{33, "second line tripped"}, ValueName{34, "second line failed"}, ValueName{35, "current sensors differ"}, ValueName{36, "temperature unknown"}, ValueName{37, "current unrequested"}, ValueName{38, "allowed current exceeded"}, ValueName{39, "charge limit exceeded"}, ValueName{40, "discharge limit exceeded"}, ValueName{41, "limit not obeyed"}, ValueName{42, "supply dip"}, ValueName{43, "thermistor shorted"}, ValueName{44, "second current missing"}, ValueName{45, "interlock open"}, ValueName{46, "crash"}, ValueName{47, "insulation low"}, ValueName{48, "insulation unknown"}, ValueName{49, "front end hot"}, ValueName{50, "group incomplete"}, ValueName{63, "not known"}}}; see("FirstCause", "First fault since the last clear: number of its bit in the table plus 1; from 33 on a fault of MoreFaults.", std::span<const ValueName>(names)); }
  }
};

/// Faults from bit 32 of the table on: firmware/protection/README.md. Also sent at once when a fault begins or ends.
struct MoreFaults {
  static constexpr const char* name = "MoreFaults";
  static constexpr std::uint16_t id = 0x1a2;
  static constexpr std::uint32_t cycle_us = 100000;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 418;
  static constexpr SignalLayout second_line_tripped_layout = {16, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t second_line_tripped = 0;  ///< A protection of the measuring chip has opened, other than for a short circuit: Faults.ShortCircuit.
  static constexpr SignalLayout second_line_failed_layout = {17, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t second_line_failed = 0;  ///< The measuring chip reports a permanent failure, or its enable signals do not follow.
  static constexpr SignalLayout current_sensors_differ_layout = {18, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t current_sensors_differ = 0;  ///< The second current sensor contradicts the first.
  static constexpr SignalLayout temperature_unknown_layout = {19, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t temperature_unknown = 0;  ///< No temperature sensor has given a reading for a minute.
  static constexpr SignalLayout current_unrequested_layout = {20, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t current_unrequested = 0;  ///< A current has flowed for a minute after the request has ended.
  static constexpr SignalLayout allowed_current_exceeded_layout = {21, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t allowed_current_exceeded = 0;  ///< The current has been above AllowedCurrent for ten seconds.
  static constexpr SignalLayout charge_limit_exceeded_layout = {22, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t charge_limit_exceeded = 0;  ///< A tenth of a percent of the capacity was charged above AllowedCurrent: charging is forbidden.
  static constexpr SignalLayout discharge_limit_exceeded_layout = {23, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t discharge_limit_exceeded = 0;  ///< A tenth of a percent of the capacity was discharged above AllowedCurrent: discharging is forbidden.
  static constexpr SignalLayout limit_not_obeyed_layout = {24, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t limit_not_obeyed = 0;  ///< The charge above AllowedCurrent has reached 0.3 % of the capacity: the contactors have opened.
  static constexpr SignalLayout supply_dip_layout = {25, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t supply_dip = 0;  ///< The supply of the controller has fallen, perhaps only for a moment: the contactors have opened.
  static constexpr SignalLayout thermistor_shorted_layout = {26, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t thermistor_shorted = 0;  ///< A thermistor is shorted. The measuring chip takes it for a hot cell and opens, so the firmware opens before, in an orderly way.
  static constexpr SignalLayout second_current_missing_layout = {27, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t second_current_missing = 0;  ///< The second current sensor is fitted and gives no reading.
  static constexpr SignalLayout interlock_open_layout = {28, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t interlock_open = 0;  ///< The loop through the power connectors is open.
  static constexpr SignalLayout crash_layout = {29, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t crash = 0;  ///< The crash or tilt sensor has opened the contactors. Only a workshop clears it.
  static constexpr SignalLayout insulation_low_layout = {30, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t insulation_low = 0;  ///< The resistance between battery and frame is below 100 ohm per volt: charging is forbidden.
  static constexpr SignalLayout insulation_unknown_layout = {31, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t insulation_unknown = 0;  ///< The insulation monitor has given no value for a minute.
  static constexpr SignalLayout front_end_hot_layout = {32, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t front_end_hot = 0;  ///< The die of the measuring chip is above 95 degC. At 110 degC the chip would shut down and open under load, so the firmware opens before.
  static constexpr SignalLayout group_incomplete_layout = {33, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t group_incomplete = 0;  ///< Nothing has arrived from a battery of the group at one DC link for a second, or no group is set: nothing closes (firmware/parallel/README.md). Only of an image for one of several batteries.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<second_line_tripped_layout>(out, second_line_tripped);
    put<second_line_failed_layout>(out, second_line_failed);
    put<current_sensors_differ_layout>(out, current_sensors_differ);
    put<temperature_unknown_layout>(out, temperature_unknown);
    put<current_unrequested_layout>(out, current_unrequested);
    put<allowed_current_exceeded_layout>(out, allowed_current_exceeded);
    put<charge_limit_exceeded_layout>(out, charge_limit_exceeded);
    put<discharge_limit_exceeded_layout>(out, discharge_limit_exceeded);
    put<limit_not_obeyed_layout>(out, limit_not_obeyed);
    put<supply_dip_layout>(out, supply_dip);
    put<thermistor_shorted_layout>(out, thermistor_shorted);
    put<second_current_missing_layout>(out, second_current_missing);
    put<interlock_open_layout>(out, interlock_open);
    put<crash_layout>(out, crash);
    put<insulation_low_layout>(out, insulation_low);
    put<insulation_unknown_layout>(out, insulation_unknown);
    put<front_end_hot_layout>(out, front_end_hot);
    put<group_incomplete_layout>(out, group_incomplete);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr MoreFaults of(const can::Frame& frame) {
    MoreFaults out;
    out.second_line_tripped = get<second_line_tripped_layout, decltype(out.second_line_tripped)>(frame);
    out.second_line_failed = get<second_line_failed_layout, decltype(out.second_line_failed)>(frame);
    out.current_sensors_differ = get<current_sensors_differ_layout, decltype(out.current_sensors_differ)>(frame);
    out.temperature_unknown = get<temperature_unknown_layout, decltype(out.temperature_unknown)>(frame);
    out.current_unrequested = get<current_unrequested_layout, decltype(out.current_unrequested)>(frame);
    out.allowed_current_exceeded = get<allowed_current_exceeded_layout, decltype(out.allowed_current_exceeded)>(frame);
    out.charge_limit_exceeded = get<charge_limit_exceeded_layout, decltype(out.charge_limit_exceeded)>(frame);
    out.discharge_limit_exceeded = get<discharge_limit_exceeded_layout, decltype(out.discharge_limit_exceeded)>(frame);
    out.limit_not_obeyed = get<limit_not_obeyed_layout, decltype(out.limit_not_obeyed)>(frame);
    out.supply_dip = get<supply_dip_layout, decltype(out.supply_dip)>(frame);
    out.thermistor_shorted = get<thermistor_shorted_layout, decltype(out.thermistor_shorted)>(frame);
    out.second_current_missing = get<second_current_missing_layout, decltype(out.second_current_missing)>(frame);
    out.interlock_open = get<interlock_open_layout, decltype(out.interlock_open)>(frame);
    out.crash = get<crash_layout, decltype(out.crash)>(frame);
    out.insulation_low = get<insulation_low_layout, decltype(out.insulation_low)>(frame);
    out.insulation_unknown = get<insulation_unknown_layout, decltype(out.insulation_unknown)>(frame);
    out.front_end_hot = get<front_end_hot_layout, decltype(out.front_end_hot)>(frame);
    out.group_incomplete = get<group_incomplete_layout, decltype(out.group_incomplete)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("SecondLineTripped", "", second_line_tripped, second_line_tripped_layout);
    see("SecondLineFailed", "", second_line_failed, second_line_failed_layout);
    see("CurrentSensorsDiffer", "", current_sensors_differ, current_sensors_differ_layout);
    see("TemperatureUnknown", "", temperature_unknown, temperature_unknown_layout);
    see("CurrentUnrequested", "", current_unrequested, current_unrequested_layout);
    see("AllowedCurrentExceeded", "", allowed_current_exceeded, allowed_current_exceeded_layout);
    see("ChargeLimitExceeded", "", charge_limit_exceeded, charge_limit_exceeded_layout);
    see("DischargeLimitExceeded", "", discharge_limit_exceeded, discharge_limit_exceeded_layout);
    see("LimitNotObeyed", "", limit_not_obeyed, limit_not_obeyed_layout);
    see("SupplyDip", "", supply_dip, supply_dip_layout);
    see("ThermistorShorted", "", thermistor_shorted, thermistor_shorted_layout);
    see("SecondCurrentMissing", "", second_current_missing, second_current_missing_layout);
    see("InterlockOpen", "", interlock_open, interlock_open_layout);
    see("Crash", "", crash, crash_layout);
    see("InsulationLow", "", insulation_low, insulation_low_layout);
    see("InsulationUnknown", "", insulation_unknown, insulation_unknown_layout);
    see("FrontEndHot", "", front_end_hot, front_end_hot_layout);
    see("GroupIncomplete", "", group_incomplete, group_incomplete_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("SecondLineTripped", "A protection of the measuring chip has opened, other than for a short circuit: Faults.ShortCircuit.", std::span<const ValueName>());
    see("SecondLineFailed", "The measuring chip reports a permanent failure, or its enable signals do not follow.", std::span<const ValueName>());
    see("CurrentSensorsDiffer", "The second current sensor contradicts the first.", std::span<const ValueName>());
    see("TemperatureUnknown", "No temperature sensor has given a reading for a minute.", std::span<const ValueName>());
    see("CurrentUnrequested", "A current has flowed for a minute after the request has ended.", std::span<const ValueName>());
    see("AllowedCurrentExceeded", "The current has been above AllowedCurrent for ten seconds.", std::span<const ValueName>());
    see("ChargeLimitExceeded", "A tenth of a percent of the capacity was charged above AllowedCurrent: charging is forbidden.", std::span<const ValueName>());
    see("DischargeLimitExceeded", "A tenth of a percent of the capacity was discharged above AllowedCurrent: discharging is forbidden.", std::span<const ValueName>());
    see("LimitNotObeyed", "The charge above AllowedCurrent has reached 0.3 % of the capacity: the contactors have opened.", std::span<const ValueName>());
    see("SupplyDip", "The supply of the controller has fallen, perhaps only for a moment: the contactors have opened.", std::span<const ValueName>());
    see("ThermistorShorted", "A thermistor is shorted. The measuring chip takes it for a hot cell and opens, so the firmware opens before, in an orderly way.", std::span<const ValueName>());
    see("SecondCurrentMissing", "The second current sensor is fitted and gives no reading.", std::span<const ValueName>());
    see("InterlockOpen", "The loop through the power connectors is open.", std::span<const ValueName>());
    see("Crash", "The crash or tilt sensor has opened the contactors. Only a workshop clears it.", std::span<const ValueName>());
    see("InsulationLow", "The resistance between battery and frame is below 100 ohm per volt: charging is forbidden.", std::span<const ValueName>());
    see("InsulationUnknown", "The insulation monitor has given no value for a minute.", std::span<const ValueName>());
    see("FrontEndHot", "The die of the measuring chip is above 95 degC. At 110 degC the chip would shut down and open under load, so the firmware opens before.", std::span<const ValueName>());
    see("GroupIncomplete", "Nothing has arrived from a battery of the group at one DC link for a second, or no group is set: nothing closes (firmware/parallel/README.md). Only of an image for one of several batteries.", std::span<const ValueName>());
  }
};

/// State of the contactors and its cause. Also sent at once when it changes.
struct ContactorState {
  static constexpr const char* name = "ContactorState";
  static constexpr std::uint16_t id = 0x197;
  static constexpr std::uint32_t cycle_us = 100000;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 407;
  static constexpr SignalLayout state_layout = {12, 4, false, 1.0F, 0.0F, 0.0F, 7.0F, true, 15};
  std::uint32_t state = 0;  ///< State of the contactor control.
  static constexpr std::uint32_t state_off = 0;
  static constexpr std::uint32_t state_self_test = 1;
  static constexpr std::uint32_t state_precharge = 2;
  static constexpr std::uint32_t state_drive = 3;
  static constexpr std::uint32_t state_charge = 4;
  static constexpr std::uint32_t state_unloading = 5;
  static constexpr std::uint32_t state_opening = 6;
  static constexpr std::uint32_t state_safe = 7;
  static constexpr std::uint32_t state_not_known = 15;
  static constexpr SignalLayout main_plus_layout = {16, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t main_plus = 0;  ///< Main contactor plus is closed.
  static constexpr std::uint32_t main_plus_no = 0;
  static constexpr std::uint32_t main_plus_yes = 1;
  static constexpr SignalLayout main_minus_layout = {17, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t main_minus = 0;  ///< Main contactor minus is closed.
  static constexpr std::uint32_t main_minus_no = 0;
  static constexpr std::uint32_t main_minus_yes = 1;
  static constexpr SignalLayout precharge_layout = {18, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t precharge = 0;  ///< Precharge contactor is closed.
  static constexpr std::uint32_t precharge_no = 0;
  static constexpr std::uint32_t precharge_yes = 1;
  static constexpr SignalLayout charge_enable_layout = {19, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t charge_enable = 0;  ///< The charger may supply current.
  static constexpr std::uint32_t charge_enable_no = 0;
  static constexpr std::uint32_t charge_enable_yes = 1;
  static constexpr SignalLayout welded_pole_layout = {20, 2, false, 1.0F, 0.0F, 0.0F, 3.0F, false, 0};
  std::uint32_t welded_pole = 0;  ///< Where a contactor does not open, while Faults.ContactorWelded is active. Plus: main plus or the precharge relay.
  static constexpr std::uint32_t welded_pole_none = 0;
  static constexpr std::uint32_t welded_pole_plus = 1;
  static constexpr std::uint32_t welded_pole_minus = 2;
  static constexpr std::uint32_t welded_pole_not_known = 3;
  static constexpr SignalLayout first_cause_time_layout = {24, 24, false, 0.1F, 0.0F, 0.0F, 1677721.4F, true, 16777215};
  float first_cause_time = unknown;  ///< [s] Time since the start at which the first cause (Faults.FirstCause) was raised.
  static constexpr SignalLayout auxiliary_fitted_layout = {48, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t auxiliary_fitted = 0;  ///< The board reads auxiliary contacts of the main contactors.
  static constexpr std::uint32_t auxiliary_fitted_no = 0;
  static constexpr std::uint32_t auxiliary_fitted_yes = 1;
  static constexpr SignalLayout auxiliary_plus_layout = {49, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t auxiliary_plus = 0;  ///< Auxiliary contact of main plus: its main contact is closed.
  static constexpr std::uint32_t auxiliary_plus_open = 0;
  static constexpr std::uint32_t auxiliary_plus_closed = 1;
  static constexpr SignalLayout auxiliary_minus_layout = {50, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t auxiliary_minus = 0;  ///< Auxiliary contact of main minus: its main contact is closed.
  static constexpr std::uint32_t auxiliary_minus_open = 0;
  static constexpr std::uint32_t auxiliary_minus_closed = 1;

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<state_layout>(out, state);
    put<main_plus_layout>(out, main_plus);
    put<main_minus_layout>(out, main_minus);
    put<precharge_layout>(out, precharge);
    put<charge_enable_layout>(out, charge_enable);
    put<welded_pole_layout>(out, welded_pole);
    put<first_cause_time_layout>(out, first_cause_time);
    put<auxiliary_fitted_layout>(out, auxiliary_fitted);
    put<auxiliary_plus_layout>(out, auxiliary_plus);
    put<auxiliary_minus_layout>(out, auxiliary_minus);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr ContactorState of(const can::Frame& frame) {
    ContactorState out;
    out.state = get<state_layout, decltype(out.state)>(frame);
    out.main_plus = get<main_plus_layout, decltype(out.main_plus)>(frame);
    out.main_minus = get<main_minus_layout, decltype(out.main_minus)>(frame);
    out.precharge = get<precharge_layout, decltype(out.precharge)>(frame);
    out.charge_enable = get<charge_enable_layout, decltype(out.charge_enable)>(frame);
    out.welded_pole = get<welded_pole_layout, decltype(out.welded_pole)>(frame);
    out.first_cause_time = get<first_cause_time_layout, decltype(out.first_cause_time)>(frame);
    out.auxiliary_fitted = get<auxiliary_fitted_layout, decltype(out.auxiliary_fitted)>(frame);
    out.auxiliary_plus = get<auxiliary_plus_layout, decltype(out.auxiliary_plus)>(frame);
    out.auxiliary_minus = get<auxiliary_minus_layout, decltype(out.auxiliary_minus)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("State", "", state, state_layout);
    see("MainPlus", "", main_plus, main_plus_layout);
    see("MainMinus", "", main_minus, main_minus_layout);
    see("Precharge", "", precharge, precharge_layout);
    see("ChargeEnable", "", charge_enable, charge_enable_layout);
    see("WeldedPole", "", welded_pole, welded_pole_layout);
    see("FirstCauseTime", "s", first_cause_time, first_cause_time_layout);
    see("AuxiliaryFitted", "", auxiliary_fitted, auxiliary_fitted_layout);
    see("AuxiliaryPlus", "", auxiliary_plus, auxiliary_plus_layout);
    see("AuxiliaryMinus", "", auxiliary_minus, auxiliary_minus_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    { static constexpr std::array<ValueName, 9> names{{ValueName{0, "off"}, ValueName{1, "self-test"}, ValueName{2, "precharge"}, ValueName{3, "drive"}, ValueName{4, "charge"}, ValueName{5, "unloading"}, ValueName{6, "opening"}, ValueName{7, "safe"}, ValueName{15, "not known"}}}; see("State", "State of the contactor control.", std::span<const ValueName>(names)); }
    { static constexpr std::array<ValueName, 2> names{{ValueName{0, "no"}, ValueName{1, "yes"}}}; see("MainPlus", "Main contactor plus is closed.", std::span<const ValueName>(names)); }
    { static constexpr std::array<ValueName, 2> names{{ValueName{0, "no"}, ValueName{1, "yes"}}}; see("MainMinus", "Main contactor minus is closed.", std::span<const ValueName>(names)); }
    { static constexpr std::array<ValueName, 2> names{{ValueName{0, "no"}, ValueName{1, "yes"}}}; see("Precharge", "Precharge contactor is closed.", std::span<const ValueName>(names)); }
    { static constexpr std::array<ValueName, 2> names{{ValueName{0, "no"}, ValueName{1, "yes"}}}; see("ChargeEnable", "The charger may supply current.", std::span<const ValueName>(names)); }
    { static constexpr std::array<ValueName, 4> names{{ValueName{0, "none"}, ValueName{1, "plus"}, ValueName{2, "minus"}, ValueName{3, "not known"}}}; see("WeldedPole", "Where a contactor does not open, while Faults.ContactorWelded is active. Plus: main plus or the precharge relay.", std::span<const ValueName>(names)); }
    see("FirstCauseTime", "Time since the start at which the first cause (Faults.FirstCause) was raised.", std::span<const ValueName>());
    { static constexpr std::array<ValueName, 2> names{{ValueName{0, "no"}, ValueName{1, "yes"}}}; see("AuxiliaryFitted", "The board reads auxiliary contacts of the main contactors.", std::span<const ValueName>(names)); }
    { static constexpr std::array<ValueName, 2> names{{ValueName{0, "open"}, ValueName{1, "closed"}}}; see("AuxiliaryPlus", "Auxiliary contact of main plus: its main contact is closed.", std::span<const ValueName>(names)); }
    { static constexpr std::array<ValueName, 2> names{{ValueName{0, "open"}, ValueName{1, "closed"}}}; see("AuxiliaryMinus", "Auxiliary contact of main minus: its main contact is closed.", std::span<const ValueName>(names)); }
  }
};

/// Cells that are being balanced.
struct Balancing {
  static constexpr const char* name = "Balancing";
  static constexpr std::uint16_t id = 0x198;
  static constexpr std::uint32_t cycle_us = 1000000;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 408;
  static constexpr SignalLayout cells_layout = {16, 32, false, 1.0F, 0.0F, 0.0F, 4294967295.0F, false, 0};
  std::uint32_t cells = 0;  ///< One bit per cell, cell 1 in the lowest bit.
  static constexpr SignalLayout time_left_layout = {48, 16, false, 10.0F, 0.0F, 0.0F, 655340.0F, true, 65535};
  float time_left = unknown;  ///< [s] Time until the last cell is balanced, if not interrupted.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<cells_layout>(out, cells);
    put<time_left_layout>(out, time_left);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr Balancing of(const can::Frame& frame) {
    Balancing out;
    out.cells = get<cells_layout, decltype(out.cells)>(frame);
    out.time_left = get<time_left_layout, decltype(out.time_left)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("Cells", "", cells, cells_layout);
    see("TimeLeft", "s", time_left, time_left_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("Cells", "One bit per cell, cell 1 in the lowest bit.", std::span<const ValueName>());
    see("TimeLeft", "Time until the last cell is balanced, if not interrupted.", std::span<const ValueName>());
  }
};

/// Currents that are allowed now by the limits of cell, model and temperature. They ramp down before a limit cuts off.
struct AllowedCurrent {
  static constexpr const char* name = "AllowedCurrent";
  static constexpr std::uint16_t id = 0x19f;
  static constexpr std::uint32_t cycle_us = 100000;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 415;
  static constexpr SignalLayout charge_layout = {16, 16, false, 0.02F, 0.0F, 0.0F, 1310.68F, true, 65535};
  float charge = unknown;  ///< [A] Into the pack.
  static constexpr SignalLayout discharge_layout = {32, 16, false, 0.02F, 0.0F, 0.0F, 1310.68F, true, 65535};
  float discharge = unknown;  ///< [A] Out of the pack.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<charge_layout>(out, charge);
    put<discharge_layout>(out, discharge);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr AllowedCurrent of(const can::Frame& frame) {
    AllowedCurrent out;
    out.charge = get<charge_layout, decltype(out.charge)>(frame);
    out.discharge = get<discharge_layout, decltype(out.discharge)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("Charge", "A", charge, charge_layout);
    see("Discharge", "A", discharge, discharge_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("Charge", "Into the pack.", std::span<const ValueName>());
    see("Discharge", "Out of the pack.", std::span<const ValueName>());
  }
};

/// State of the data that are kept during a loss of power.
struct Storage {
  static constexpr const char* name = "Storage";
  static constexpr std::uint16_t id = 0x1b8;
  static constexpr std::uint32_t cycle_us = 1000000;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 440;
  static constexpr SignalLayout state_layout = {12, 4, false, 1.0F, 0.0F, 0.0F, 15.0F, false, 0};
  std::uint32_t state = 0;  ///< Whether data are stored. Full: nothing more is stored until the contactors have been open for a minute or two.
  static constexpr std::uint32_t state_no_flash = 0;
  static constexpr std::uint32_t state_works = 1;
  static constexpr std::uint32_t state_nothing_more_is_kept = 2;
  static constexpr std::uint32_t state_full = 3;
  static constexpr std::uint32_t state_a_record_was_turned_down = 4;
  static constexpr SignalLayout broken_sectors_layout = {16, 4, false, 1.0F, 0.0F, 0.0F, 15.0F, false, 0};
  std::uint32_t broken_sectors = 0;  ///< Flash sectors that failed to erase or to program since the start.
  static constexpr SignalLayout newer_records_layout = {20, 4, false, 1.0F, 0.0F, 0.0F, 15.0F, false, 0};
  std::uint32_t newer_records = 0;  ///< Records of a newer firmware: kept but not read.
  static constexpr SignalLayout erases_layout = {24, 16, false, 1.0F, 0.0F, 0.0F, 65535.0F, false, 0};
  std::uint32_t erases = 0;  ///< Erase cycles of each flash sector so far; rated for 10,000.
  static constexpr SignalLayout starts_layout = {40, 24, false, 1.0F, 0.0F, 0.0F, 16777215.0F, false, 0};
  std::uint32_t starts = 0;  ///< Total number of starts of the firmware.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<state_layout>(out, state);
    put<broken_sectors_layout>(out, broken_sectors);
    put<newer_records_layout>(out, newer_records);
    put<erases_layout>(out, erases);
    put<starts_layout>(out, starts);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr Storage of(const can::Frame& frame) {
    Storage out;
    out.state = get<state_layout, decltype(out.state)>(frame);
    out.broken_sectors = get<broken_sectors_layout, decltype(out.broken_sectors)>(frame);
    out.newer_records = get<newer_records_layout, decltype(out.newer_records)>(frame);
    out.erases = get<erases_layout, decltype(out.erases)>(frame);
    out.starts = get<starts_layout, decltype(out.starts)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("State", "", state, state_layout);
    see("BrokenSectors", "", broken_sectors, broken_sectors_layout);
    see("NewerRecords", "", newer_records, newer_records_layout);
    see("Erases", "", erases, erases_layout);
    see("Starts", "", starts, starts_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    { static constexpr std::array<ValueName, 5> names{{ValueName{0, "no flash"}, ValueName{1, "works"}, ValueName{2, "nothing more is kept"}, ValueName{3, "full"}, ValueName{4, "a record was turned down"}}}; see("State", "Whether data are stored. Full: nothing more is stored until the contactors have been open for a minute or two.", std::span<const ValueName>(names)); }
    see("BrokenSectors", "Flash sectors that failed to erase or to program since the start.", std::span<const ValueName>());
    see("NewerRecords", "Records of a newer firmware: kept but not read.", std::span<const ValueName>());
    see("Erases", "Erase cycles of each flash sector so far; rated for 10,000.", std::span<const ValueName>());
    see("Starts", "Total number of starts of the firmware.", std::span<const ValueName>());
  }
};

/// State of the measuring chip, and which of its own protections have opened since the sample before. Also sent at once when a protection opens or closes.
struct FrontEnd {
  static constexpr const char* name = "FrontEnd";
  static constexpr std::uint16_t id = 0x1a3;
  static constexpr std::uint32_t cycle_us = 1000000;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 419;
  static constexpr SignalLayout state_layout = {12, 4, false, 1.0F, 0.0F, 0.0F, 13.0F, false, 0};
  std::uint32_t state = 0;  ///< Whether the chip measures. Of a pack of more than 16 cells, both; otherwise the half without readings, the lower one before the upper one.
  static constexpr std::uint32_t state_absent = 0;
  static constexpr std::uint32_t state_configuring = 1;
  static constexpr std::uint32_t state_measuring = 2;
  static constexpr std::uint32_t state_lower_absent = 3;
  static constexpr std::uint32_t state_upper_absent = 4;
  static constexpr std::uint32_t state_lower_configuring = 5;
  static constexpr std::uint32_t state_upper_configuring = 6;
  static constexpr std::uint32_t state_swapped = 7;
  static constexpr std::uint32_t state_lower_misplaced = 8;
  static constexpr std::uint32_t state_upper_misplaced = 9;
  static constexpr std::uint32_t state_lower_clock_wrong = 10;
  static constexpr std::uint32_t state_upper_clock_wrong = 11;
  static constexpr std::uint32_t state_lower_stale = 12;
  static constexpr std::uint32_t state_upper_stale = 13;
  static constexpr SignalLayout cell_undervoltage_layout = {16, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t cell_undervoltage = 0;  ///< Undervoltage of a cell.
  static constexpr SignalLayout cell_overvoltage_layout = {17, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t cell_overvoltage = 0;  ///< Overvoltage of a cell.
  static constexpr SignalLayout charge_overcurrent_layout = {18, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t charge_overcurrent = 0;  ///< Overcurrent while charging.
  static constexpr SignalLayout discharge_overcurrent_layout = {19, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t discharge_overcurrent = 0;  ///< Overcurrent while discharging.
  static constexpr SignalLayout short_circuit_layout = {20, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t short_circuit = 0;  ///< Short circuit while discharging.
  static constexpr SignalLayout temperature_layout = {21, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t temperature = 0;  ///< Temperature.
  static constexpr SignalLayout host_silence_layout = {22, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t host_silence = 0;  ///< The controller was silent, or the chip was reset or had no settings.
  static constexpr SignalLayout permanent_failure_layout = {23, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t permanent_failure = 0;  ///< The chip reports a permanent failure.
  static constexpr SignalLayout pins_wrong_layout = {24, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t pins_wrong = 0;  ///< The enable signals do not follow the protections.
  static constexpr SignalLayout die_temperature_layout = {25, 7, false, 2.0F, 62.0F, -60.0F, 192.0F, true, 0};
  float die_temperature = unknown;  ///< [degC] Temperature of the measuring chip itself, of two chips that of the warmer one.
  static constexpr SignalLayout lost_layout = {32, 8, false, 1.0F, 0.0F, 0.0F, 255.0F, false, 0};
  std::uint32_t lost = 0;  ///< Number of times that measuring ended since the start.
  static constexpr SignalLayout resets_layout = {40, 8, false, 1.0F, 0.0F, 0.0F, 255.0F, false, 0};
  std::uint32_t resets = 0;  ///< Number of resets of the chip while it measured.
  static constexpr SignalLayout crc_errors_layout = {48, 16, false, 1.0F, 0.0F, 0.0F, 65535.0F, false, 0};
  std::uint32_t crc_errors = 0;  ///< Number of transfers with a wrong check code.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<state_layout>(out, state);
    put<cell_undervoltage_layout>(out, cell_undervoltage);
    put<cell_overvoltage_layout>(out, cell_overvoltage);
    put<charge_overcurrent_layout>(out, charge_overcurrent);
    put<discharge_overcurrent_layout>(out, discharge_overcurrent);
    put<short_circuit_layout>(out, short_circuit);
    put<temperature_layout>(out, temperature);
    put<host_silence_layout>(out, host_silence);
    put<permanent_failure_layout>(out, permanent_failure);
    put<pins_wrong_layout>(out, pins_wrong);
    put<die_temperature_layout>(out, die_temperature);
    put<lost_layout>(out, lost);
    put<resets_layout>(out, resets);
    put<crc_errors_layout>(out, crc_errors);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr FrontEnd of(const can::Frame& frame) {
    FrontEnd out;
    out.state = get<state_layout, decltype(out.state)>(frame);
    out.cell_undervoltage = get<cell_undervoltage_layout, decltype(out.cell_undervoltage)>(frame);
    out.cell_overvoltage = get<cell_overvoltage_layout, decltype(out.cell_overvoltage)>(frame);
    out.charge_overcurrent = get<charge_overcurrent_layout, decltype(out.charge_overcurrent)>(frame);
    out.discharge_overcurrent = get<discharge_overcurrent_layout, decltype(out.discharge_overcurrent)>(frame);
    out.short_circuit = get<short_circuit_layout, decltype(out.short_circuit)>(frame);
    out.temperature = get<temperature_layout, decltype(out.temperature)>(frame);
    out.host_silence = get<host_silence_layout, decltype(out.host_silence)>(frame);
    out.permanent_failure = get<permanent_failure_layout, decltype(out.permanent_failure)>(frame);
    out.pins_wrong = get<pins_wrong_layout, decltype(out.pins_wrong)>(frame);
    out.die_temperature = get<die_temperature_layout, decltype(out.die_temperature)>(frame);
    out.lost = get<lost_layout, decltype(out.lost)>(frame);
    out.resets = get<resets_layout, decltype(out.resets)>(frame);
    out.crc_errors = get<crc_errors_layout, decltype(out.crc_errors)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("State", "", state, state_layout);
    see("CellUndervoltage", "", cell_undervoltage, cell_undervoltage_layout);
    see("CellOvervoltage", "", cell_overvoltage, cell_overvoltage_layout);
    see("ChargeOvercurrent", "", charge_overcurrent, charge_overcurrent_layout);
    see("DischargeOvercurrent", "", discharge_overcurrent, discharge_overcurrent_layout);
    see("ShortCircuit", "", short_circuit, short_circuit_layout);
    see("Temperature", "", temperature, temperature_layout);
    see("HostSilence", "", host_silence, host_silence_layout);
    see("PermanentFailure", "", permanent_failure, permanent_failure_layout);
    see("PinsWrong", "", pins_wrong, pins_wrong_layout);
    see("DieTemperature", "degC", die_temperature, die_temperature_layout);
    see("Lost", "", lost, lost_layout);
    see("Resets", "", resets, resets_layout);
    see("CrcErrors", "", crc_errors, crc_errors_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    { static constexpr std::array<ValueName, 14> names{{ValueName{0, "absent"}, ValueName{1, "configuring"}, ValueName{2, "measuring"}, ValueName{3, "lower absent"}, ValueName{4, "upper absent"}, ValueName{5, "lower configuring"}, ValueName{6, "upper configuring"}, ValueName{7, "swapped"}, ValueName{8, "lower misplaced"}, ValueName{9, "upper misplaced"}, ValueName{10, "lower clock wrong"}, ValueName{11, "upper clock wrong"}, ValueName{12, "lower stale"}, ValueName{13, "upper stale"}}}; see("State", "Whether the chip measures. Of a pack of more than 16 cells, both; otherwise the half without readings, the lower one before the upper one.", std::span<const ValueName>(names)); }
    see("CellUndervoltage", "Undervoltage of a cell.", std::span<const ValueName>());
    see("CellOvervoltage", "Overvoltage of a cell.", std::span<const ValueName>());
    see("ChargeOvercurrent", "Overcurrent while charging.", std::span<const ValueName>());
    see("DischargeOvercurrent", "Overcurrent while discharging.", std::span<const ValueName>());
    see("ShortCircuit", "Short circuit while discharging.", std::span<const ValueName>());
    see("Temperature", "Temperature.", std::span<const ValueName>());
    see("HostSilence", "The controller was silent, or the chip was reset or had no settings.", std::span<const ValueName>());
    see("PermanentFailure", "The chip reports a permanent failure.", std::span<const ValueName>());
    see("PinsWrong", "The enable signals do not follow the protections.", std::span<const ValueName>());
    see("DieTemperature", "Temperature of the measuring chip itself, of two chips that of the warmer one.", std::span<const ValueName>());
    see("Lost", "Number of times that measuring ended since the start.", std::span<const ValueName>());
    see("Resets", "Number of resets of the chip while it measured.", std::span<const ValueName>());
    see("CrcErrors", "Number of transfers with a wrong check code.", std::span<const ValueName>());
  }
};

/// Self-diagnosis of the board. Each of the first four bits sets Faults.InternalFault, which keeps the contactors open.
struct Board {
  static constexpr const char* name = "Board";
  static constexpr std::uint16_t id = 0x1b9;
  static constexpr std::uint32_t cycle_us = 1000000;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 441;
  static constexpr SignalLayout ram_failed_layout = {12, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t ram_failed = 0;  ///< The RAM test at the start failed.
  static constexpr std::uint32_t ram_failed_no = 0;
  static constexpr std::uint32_t ram_failed_yes = 1;
  static constexpr SignalLayout image_failed_layout = {13, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t image_failed = 0;  ///< The check code of the firmware in flash is wrong.
  static constexpr std::uint32_t image_failed_no = 0;
  static constexpr std::uint32_t image_failed_yes = 1;
  static constexpr SignalLayout stack_overrun_layout = {14, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t stack_overrun = 0;  ///< The stack has grown beyond its limit.
  static constexpr std::uint32_t stack_overrun_no = 0;
  static constexpr std::uint32_t stack_overrun_yes = 1;
  static constexpr SignalLayout cell_file_changed_layout = {15, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t cell_file_changed = 0;  ///< The stored data belong to another cell file. They are not used. Clearing faults accepts the new cell file.
  static constexpr std::uint32_t cell_file_changed_no = 0;
  static constexpr std::uint32_t cell_file_changed_yes = 1;
  static constexpr SignalLayout supply_low_layout = {16, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t supply_low = 0;  ///< The supply of the controller is below the threshold of its detector.
  static constexpr std::uint32_t supply_low_no = 0;
  static constexpr std::uint32_t supply_low_yes = 1;
  static constexpr SignalLayout brown_out_reset_low_layout = {17, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t brown_out_reset_low = 0;  ///< The option bytes of the chip let it run at a voltage too low for its flash: boards/porting.md.
  static constexpr std::uint32_t brown_out_reset_low_no = 0;
  static constexpr std::uint32_t brown_out_reset_low_yes = 1;
  static constexpr SignalLayout clock_failed_layout = {18, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t clock_failed = 0;  ///< The crystal does not work and the core runs on its internal oscillator, or its frequency was wrong.
  static constexpr std::uint32_t clock_failed_no = 0;
  static constexpr std::uint32_t clock_failed_yes = 1;
  static constexpr SignalLayout parameters_lost_layout = {19, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t parameters_lost = 0;  ///< The stored parameters are unreadable, and those of the build are used. Clear faults by a workshop accepts them.
  static constexpr std::uint32_t parameters_lost_no = 0;
  static constexpr std::uint32_t parameters_lost_yes = 1;
  static constexpr SignalLayout calendar_layout = {20, 4, false, 1.0F, 0.0F, 0.0F, 14.0F, true, 15};
  std::uint32_t calendar = 0;  ///< State of the real-time clock, which runs while the power is off. Command: set time.
  static constexpr std::uint32_t calendar_none = 0;
  static constexpr std::uint32_t calendar_never_set = 1;
  static constexpr std::uint32_t calendar_runs = 2;
  static constexpr std::uint32_t calendar_runs_roughly = 3;
  static constexpr std::uint32_t calendar_not_known = 15;
  static constexpr SignalLayout last_exception_layout = {24, 8, false, 1.0F, 0.0F, 0.0F, 255.0F, false, 0};
  std::uint32_t last_exception = 0;  ///< Processor exception that ended the last run: its number in the vector table; 0: none.
  static constexpr SignalLayout stack_free_layout = {32, 16, false, 1.0F, 0.0F, 0.0F, 65534.0F, true, 65535};
  float stack_free = unknown;  ///< [byte] Lowest value so far.
  static constexpr SignalLayout longest_sample_layout = {48, 16, false, 0.01F, 0.0F, 0.0F, 655.34F, true, 65535};
  float longest_sample = unknown;  ///< [ms] Longest processing time of a sample so far.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<ram_failed_layout>(out, ram_failed);
    put<image_failed_layout>(out, image_failed);
    put<stack_overrun_layout>(out, stack_overrun);
    put<cell_file_changed_layout>(out, cell_file_changed);
    put<supply_low_layout>(out, supply_low);
    put<brown_out_reset_low_layout>(out, brown_out_reset_low);
    put<clock_failed_layout>(out, clock_failed);
    put<parameters_lost_layout>(out, parameters_lost);
    put<calendar_layout>(out, calendar);
    put<last_exception_layout>(out, last_exception);
    put<stack_free_layout>(out, stack_free);
    put<longest_sample_layout>(out, longest_sample);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr Board of(const can::Frame& frame) {
    Board out;
    out.ram_failed = get<ram_failed_layout, decltype(out.ram_failed)>(frame);
    out.image_failed = get<image_failed_layout, decltype(out.image_failed)>(frame);
    out.stack_overrun = get<stack_overrun_layout, decltype(out.stack_overrun)>(frame);
    out.cell_file_changed = get<cell_file_changed_layout, decltype(out.cell_file_changed)>(frame);
    out.supply_low = get<supply_low_layout, decltype(out.supply_low)>(frame);
    out.brown_out_reset_low = get<brown_out_reset_low_layout, decltype(out.brown_out_reset_low)>(frame);
    out.clock_failed = get<clock_failed_layout, decltype(out.clock_failed)>(frame);
    out.parameters_lost = get<parameters_lost_layout, decltype(out.parameters_lost)>(frame);
    out.calendar = get<calendar_layout, decltype(out.calendar)>(frame);
    out.last_exception = get<last_exception_layout, decltype(out.last_exception)>(frame);
    out.stack_free = get<stack_free_layout, decltype(out.stack_free)>(frame);
    out.longest_sample = get<longest_sample_layout, decltype(out.longest_sample)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("RamFailed", "", ram_failed, ram_failed_layout);
    see("ImageFailed", "", image_failed, image_failed_layout);
    see("StackOverrun", "", stack_overrun, stack_overrun_layout);
    see("CellFileChanged", "", cell_file_changed, cell_file_changed_layout);
    see("SupplyLow", "", supply_low, supply_low_layout);
    see("BrownOutResetLow", "", brown_out_reset_low, brown_out_reset_low_layout);
    see("ClockFailed", "", clock_failed, clock_failed_layout);
    see("ParametersLost", "", parameters_lost, parameters_lost_layout);
    see("Calendar", "", calendar, calendar_layout);
    see("LastException", "", last_exception, last_exception_layout);
    see("StackFree", "byte", stack_free, stack_free_layout);
    see("LongestSample", "ms", longest_sample, longest_sample_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    { static constexpr std::array<ValueName, 2> names{{ValueName{0, "no"}, ValueName{1, "yes"}}}; see("RamFailed", "The RAM test at the start failed.", std::span<const ValueName>(names)); }
    { static constexpr std::array<ValueName, 2> names{{ValueName{0, "no"}, ValueName{1, "yes"}}}; see("ImageFailed", "The check code of the firmware in flash is wrong.", std::span<const ValueName>(names)); }
    { static constexpr std::array<ValueName, 2> names{{ValueName{0, "no"}, ValueName{1, "yes"}}}; see("StackOverrun", "The stack has grown beyond its limit.", std::span<const ValueName>(names)); }
    { static constexpr std::array<ValueName, 2> names{{ValueName{0, "no"}, ValueName{1, "yes"}}}; see("CellFileChanged", "The stored data belong to another cell file. They are not used. Clearing faults accepts the new cell file.", std::span<const ValueName>(names)); }
    { static constexpr std::array<ValueName, 2> names{{ValueName{0, "no"}, ValueName{1, "yes"}}}; see("SupplyLow", "The supply of the controller is below the threshold of its detector.", std::span<const ValueName>(names)); }
    { static constexpr std::array<ValueName, 2> names{{ValueName{0, "no"}, ValueName{1, "yes"}}}; see("BrownOutResetLow", "The option bytes of the chip let it run at a voltage too low for its flash: boards/porting.md.", std::span<const ValueName>(names)); }
    { static constexpr std::array<ValueName, 2> names{{ValueName{0, "no"}, ValueName{1, "yes"}}}; see("ClockFailed", "The crystal does not work and the core runs on its internal oscillator, or its frequency was wrong.", std::span<const ValueName>(names)); }
    { static constexpr std::array<ValueName, 2> names{{ValueName{0, "no"}, ValueName{1, "yes"}}}; see("ParametersLost", "The stored parameters are unreadable, and those of the build are used. Clear faults by a workshop accepts them.", std::span<const ValueName>(names)); }
    { static constexpr std::array<ValueName, 5> names{{ValueName{0, "none"}, ValueName{1, "never set"}, ValueName{2, "runs"}, ValueName{3, "runs roughly"}, ValueName{15, "not known"}}}; see("Calendar", "State of the real-time clock, which runs while the power is off. Command: set time.", std::span<const ValueName>(names)); }
    see("LastException", "Processor exception that ended the last run: its number in the vector table; 0: none.", std::span<const ValueName>());
    see("StackFree", "Lowest value so far.", std::span<const ValueName>());
    see("LongestSample", "Longest processing time of a sample so far.", std::span<const ValueName>());
  }
};

/// Inputs and outputs of the truck, of a board that has an input (BMS_INPUTS), an insulation monitor or a bus of its own for the charger. Also sent at once when an input changes.
struct TruckInputs {
  static constexpr const char* name = "TruckInputs";
  static constexpr std::uint16_t id = 0x1ba;
  static constexpr std::uint32_t cycle_us = 1000000;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 442;
  static constexpr SignalLayout heater_layout = {12, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t heater = 0;  ///< Output of the heater.
  static constexpr SignalLayout fan_layout = {13, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t fan = 0;  ///< Output of the fan.
  static constexpr SignalLayout soc_lamp_layout = {14, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t soc_lamp = 0;  ///< Output of the lamp; it blinks below 20 %.
  static constexpr SignalLayout wrong_current_sensor_layout = {16, 2, false, 1.0F, 0.0F, 0.0F, 2.0F, true, 3};
  std::uint32_t wrong_current_sensor = 0;  ///< While the current sensors differ: the one that contradicts the voltages of the cells.
  static constexpr std::uint32_t wrong_current_sensor_none = 0;
  static constexpr std::uint32_t wrong_current_sensor_first = 1;
  static constexpr std::uint32_t wrong_current_sensor_second = 2;
  static constexpr std::uint32_t wrong_current_sensor_not_known = 3;
  static constexpr SignalLayout key_layout = {18, 2, false, 1.0F, 0.0F, 0.0F, 1.0F, true, 3};
  std::uint32_t key = 0;  ///< Not known: not fitted, as for the next four.
  static constexpr std::uint32_t key_off = 0;
  static constexpr std::uint32_t key_on = 1;
  static constexpr std::uint32_t key_not_known = 3;
  static constexpr SignalLayout charger_plug_layout = {20, 2, false, 1.0F, 0.0F, 0.0F, 1.0F, true, 3};
  std::uint32_t charger_plug = 0;  ///< While it is plugged in, a truck does not drive.
  static constexpr std::uint32_t charger_plug_off = 0;
  static constexpr std::uint32_t charger_plug_on = 1;
  static constexpr std::uint32_t charger_plug_not_known = 3;
  static constexpr SignalLayout coil_supply_layout = {22, 2, false, 1.0F, 0.0F, 0.0F, 1.0F, true, 3};
  std::uint32_t coil_supply = 0;  ///< Off, as by an emergency stop: nothing closes. This is a state, not a fault; the next new request closes again.
  static constexpr std::uint32_t coil_supply_off = 0;
  static constexpr std::uint32_t coil_supply_on = 1;
  static constexpr std::uint32_t coil_supply_not_known = 3;
  static constexpr SignalLayout interlock_layout = {24, 2, false, 1.0F, 0.0F, 0.0F, 1.0F, true, 3};
  std::uint32_t interlock = 0;  ///< Off: the loop through the power connectors is open.
  static constexpr std::uint32_t interlock_off = 0;
  static constexpr std::uint32_t interlock_on = 1;
  static constexpr std::uint32_t interlock_not_known = 3;
  static constexpr SignalLayout crash_sensor_layout = {26, 2, false, 1.0F, 0.0F, 0.0F, 1.0F, true, 3};
  std::uint32_t crash_sensor = 0;  ///< Off: crash, tilt, or a broken wire of the sensor.
  static constexpr std::uint32_t crash_sensor_off = 0;
  static constexpr std::uint32_t crash_sensor_on = 1;
  static constexpr std::uint32_t crash_sensor_not_known = 3;
  static constexpr SignalLayout charger_bus_layout = {28, 3, false, 1.0F, 0.0F, 0.0F, 5.0F, false, 0};
  std::uint32_t charger_bus = 0;  ///< Controller of the charger's own bus (BMS_CHARGER_BUS), by its error counters. Passive is usual while no charger is plugged in, because nobody acknowledges.
  static constexpr std::uint32_t charger_bus_none = 0;
  static constexpr std::uint32_t charger_bus_starting = 1;
  static constexpr std::uint32_t charger_bus_active = 2;
  static constexpr std::uint32_t charger_bus_warning = 3;
  static constexpr std::uint32_t charger_bus_passive = 4;
  static constexpr std::uint32_t charger_bus_bus_off = 5;
  static constexpr SignalLayout insulation_layout = {32, 16, false, 0.1F, 0.0F, 0.0F, 6553.4F, true, 65535};
  float insulation = unknown;  ///< [kohm] Between battery and frame, as the insulation monitor has measured.
  static constexpr SignalLayout charger_bus_offs_layout = {48, 8, false, 1.0F, 0.0F, 0.0F, 255.0F, false, 0};
  std::uint32_t charger_bus_offs = 0;  ///< Times that the charger's own bus was off since the start; it wraps.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<heater_layout>(out, heater);
    put<fan_layout>(out, fan);
    put<soc_lamp_layout>(out, soc_lamp);
    put<wrong_current_sensor_layout>(out, wrong_current_sensor);
    put<key_layout>(out, key);
    put<charger_plug_layout>(out, charger_plug);
    put<coil_supply_layout>(out, coil_supply);
    put<interlock_layout>(out, interlock);
    put<crash_sensor_layout>(out, crash_sensor);
    put<charger_bus_layout>(out, charger_bus);
    put<insulation_layout>(out, insulation);
    put<charger_bus_offs_layout>(out, charger_bus_offs);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr TruckInputs of(const can::Frame& frame) {
    TruckInputs out;
    out.heater = get<heater_layout, decltype(out.heater)>(frame);
    out.fan = get<fan_layout, decltype(out.fan)>(frame);
    out.soc_lamp = get<soc_lamp_layout, decltype(out.soc_lamp)>(frame);
    out.wrong_current_sensor = get<wrong_current_sensor_layout, decltype(out.wrong_current_sensor)>(frame);
    out.key = get<key_layout, decltype(out.key)>(frame);
    out.charger_plug = get<charger_plug_layout, decltype(out.charger_plug)>(frame);
    out.coil_supply = get<coil_supply_layout, decltype(out.coil_supply)>(frame);
    out.interlock = get<interlock_layout, decltype(out.interlock)>(frame);
    out.crash_sensor = get<crash_sensor_layout, decltype(out.crash_sensor)>(frame);
    out.charger_bus = get<charger_bus_layout, decltype(out.charger_bus)>(frame);
    out.insulation = get<insulation_layout, decltype(out.insulation)>(frame);
    out.charger_bus_offs = get<charger_bus_offs_layout, decltype(out.charger_bus_offs)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("Heater", "", heater, heater_layout);
    see("Fan", "", fan, fan_layout);
    see("SocLamp", "", soc_lamp, soc_lamp_layout);
    see("WrongCurrentSensor", "", wrong_current_sensor, wrong_current_sensor_layout);
    see("Key", "", key, key_layout);
    see("ChargerPlug", "", charger_plug, charger_plug_layout);
    see("CoilSupply", "", coil_supply, coil_supply_layout);
    see("Interlock", "", interlock, interlock_layout);
    see("CrashSensor", "", crash_sensor, crash_sensor_layout);
    see("ChargerBus", "", charger_bus, charger_bus_layout);
    see("Insulation", "kohm", insulation, insulation_layout);
    see("ChargerBusOffs", "", charger_bus_offs, charger_bus_offs_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("Heater", "Output of the heater.", std::span<const ValueName>());
    see("Fan", "Output of the fan.", std::span<const ValueName>());
    see("SocLamp", "Output of the lamp; it blinks below 20 %.", std::span<const ValueName>());
    { static constexpr std::array<ValueName, 4> names{{ValueName{0, "none"}, ValueName{1, "first"}, ValueName{2, "second"}, ValueName{3, "not known"}}}; see("WrongCurrentSensor", "While the current sensors differ: the one that contradicts the voltages of the cells.", std::span<const ValueName>(names)); }
    { static constexpr std::array<ValueName, 3> names{{ValueName{0, "off"}, ValueName{1, "on"}, ValueName{3, "not known"}}}; see("Key", "Not known: not fitted, as for the next four.", std::span<const ValueName>(names)); }
    { static constexpr std::array<ValueName, 3> names{{ValueName{0, "off"}, ValueName{1, "on"}, ValueName{3, "not known"}}}; see("ChargerPlug", "While it is plugged in, a truck does not drive.", std::span<const ValueName>(names)); }
    { static constexpr std::array<ValueName, 3> names{{ValueName{0, "off"}, ValueName{1, "on"}, ValueName{3, "not known"}}}; see("CoilSupply", "Off, as by an emergency stop: nothing closes. This is a state, not a fault; the next new request closes again.", std::span<const ValueName>(names)); }
    { static constexpr std::array<ValueName, 3> names{{ValueName{0, "off"}, ValueName{1, "on"}, ValueName{3, "not known"}}}; see("Interlock", "Off: the loop through the power connectors is open.", std::span<const ValueName>(names)); }
    { static constexpr std::array<ValueName, 3> names{{ValueName{0, "off"}, ValueName{1, "on"}, ValueName{3, "not known"}}}; see("CrashSensor", "Off: crash, tilt, or a broken wire of the sensor.", std::span<const ValueName>(names)); }
    { static constexpr std::array<ValueName, 6> names{{ValueName{0, "none"}, ValueName{1, "starting"}, ValueName{2, "active"}, ValueName{3, "warning"}, ValueName{4, "passive"}, ValueName{5, "bus-off"}}}; see("ChargerBus", "Controller of the charger's own bus (BMS_CHARGER_BUS), by its error counters. Passive is usual while no charger is plugged in, because nobody acknowledges.", std::span<const ValueName>(names)); }
    see("Insulation", "Between battery and frame, as the insulation monitor has measured.", std::span<const ValueName>());
    see("ChargerBusOffs", "Times that the charger's own bus was off since the start; it wraps.", std::span<const ValueName>());
  }
};

/// A stored fault; on request, Command: stored data. StoredFaultPack and StoredFaultCells follow.
struct StoredFault {
  static constexpr const char* name = "StoredFault";
  static constexpr std::uint16_t id = 0x1a4;
  static constexpr std::uint32_t cycle_us = 0;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 420;
  static constexpr SignalLayout index_layout = {12, 4, false, 1.0F, 0.0F, 0.0F, 15.0F, false, 0};
  std::uint32_t index = 0;  ///< 0: the newest fault.
  static constexpr SignalLayout code_layout = {16, 8, false, 1.0F, 0.0F, 0.0F, 255.0F, false, 0};
  std::uint32_t code = 0;  ///< 0: no fault; 1 to 126: as Faults.FirstCause; from 128 on, a processor exception plus 128.
  static constexpr std::uint32_t code_new_image_not_confirmed = 127;
  static constexpr SignalLayout time_layout = {24, 32, false, 1.0F, 0.0F, 0.0F, 4294967295.0F, false, 0};
  std::uint32_t time = 0;  ///< [s] Since 1970-01-01 UTC. A value below 946684800 is the time in operation: the calendar clock was not set.
  static constexpr SignalLayout number_layout = {56, 8, false, 1.0F, 0.0F, 0.0F, 255.0F, false, 0};
  std::uint32_t number = 0;  ///< Number of the fault since the first start, low 8 bits. Frames with the same number belong together.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<index_layout>(out, index);
    put<code_layout>(out, code);
    put<time_layout>(out, time);
    put<number_layout>(out, number);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr StoredFault of(const can::Frame& frame) {
    StoredFault out;
    out.index = get<index_layout, decltype(out.index)>(frame);
    out.code = get<code_layout, decltype(out.code)>(frame);
    out.time = get<time_layout, decltype(out.time)>(frame);
    out.number = get<number_layout, decltype(out.number)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("Index", "", index, index_layout);
    see("Code", "", code, code_layout);
    see("Time", "s", time, time_layout);
    see("Number", "", number, number_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("Index", "0: the newest fault.", std::span<const ValueName>());
    { static constexpr std::array<ValueName, 1> names{{ValueName{127, "new image not confirmed"}}}; see("Code", "0: no fault; 1 to 126: as Faults.FirstCause; from 128 on, a processor exception plus 128.", std::span<const ValueName>(names)); }
    see("Time", "Since 1970-01-01 UTC. A value below 946684800 is the time in operation: the calendar clock was not set.", std::span<const ValueName>());
    see("Number", "Number of the fault since the first start, low 8 bits. Frames with the same number belong together.", std::span<const ValueName>());
  }
};

/// Readings of the pack at the fault.
struct StoredFaultPack {
  static constexpr const char* name = "StoredFaultPack";
  static constexpr std::uint16_t id = 0x1a5;
  static constexpr std::uint32_t cycle_us = 0;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 421;
  static constexpr SignalLayout index_layout = {12, 4, false, 1.0F, 0.0F, 0.0F, 15.0F, false, 0};
  std::uint32_t index = 0;  ///< 0: the newest fault.
  static constexpr SignalLayout soc_layout = {16, 8, false, 0.5F, 0.0F, 0.0F, 100.0F, true, 255};
  float soc = unknown;  ///< [%] State of charge.
  static constexpr SignalLayout current_layout = {24, 14, true, 0.25F, 0.0F, -2047.75F, 2047.75F, true, -8192};
  float current = unknown;  ///< [A] Positive: charging.
  static constexpr SignalLayout highest_temperature_layout = {38, 8, false, 1.0F, 60.0F, -60.0F, 194.0F, true, 255};
  float highest_temperature = unknown;  ///< [degC] Of the temperature sensors.
  static constexpr SignalLayout lowest_temperature_layout = {46, 8, false, 1.0F, 60.0F, -60.0F, 194.0F, true, 255};
  float lowest_temperature = unknown;  ///< [degC] Of the temperature sensors.
  static constexpr SignalLayout number_layout = {54, 8, false, 1.0F, 0.0F, 0.0F, 255.0F, false, 0};
  std::uint32_t number = 0;  ///< Number of the fault since the first start, low 8 bits. Frames with the same number belong together.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<index_layout>(out, index);
    put<soc_layout>(out, soc);
    put<current_layout>(out, current);
    put<highest_temperature_layout>(out, highest_temperature);
    put<lowest_temperature_layout>(out, lowest_temperature);
    put<number_layout>(out, number);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr StoredFaultPack of(const can::Frame& frame) {
    StoredFaultPack out;
    out.index = get<index_layout, decltype(out.index)>(frame);
    out.soc = get<soc_layout, decltype(out.soc)>(frame);
    out.current = get<current_layout, decltype(out.current)>(frame);
    out.highest_temperature = get<highest_temperature_layout, decltype(out.highest_temperature)>(frame);
    out.lowest_temperature = get<lowest_temperature_layout, decltype(out.lowest_temperature)>(frame);
    out.number = get<number_layout, decltype(out.number)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("Index", "", index, index_layout);
    see("Soc", "%", soc, soc_layout);
    see("Current", "A", current, current_layout);
    see("HighestTemperature", "degC", highest_temperature, highest_temperature_layout);
    see("LowestTemperature", "degC", lowest_temperature, lowest_temperature_layout);
    see("Number", "", number, number_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("Index", "0: the newest fault.", std::span<const ValueName>());
    see("Soc", "State of charge.", std::span<const ValueName>());
    see("Current", "Positive: charging.", std::span<const ValueName>());
    see("HighestTemperature", "Of the temperature sensors.", std::span<const ValueName>());
    see("LowestTemperature", "Of the temperature sensors.", std::span<const ValueName>());
    see("Number", "Number of the fault since the first start, low 8 bits. Frames with the same number belong together.", std::span<const ValueName>());
  }
};

/// Readings of the cells at the fault.
struct StoredFaultCells {
  static constexpr const char* name = "StoredFaultCells";
  static constexpr std::uint16_t id = 0x1a6;
  static constexpr std::uint32_t cycle_us = 0;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 422;
  static constexpr SignalLayout index_layout = {12, 4, false, 1.0F, 0.0F, 0.0F, 15.0F, false, 0};
  std::uint32_t index = 0;  ///< 0: the newest fault.
  static constexpr SignalLayout highest_voltage_layout = {16, 13, false, 0.001F, 0.0F, 0.0F, 8.19F, true, 8191};
  float highest_voltage = unknown;  ///< [V] Of the cells.
  static constexpr SignalLayout lowest_voltage_layout = {29, 13, false, 0.001F, 0.0F, 0.0F, 8.19F, true, 8191};
  float lowest_voltage = unknown;  ///< [V] Of the cells.
  static constexpr SignalLayout number_layout = {42, 8, false, 1.0F, 0.0F, 0.0F, 255.0F, false, 0};
  std::uint32_t number = 0;  ///< Number of the fault since the first start, low 8 bits. Frames with the same number belong together.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<index_layout>(out, index);
    put<highest_voltage_layout>(out, highest_voltage);
    put<lowest_voltage_layout>(out, lowest_voltage);
    put<number_layout>(out, number);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr StoredFaultCells of(const can::Frame& frame) {
    StoredFaultCells out;
    out.index = get<index_layout, decltype(out.index)>(frame);
    out.highest_voltage = get<highest_voltage_layout, decltype(out.highest_voltage)>(frame);
    out.lowest_voltage = get<lowest_voltage_layout, decltype(out.lowest_voltage)>(frame);
    out.number = get<number_layout, decltype(out.number)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("Index", "", index, index_layout);
    see("HighestVoltage", "V", highest_voltage, highest_voltage_layout);
    see("LowestVoltage", "V", lowest_voltage, lowest_voltage_layout);
    see("Number", "", number, number_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("Index", "0: the newest fault.", std::span<const ValueName>());
    see("HighestVoltage", "Of the cells.", std::span<const ValueName>());
    see("LowestVoltage", "Of the cells.", std::span<const ValueName>());
    see("Number", "Number of the fault since the first start, low 8 bits. Frames with the same number belong together.", std::span<const ValueName>());
  }
};

/// Use of the battery since its first start; on request, Command: stored data.
struct StoredUse {
  static constexpr const char* name = "StoredUse";
  static constexpr std::uint16_t id = 0x1a7;
  static constexpr std::uint32_t cycle_us = 0;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 423;
  static constexpr SignalLayout operating_time_layout = {12, 32, false, 1.0F, 0.0F, 0.0F, 4294967295.0F, false, 0};
  std::uint32_t operating_time = 0;  ///< [s] Time with power.
  static constexpr SignalLayout cycles_layout = {44, 20, false, 0.1F, 0.0F, 0.0F, 104857.5F, false, 0};
  float cycles = unknown;  ///< Full cycles: discharged charge over the capacity of the cell file.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<operating_time_layout>(out, operating_time);
    put<cycles_layout>(out, cycles);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr StoredUse of(const can::Frame& frame) {
    StoredUse out;
    out.operating_time = get<operating_time_layout, decltype(out.operating_time)>(frame);
    out.cycles = get<cycles_layout, decltype(out.cycles)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("OperatingTime", "s", operating_time, operating_time_layout);
    see("Cycles", "", cycles, cycles_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("OperatingTime", "Time with power.", std::span<const ValueName>());
    see("Cycles", "Full cycles: discharged charge over the capacity of the cell file.", std::span<const ValueName>());
  }
};

/// Charge since the first start; on request, Command: stored data.
struct StoredThroughput {
  static constexpr const char* name = "StoredThroughput";
  static constexpr std::uint16_t id = 0x1a8;
  static constexpr std::uint32_t cycle_us = 0;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 424;
  static constexpr SignalLayout charged_layout = {12, 26, false, 0.1F, 0.0F, 0.0F, 6710886.3F, false, 0};
  std::uint32_t charged = 0;  ///< [Ah] Charge that flowed into the battery.
  static constexpr SignalLayout discharged_layout = {38, 26, false, 0.1F, 0.0F, 0.0F, 6710886.3F, false, 0};
  std::uint32_t discharged = 0;  ///< [Ah] Charge that flowed out of the battery.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<charged_layout>(out, charged);
    put<discharged_layout>(out, discharged);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr StoredThroughput of(const can::Frame& frame) {
    StoredThroughput out;
    out.charged = get<charged_layout, decltype(out.charged)>(frame);
    out.discharged = get<discharged_layout, decltype(out.discharged)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("Charged", "Ah", charged, charged_layout);
    see("Discharged", "Ah", discharged, discharged_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("Charged", "Charge that flowed into the battery.", std::span<const ValueName>());
    see("Discharged", "Charge that flowed out of the battery.", std::span<const ValueName>());
  }
};

/// Lowest and highest readings since the first start, one frame each; on request, Command: stored data.
struct StoredExtremes {
  static constexpr const char* name = "StoredExtremes";
  static constexpr std::uint16_t id = 0x1a9;
  static constexpr std::uint32_t cycle_us = 0;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 425;
  static constexpr SignalLayout kind_layout = {12, 1, false, 1.0F, 0.0F, 0.0F, 1.0F, false, 0};
  std::uint32_t kind = 0;  ///< Whether the values are the lowest or the highest ones.
  static constexpr std::uint32_t kind_lowest = 0;
  static constexpr std::uint32_t kind_highest = 1;
  static constexpr SignalLayout voltage_layout = {16, 13, false, 0.001F, 0.0F, 0.0F, 8.19F, true, 8191};
  float voltage = unknown;  ///< [V] Of any cell.
  static constexpr SignalLayout temperature_layout = {29, 8, false, 1.0F, 60.0F, -60.0F, 194.0F, true, 255};
  float temperature = unknown;  ///< [degC] Of any temperature sensor.
  static constexpr SignalLayout current_layout = {37, 14, true, 0.25F, 0.0F, -2047.75F, 2047.75F, true, -8192};
  float current = unknown;  ///< [A] Of the pack. Lowest: the largest discharge current.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<kind_layout>(out, kind);
    put<voltage_layout>(out, voltage);
    put<temperature_layout>(out, temperature);
    put<current_layout>(out, current);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr StoredExtremes of(const can::Frame& frame) {
    StoredExtremes out;
    out.kind = get<kind_layout, decltype(out.kind)>(frame);
    out.voltage = get<voltage_layout, decltype(out.voltage)>(frame);
    out.temperature = get<temperature_layout, decltype(out.temperature)>(frame);
    out.current = get<current_layout, decltype(out.current)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("Kind", "", kind, kind_layout);
    see("Voltage", "V", voltage, voltage_layout);
    see("Temperature", "degC", temperature, temperature_layout);
    see("Current", "A", current, current_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    { static constexpr std::array<ValueName, 2> names{{ValueName{0, "lowest"}, ValueName{1, "highest"}}}; see("Kind", "Whether the values are the lowest or the highest ones.", std::span<const ValueName>(names)); }
    see("Voltage", "Of any cell.", std::span<const ValueName>());
    see("Temperature", "Of any temperature sensor.", std::span<const ValueName>());
    see("Current", "Of the pack. Lowest: the largest discharge current.", std::span<const ValueName>());
  }
};

/// Resets by cause, one frame each, and faults since the first start; on request, Command: stored data.
struct StoredCounts {
  static constexpr const char* name = "StoredCounts";
  static constexpr std::uint16_t id = 0x1aa;
  static constexpr std::uint32_t cycle_us = 0;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 426;
  static constexpr SignalLayout cause_layout = {12, 4, false, 1.0F, 0.0F, 0.0F, 15.0F, false, 0};
  std::uint32_t cause = 0;  ///< Cause of a reset.
  static constexpr std::uint32_t cause_unknown = 0;
  static constexpr std::uint32_t cause_power_on = 1;
  static constexpr std::uint32_t cause_pin = 2;
  static constexpr std::uint32_t cause_software = 3;
  static constexpr std::uint32_t cause_watchdog = 4;
  static constexpr std::uint32_t cause_brown_out = 5;
  static constexpr std::uint32_t cause_low_power = 6;
  static constexpr SignalLayout resets_layout = {16, 16, false, 1.0F, 0.0F, 0.0F, 65535.0F, false, 0};
  std::uint32_t resets = 0;  ///< Resets of this cause.
  static constexpr SignalLayout faults_layout = {32, 32, false, 1.0F, 0.0F, 0.0F, 4294967295.0F, false, 0};
  std::uint32_t faults = 0;  ///< Faults of any kind. The last 16 are stored.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<cause_layout>(out, cause);
    put<resets_layout>(out, resets);
    put<faults_layout>(out, faults);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr StoredCounts of(const can::Frame& frame) {
    StoredCounts out;
    out.cause = get<cause_layout, decltype(out.cause)>(frame);
    out.resets = get<resets_layout, decltype(out.resets)>(frame);
    out.faults = get<faults_layout, decltype(out.faults)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("Cause", "", cause, cause_layout);
    see("Resets", "", resets, resets_layout);
    see("Faults", "", faults, faults_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    { static constexpr std::array<ValueName, 7> names{{ValueName{0, "unknown"}, ValueName{1, "power on"}, ValueName{2, "pin"}, ValueName{3, "software"}, ValueName{4, "watchdog"}, ValueName{5, "brown-out"}, ValueName{6, "low power"}}}; see("Cause", "Cause of a reset.", std::span<const ValueName>(names)); }
    see("Resets", "Resets of this cause.", std::span<const ValueName>());
    see("Faults", "Faults of any kind. The last 16 are stored.", std::span<const ValueName>());
  }
};

/// Errors of the battery's CAN controller; on request, Command: stored data.
struct CanErrors {
  static constexpr const char* name = "CanErrors";
  static constexpr std::uint16_t id = 0x1ab;
  static constexpr std::uint32_t cycle_us = 0;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 427;
  static constexpr SignalLayout state_layout = {12, 4, false, 1.0F, 0.0F, 0.0F, 15.0F, false, 0};
  std::uint32_t state = 0;  ///< Fault confinement state (ISO 11898-1).
  static constexpr std::uint32_t state_absent = 0;
  static constexpr std::uint32_t state_starting = 1;
  static constexpr std::uint32_t state_active = 2;
  static constexpr std::uint32_t state_warning = 3;
  static constexpr std::uint32_t state_passive = 4;
  static constexpr std::uint32_t state_bus_off = 5;
  static constexpr SignalLayout transmit_errors_layout = {16, 8, false, 1.0F, 0.0F, 0.0F, 255.0F, false, 0};
  std::uint32_t transmit_errors = 0;  ///< Transmit error counter of the controller.
  static constexpr SignalLayout receive_errors_layout = {24, 8, false, 1.0F, 0.0F, 0.0F, 255.0F, false, 0};
  std::uint32_t receive_errors = 0;  ///< Receive error counter of the controller.
  static constexpr SignalLayout dropped_layout = {32, 12, false, 1.0F, 0.0F, 0.0F, 4095.0F, false, 0};
  std::uint32_t dropped = 0;  ///< Frames since the start that were not sent.
  static constexpr SignalLayout lost_layout = {44, 10, false, 1.0F, 0.0F, 0.0F, 1023.0F, false, 0};
  std::uint32_t lost = 0;  ///< Received frames since the start that were lost.
  static constexpr SignalLayout bus_offs_layout = {54, 5, false, 1.0F, 0.0F, 0.0F, 31.0F, false, 0};
  std::uint32_t bus_offs = 0;  ///< Times since the start that the controller was bus-off.
  static constexpr SignalLayout failed_starts_layout = {59, 5, false, 1.0F, 0.0F, 0.0F, 31.0F, false, 0};
  std::uint32_t failed_starts = 0;  ///< Times since the start that the bus did not become idle: stuck wire, or another bit rate.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<state_layout>(out, state);
    put<transmit_errors_layout>(out, transmit_errors);
    put<receive_errors_layout>(out, receive_errors);
    put<dropped_layout>(out, dropped);
    put<lost_layout>(out, lost);
    put<bus_offs_layout>(out, bus_offs);
    put<failed_starts_layout>(out, failed_starts);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr CanErrors of(const can::Frame& frame) {
    CanErrors out;
    out.state = get<state_layout, decltype(out.state)>(frame);
    out.transmit_errors = get<transmit_errors_layout, decltype(out.transmit_errors)>(frame);
    out.receive_errors = get<receive_errors_layout, decltype(out.receive_errors)>(frame);
    out.dropped = get<dropped_layout, decltype(out.dropped)>(frame);
    out.lost = get<lost_layout, decltype(out.lost)>(frame);
    out.bus_offs = get<bus_offs_layout, decltype(out.bus_offs)>(frame);
    out.failed_starts = get<failed_starts_layout, decltype(out.failed_starts)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("State", "", state, state_layout);
    see("TransmitErrors", "", transmit_errors, transmit_errors_layout);
    see("ReceiveErrors", "", receive_errors, receive_errors_layout);
    see("Dropped", "", dropped, dropped_layout);
    see("Lost", "", lost, lost_layout);
    see("BusOffs", "", bus_offs, bus_offs_layout);
    see("FailedStarts", "", failed_starts, failed_starts_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    { static constexpr std::array<ValueName, 6> names{{ValueName{0, "absent"}, ValueName{1, "starting"}, ValueName{2, "active"}, ValueName{3, "warning"}, ValueName{4, "passive"}, ValueName{5, "bus off"}}}; see("State", "Fault confinement state (ISO 11898-1).", std::span<const ValueName>(names)); }
    see("TransmitErrors", "Transmit error counter of the controller.", std::span<const ValueName>());
    see("ReceiveErrors", "Receive error counter of the controller.", std::span<const ValueName>());
    see("Dropped", "Frames since the start that were not sent.", std::span<const ValueName>());
    see("Lost", "Received frames since the start that were lost.", std::span<const ValueName>());
    see("BusOffs", "Times since the start that the controller was bus-off.", std::span<const ValueName>());
    see("FailedStarts", "Times since the start that the bus did not become idle: stuck wire, or another bit rate.", std::span<const ValueName>());
  }
};

/// Ends every request for power at once. Anybody may send it; it needs no key, wins over every request that arrives with the same sample, and has the highest priority on the bus.
struct Stop {
  static constexpr const char* name = "Stop";
  static constexpr std::uint16_t id = 0xa0;
  static constexpr std::uint32_t cycle_us = 0;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 160;
  static constexpr SignalLayout reason_layout = {12, 4, false, 1.0F, 0.0F, 0.0F, 15.0F, false, 0};
  std::uint32_t reason = 0;  ///< Free for the sender. Not evaluated.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<reason_layout>(out, reason);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr Stop of(const can::Frame& frame) {
    Stop out;
    out.reason = get<reason_layout, decltype(out.reason)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("Reason", "", reason, reason_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("Reason", "Free for the sender. Not evaluated.", std::span<const ValueName>());
  }
};

/// State of the service session; after each ServiceRequest and each change.
struct ServiceChallenge {
  static constexpr const char* name = "ServiceChallenge";
  static constexpr std::uint16_t id = 0x1af;
  static constexpr std::uint32_t cycle_us = 0;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 431;
  static constexpr SignalLayout state_layout = {12, 4, false, 1.0F, 0.0F, 0.0F, 15.0F, false, 0};
  std::uint32_t state = 0;  ///< State of the service session.
  static constexpr std::uint32_t state_not_needed = 0;
  static constexpr std::uint32_t state_closed = 1;
  static constexpr std::uint32_t state_challenge = 2;
  static constexpr std::uint32_t state_open = 3;
  static constexpr std::uint32_t state_locked = 4;
  static constexpr std::uint32_t state_no_key = 5;
  static constexpr SignalLayout challenge_low_layout = {16, 32, false, 1.0F, 0.0F, 0.0F, 4294967295.0F, false, 0};
  std::uint32_t challenge_low = 0;  ///< Lower 32 bits of the challenge. 0 unless the state is challenge or open.
  static constexpr SignalLayout challenge_high_layout = {48, 16, false, 1.0F, 0.0F, 0.0F, 65535.0F, false, 0};
  std::uint32_t challenge_high = 0;  ///< Upper 16 bits of the challenge.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<state_layout>(out, state);
    put<challenge_low_layout>(out, challenge_low);
    put<challenge_high_layout>(out, challenge_high);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr ServiceChallenge of(const can::Frame& frame) {
    ServiceChallenge out;
    out.state = get<state_layout, decltype(out.state)>(frame);
    out.challenge_low = get<challenge_low_layout, decltype(out.challenge_low)>(frame);
    out.challenge_high = get<challenge_high_layout, decltype(out.challenge_high)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("State", "", state, state_layout);
    see("ChallengeLow", "", challenge_low, challenge_low_layout);
    see("ChallengeHigh", "", challenge_high, challenge_high_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    { static constexpr std::array<ValueName, 6> names{{ValueName{0, "not needed"}, ValueName{1, "closed"}, ValueName{2, "challenge"}, ValueName{3, "open"}, ValueName{4, "locked"}, ValueName{5, "no key"}}}; see("State", "State of the service session.", std::span<const ValueName>(names)); }
    see("ChallengeLow", "Lower 32 bits of the challenge. 0 unless the state is challenge or open.", std::span<const ValueName>());
    see("ChallengeHigh", "Upper 16 bits of the challenge.", std::span<const ValueName>());
  }
};

/// Opens and closes a service session.
struct ServiceRequest {
  static constexpr const char* name = "ServiceRequest";
  static constexpr std::uint16_t id = 0x1b0;
  static constexpr std::uint32_t cycle_us = 0;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 432;
  static constexpr SignalLayout kind_layout = {12, 4, false, 1.0F, 0.0F, 0.0F, 15.0F, false, 0};
  std::uint32_t kind = 0;  ///< What is wanted.
  static constexpr std::uint32_t kind_challenge = 0;
  static constexpr std::uint32_t kind_response = 1;
  static constexpr std::uint32_t kind_close = 2;
  static constexpr SignalLayout operator_number_layout = {16, 16, false, 1.0F, 0.0F, 0.0F, 65535.0F, false, 0};
  std::uint32_t operator_number = 0;  ///< Who answers for what the session does; stored with each action. Of a response.
  static constexpr SignalLayout code_layout = {32, 32, false, 1.0F, 0.0F, 0.0F, 4294967295.0F, false, 0};
  std::uint32_t code = 0;  ///< Code of the session (firmware/authentication/codes.hpp). Of a response.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<kind_layout>(out, kind);
    put<operator_number_layout>(out, operator_number);
    put<code_layout>(out, code);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr ServiceRequest of(const can::Frame& frame) {
    ServiceRequest out;
    out.kind = get<kind_layout, decltype(out.kind)>(frame);
    out.operator_number = get<operator_number_layout, decltype(out.operator_number)>(frame);
    out.code = get<code_layout, decltype(out.code)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("Kind", "", kind, kind_layout);
    see("OperatorNumber", "", operator_number, operator_number_layout);
    see("Code", "", code, code_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    { static constexpr std::array<ValueName, 3> names{{ValueName{0, "challenge"}, ValueName{1, "response"}, ValueName{2, "close"}}}; see("Kind", "What is wanted.", std::span<const ValueName>(names)); }
    see("OperatorNumber", "Who answers for what the session does; stored with each action. Of a response.", std::span<const ValueName>());
    see("Code", "Code of the session (firmware/authentication/codes.hpp). Of a response.", std::span<const ValueName>());
  }
};

/// Authority for the frame Command that follows, which clears, calibrates or sets the time. In an open service session.
struct CommandAuthority {
  static constexpr const char* name = "CommandAuthority";
  static constexpr std::uint16_t id = 0x1b1;
  static constexpr std::uint32_t cycle_us = 0;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 433;
  static constexpr SignalLayout sequence_layout = {16, 16, false, 1.0F, 0.0F, 0.0F, 65535.0F, false, 0};
  std::uint32_t sequence = 0;  ///< Above that of the last command of the session.
  static constexpr SignalLayout code_layout = {32, 32, false, 1.0F, 0.0F, 0.0F, 4294967295.0F, false, 0};
  std::uint32_t code = 0;  ///< Code of the command (firmware/authentication/codes.hpp).

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<sequence_layout>(out, sequence);
    put<code_layout>(out, code);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr CommandAuthority of(const can::Frame& frame) {
    CommandAuthority out;
    out.sequence = get<sequence_layout, decltype(out.sequence)>(frame);
    out.code = get<code_layout, decltype(out.code)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("Sequence", "", sequence, sequence_layout);
    see("Code", "", code, code_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("Sequence", "Above that of the last command of the session.", std::span<const ValueName>());
    see("Code", "Code of the command (firmware/authentication/codes.hpp).", std::span<const ValueName>());
  }
};

/// Request for power that cannot be forged or repeated; takes the place of the command request.
struct DriveRequest {
  static constexpr const char* name = "DriveRequest";
  static constexpr std::uint16_t id = 0x1b2;
  static constexpr std::uint32_t cycle_us = 0;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 434;
  static constexpr SignalLayout request_layout = {12, 4, false, 1.0F, 0.0F, 0.0F, 15.0F, false, 0};
  std::uint32_t request = 0;  ///< What is wanted, to be repeated within 5 s. None needs no code.
  static constexpr std::uint32_t request_none = 0;
  static constexpr std::uint32_t request_drive = 1;
  static constexpr std::uint32_t request_charge = 2;
  static constexpr SignalLayout freshness_layout = {16, 16, false, 1.0F, 0.0F, 0.0F, 65535.0F, false, 0};
  std::uint32_t freshness = 0;  ///< Above that of the last request under this challenge.
  static constexpr SignalLayout code_layout = {32, 32, false, 1.0F, 0.0F, 0.0F, 4294967295.0F, false, 0};
  std::uint32_t code = 0;  ///< Code of the request (firmware/authentication/codes.hpp).

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<request_layout>(out, request);
    put<freshness_layout>(out, freshness);
    put<code_layout>(out, code);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr DriveRequest of(const can::Frame& frame) {
    DriveRequest out;
    out.request = get<request_layout, decltype(out.request)>(frame);
    out.freshness = get<freshness_layout, decltype(out.freshness)>(frame);
    out.code = get<code_layout, decltype(out.code)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("Request", "", request, request_layout);
    see("Freshness", "", freshness, freshness_layout);
    see("Code", "", code, code_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    { static constexpr std::array<ValueName, 3> names{{ValueName{0, "none"}, ValueName{1, "drive"}, ValueName{2, "charge"}}}; see("Request", "What is wanted, to be repeated within 5 s. None needs no code.", std::span<const ValueName>(names)); }
    see("Freshness", "Above that of the last request under this challenge.", std::span<const ValueName>());
    see("Code", "Code of the request (firmware/authentication/codes.hpp).", std::span<const ValueName>());
  }
};

/// What a DriveRequest is made with; new at each start and when the freshness is used up. Not sent by an image for development without a key, which follows every request.
struct RequestChallenge {
  static constexpr const char* name = "RequestChallenge";
  static constexpr std::uint16_t id = 0x1b3;
  static constexpr std::uint32_t cycle_us = 1000000;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 435;
  static constexpr SignalLayout state_layout = {12, 4, false, 1.0F, 0.0F, 0.0F, 15.0F, false, 0};
  std::uint32_t state = 0;  ///< Which requests are followed: those of the message DriveRequest, or none, because the battery has no key.
  static constexpr std::uint32_t state_drive_request = 1;
  static constexpr std::uint32_t state_no_key = 2;
  static constexpr SignalLayout challenge_low_layout = {16, 32, false, 1.0F, 0.0F, 0.0F, 4294967295.0F, false, 0};
  std::uint32_t challenge_low = 0;  ///< Lower 32 bits of the challenge.
  static constexpr SignalLayout challenge_high_layout = {48, 16, false, 1.0F, 0.0F, 0.0F, 65535.0F, false, 0};
  std::uint32_t challenge_high = 0;  ///< Upper 16 bits of the challenge.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<state_layout>(out, state);
    put<challenge_low_layout>(out, challenge_low);
    put<challenge_high_layout>(out, challenge_high);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr RequestChallenge of(const can::Frame& frame) {
    RequestChallenge out;
    out.state = get<state_layout, decltype(out.state)>(frame);
    out.challenge_low = get<challenge_low_layout, decltype(out.challenge_low)>(frame);
    out.challenge_high = get<challenge_high_layout, decltype(out.challenge_high)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("State", "", state, state_layout);
    see("ChallengeLow", "", challenge_low, challenge_low_layout);
    see("ChallengeHigh", "", challenge_high, challenge_high_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    { static constexpr std::array<ValueName, 2> names{{ValueName{1, "drive request"}, ValueName{2, "no key"}}}; see("State", "Which requests are followed: those of the message DriveRequest, or none, because the battery has no key.", std::span<const ValueName>(names)); }
    see("ChallengeLow", "Lower 32 bits of the challenge.", std::span<const ValueName>());
    see("ChallengeHigh", "Upper 16 bits of the challenge.", std::span<const ValueName>());
  }
};

/// One of the last sixteen actions of service sessions; on request, Command: stored data.
struct StoredAction {
  static constexpr const char* name = "StoredAction";
  static constexpr std::uint16_t id = 0x1b4;
  static constexpr std::uint32_t cycle_us = 0;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 436;
  static constexpr SignalLayout index_layout = {12, 4, false, 1.0F, 0.0F, 0.0F, 15.0F, false, 0};
  std::uint32_t index = 0;  ///< 0 for the newest.
  static constexpr SignalLayout code_layout = {16, 8, false, 1.0F, 0.0F, 0.0F, 255.0F, false, 0};
  std::uint32_t code = 0;  ///< Code of the command; or of the session. 0: no action.
  static constexpr std::uint32_t code_clear_faults = 1;
  static constexpr std::uint32_t code_set_time = 3;
  static constexpr std::uint32_t code_voltage_gain = 5;
  static constexpr std::uint32_t code_voltage_offset = 6;
  static constexpr std::uint32_t code_current_gain = 7;
  static constexpr std::uint32_t code_current_offset = 8;
  static constexpr std::uint32_t code_apply_parameters = 12;
  static constexpr std::uint32_t code_switch_off = 13;
  static constexpr std::uint32_t code_session_opened = 128;
  static constexpr std::uint32_t code_session_locked = 129;
  static constexpr SignalLayout time_layout = {24, 32, false, 1.0F, 0.0F, 0.0F, 4294967295.0F, false, 0};
  std::uint32_t time = 0;  ///< [s] Seconds since 1970-01-01 UTC if the calendar ran (above 946684800), else time in operation.
  static constexpr SignalLayout number_layout = {56, 8, false, 1.0F, 0.0F, 0.0F, 255.0F, false, 0};
  std::uint32_t number = 0;  ///< Number of the action, modulo 256; the same in StoredActionDetail.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<index_layout>(out, index);
    put<code_layout>(out, code);
    put<time_layout>(out, time);
    put<number_layout>(out, number);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr StoredAction of(const can::Frame& frame) {
    StoredAction out;
    out.index = get<index_layout, decltype(out.index)>(frame);
    out.code = get<code_layout, decltype(out.code)>(frame);
    out.time = get<time_layout, decltype(out.time)>(frame);
    out.number = get<number_layout, decltype(out.number)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("Index", "", index, index_layout);
    see("Code", "", code, code_layout);
    see("Time", "s", time, time_layout);
    see("Number", "", number, number_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("Index", "0 for the newest.", std::span<const ValueName>());
    { static constexpr std::array<ValueName, 10> names{{ValueName{1, "clear faults"}, ValueName{3, "set time"}, ValueName{5, "voltage gain"}, ValueName{6, "voltage offset"}, ValueName{7, "current gain"}, ValueName{8, "current offset"}, ValueName{12, "apply parameters"}, ValueName{13, "switch off"}, ValueName{128, "session opened"}, ValueName{129, "session locked"}}}; see("Code", "Code of the command; or of the session. 0: no action.", std::span<const ValueName>(names)); }
    see("Time", "Seconds since 1970-01-01 UTC if the calendar ran (above 946684800), else time in operation.", std::span<const ValueName>());
    see("Number", "Number of the action, modulo 256; the same in StoredActionDetail.", std::span<const ValueName>());
  }
};

/// The rest of a StoredAction; after it.
struct StoredActionDetail {
  static constexpr const char* name = "StoredActionDetail";
  static constexpr std::uint16_t id = 0x1b5;
  static constexpr std::uint32_t cycle_us = 0;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 437;
  static constexpr SignalLayout index_layout = {12, 4, false, 1.0F, 0.0F, 0.0F, 15.0F, false, 0};
  std::uint32_t index = 0;  ///< As in StoredAction.
  static constexpr SignalLayout operator_number_layout = {16, 16, false, 1.0F, 0.0F, 0.0F, 65535.0F, false, 0};
  std::uint32_t operator_number = 0;  ///< Who opened the session.
  static constexpr SignalLayout argument_layout = {32, 32, false, 1.0F, 0.0F, 0.0F, 4294967295.0F, false, 0};
  std::uint32_t argument = 0;  ///< Argument of the command.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<index_layout>(out, index);
    put<operator_number_layout>(out, operator_number);
    put<argument_layout>(out, argument);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr StoredActionDetail of(const can::Frame& frame) {
    StoredActionDetail out;
    out.index = get<index_layout, decltype(out.index)>(frame);
    out.operator_number = get<operator_number_layout, decltype(out.operator_number)>(frame);
    out.argument = get<argument_layout, decltype(out.argument)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("Index", "", index, index_layout);
    see("OperatorNumber", "", operator_number, operator_number_layout);
    see("Argument", "", argument, argument_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("Index", "As in StoredAction.", std::span<const ValueName>());
    see("OperatorNumber", "Who opened the session.", std::span<const ValueName>());
    see("Argument", "Argument of the command.", std::span<const ValueName>());
  }
};

/// A parameter of the battery, four frames; on request, Command: read parameters. firmware/parameters/README.md.
struct ParameterValue {
  static constexpr const char* name = "ParameterValue";
  static constexpr std::uint16_t id = 0x1b6;
  static constexpr std::uint32_t cycle_us = 0;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 438;
  static constexpr SignalLayout kind_layout = {12, 4, false, 1.0F, 0.0F, 0.0F, 15.0F, false, 0};
  std::uint32_t kind = 0;  ///< What Value is. Of the block (number 0): its CRC-32, revision and state.
  static constexpr std::uint32_t kind_value = 0;
  static constexpr std::uint32_t kind_lowest = 1;
  static constexpr std::uint32_t kind_highest = 2;
  static constexpr std::uint32_t kind_initial = 3;
  static constexpr SignalLayout number_layout = {16, 8, false, 1.0F, 0.0F, 0.0F, 255.0F, false, 0};
  std::uint32_t number = 0;  ///< Number of the parameter; 0: the block of all parameters.
  static constexpr std::uint32_t number_block = 0;
  static constexpr std::uint32_t number_cell_voltage_max = 1;
  static constexpr std::uint32_t number_cell_voltage_min = 2;
  static constexpr std::uint32_t number_charge_current_max = 3;
  static constexpr std::uint32_t number_discharge_current_max = 4;
  static constexpr std::uint32_t number_temperature_max = 5;
  static constexpr std::uint32_t number_temperature_min = 6;
  static constexpr std::uint32_t number_charge_temperature_min = 7;
  static constexpr std::uint32_t number_voltage_delay = 8;
  static constexpr std::uint32_t number_temperature_delay = 9;
  static constexpr std::uint32_t number_capacity = 10;
  static constexpr std::uint32_t number_shunt = 11;
  static constexpr std::uint32_t number_precharge_time = 12;
  static constexpr std::uint32_t number_closing_difference = 13;
  static constexpr std::uint32_t number_can_bit_rate = 14;
  static constexpr std::uint32_t number_can_base = 15;
  static constexpr std::uint32_t number_can_stop = 16;
  static constexpr std::uint32_t number_canopen_node = 17;
  static constexpr std::uint32_t number_canopen_charger = 18;
  static constexpr std::uint32_t number_inputs_fitted = 19;
  static constexpr std::uint32_t number_group_node = 20;
  static constexpr std::uint32_t number_group_batteries = 21;
  static constexpr SignalLayout value_layout = {24, 32, true, 1.0F, 0.0F, -2147483648.0F, 2147483647.0F, false, 0};
  std::int32_t value = 0;  ///< In the unit of the parameter.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<kind_layout>(out, kind);
    put<number_layout>(out, number);
    put<value_layout>(out, value);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr ParameterValue of(const can::Frame& frame) {
    ParameterValue out;
    out.kind = get<kind_layout, decltype(out.kind)>(frame);
    out.number = get<number_layout, decltype(out.number)>(frame);
    out.value = get<value_layout, decltype(out.value)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("Kind", "", kind, kind_layout);
    see("Number", "", number, number_layout);
    see("Value", "", value, value_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    { static constexpr std::array<ValueName, 4> names{{ValueName{0, "value"}, ValueName{1, "lowest"}, ValueName{2, "highest"}, ValueName{3, "initial"}}}; see("Kind", "What Value is. Of the block (number 0): its CRC-32, revision and state.", std::span<const ValueName>(names)); }
    { static constexpr std::array<ValueName, 22> names{{ValueName{0, "block"}, ValueName{1, "cell voltage max"}, ValueName{2, "cell voltage min"}, ValueName{3, "charge current max"}, ValueName{4, "discharge current max"}, ValueName{5, "temperature max"}, ValueName{6, "temperature min"}, ValueName{7, "charge temperature min"}, ValueName{8, "voltage delay"}, ValueName{9, "temperature delay"}, ValueName{10, "capacity"}, ValueName{11, "shunt"}, ValueName{12, "precharge time"}, ValueName{13, "closing difference"}, ValueName{14, "can bit rate"}, ValueName{15, "can base"}, ValueName{16, "can stop"}, ValueName{17, "canopen node"}, ValueName{18, "canopen charger"}, ValueName{19, "inputs fitted"}, ValueName{20, "group node"}, ValueName{21, "group batteries"}}}; see("Number", "Number of the parameter; 0: the block of all parameters.", std::span<const ValueName>(names)); }
    see("Value", "In the unit of the parameter.", std::span<const ValueName>());
  }
};

/// Current of a battery whose row short circuit is above 655 A, where PackElectrical ends. Of others it is not sent.
struct PackCurrent {
  static constexpr const char* name = "PackCurrent";
  static constexpr std::uint16_t id = 0x18b;
  static constexpr std::uint32_t cycle_us = 100000;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 395;
  static constexpr SignalLayout current_layout = {16, 32, true, 0.001F, 0.0F, -2147483.647F, 2147483.647F, true, -2147483648};
  std::int32_t current = 0;  ///< [A] Positive: charging.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<current_layout>(out, current);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr PackCurrent of(const can::Frame& frame) {
    PackCurrent out;
    out.current = get<current_layout, decltype(out.current)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("Current", "A", current, current_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("Current", "Positive: charging.", std::span<const ValueName>());
  }
};

/// Currents that the battery carries for ten and for thirty seconds from now, at most the ratings of the cell file. They go down with the heat of earlier pulses, and are AllowedCurrent while that is derated. Only of packs whose cell file rates pulses.
struct PulseCurrents {
  static constexpr const char* name = "PulseCurrents";
  static constexpr std::uint16_t id = 0x18c;
  static constexpr std::uint32_t cycle_us = 200000;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 396;
  static constexpr SignalLayout discharge_ten_seconds_layout = {12, 13, false, 0.25F, 0.0F, 0.0F, 2047.5F, true, 8191};
  float discharge_ten_seconds = unknown;  ///< [A] Out of the pack, for ten seconds.
  static constexpr SignalLayout discharge_thirty_seconds_layout = {25, 13, false, 0.25F, 0.0F, 0.0F, 2047.5F, true, 8191};
  float discharge_thirty_seconds = unknown;  ///< [A] Out of the pack, for thirty seconds.
  static constexpr SignalLayout charge_ten_seconds_layout = {38, 13, false, 0.25F, 0.0F, 0.0F, 2047.5F, true, 8191};
  float charge_ten_seconds = unknown;  ///< [A] Into the pack, for ten seconds.
  static constexpr SignalLayout charge_thirty_seconds_layout = {51, 13, false, 0.25F, 0.0F, 0.0F, 2047.5F, true, 8191};
  float charge_thirty_seconds = unknown;  ///< [A] Into the pack, for thirty seconds.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<discharge_ten_seconds_layout>(out, discharge_ten_seconds);
    put<discharge_thirty_seconds_layout>(out, discharge_thirty_seconds);
    put<charge_ten_seconds_layout>(out, charge_ten_seconds);
    put<charge_thirty_seconds_layout>(out, charge_thirty_seconds);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr PulseCurrents of(const can::Frame& frame) {
    PulseCurrents out;
    out.discharge_ten_seconds = get<discharge_ten_seconds_layout, decltype(out.discharge_ten_seconds)>(frame);
    out.discharge_thirty_seconds = get<discharge_thirty_seconds_layout, decltype(out.discharge_thirty_seconds)>(frame);
    out.charge_ten_seconds = get<charge_ten_seconds_layout, decltype(out.charge_ten_seconds)>(frame);
    out.charge_thirty_seconds = get<charge_thirty_seconds_layout, decltype(out.charge_thirty_seconds)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("DischargeTenSeconds", "A", discharge_ten_seconds, discharge_ten_seconds_layout);
    see("DischargeThirtySeconds", "A", discharge_thirty_seconds, discharge_thirty_seconds_layout);
    see("ChargeTenSeconds", "A", charge_ten_seconds, charge_ten_seconds_layout);
    see("ChargeThirtySeconds", "A", charge_thirty_seconds, charge_thirty_seconds_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("DischargeTenSeconds", "Out of the pack, for ten seconds.", std::span<const ValueName>());
    see("DischargeThirtySeconds", "Out of the pack, for thirty seconds.", std::span<const ValueName>());
    see("ChargeTenSeconds", "Into the pack, for ten seconds.", std::span<const ValueName>());
    see("ChargeThirtySeconds", "Into the pack, for thirty seconds.", std::span<const ValueName>());
  }
};

/// Cells 25 to 28, counted from the negative end. Sent by packs of more than 24 cells.
struct CellVoltages7 {
  static constexpr const char* name = "CellVoltages7";
  static constexpr std::uint16_t id = 0x1bb;
  static constexpr std::uint32_t cycle_us = 500000;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 443;
  static constexpr SignalLayout cell25_layout = {12, 13, false, 0.001F, 0.0F, 0.0F, 8.19F, true, 8191};
  float cell25 = unknown;  ///< [V] Voltage of this cell. Not known if the pack has fewer cells.
  static constexpr SignalLayout cell26_layout = {25, 13, false, 0.001F, 0.0F, 0.0F, 8.19F, true, 8191};
  float cell26 = unknown;  ///< [V] Voltage of this cell. Not known if the pack has fewer cells.
  static constexpr SignalLayout cell27_layout = {38, 13, false, 0.001F, 0.0F, 0.0F, 8.19F, true, 8191};
  float cell27 = unknown;  ///< [V] Voltage of this cell. Not known if the pack has fewer cells.
  static constexpr SignalLayout cell28_layout = {51, 13, false, 0.001F, 0.0F, 0.0F, 8.19F, true, 8191};
  float cell28 = unknown;  ///< [V] Voltage of this cell. Not known if the pack has fewer cells.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<cell25_layout>(out, cell25);
    put<cell26_layout>(out, cell26);
    put<cell27_layout>(out, cell27);
    put<cell28_layout>(out, cell28);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr CellVoltages7 of(const can::Frame& frame) {
    CellVoltages7 out;
    out.cell25 = get<cell25_layout, decltype(out.cell25)>(frame);
    out.cell26 = get<cell26_layout, decltype(out.cell26)>(frame);
    out.cell27 = get<cell27_layout, decltype(out.cell27)>(frame);
    out.cell28 = get<cell28_layout, decltype(out.cell28)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("Cell25", "V", cell25, cell25_layout);
    see("Cell26", "V", cell26, cell26_layout);
    see("Cell27", "V", cell27, cell27_layout);
    see("Cell28", "V", cell28, cell28_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("Cell25", "Voltage of this cell. Not known if the pack has fewer cells.", std::span<const ValueName>());
    see("Cell26", "Voltage of this cell. Not known if the pack has fewer cells.", std::span<const ValueName>());
    see("Cell27", "Voltage of this cell. Not known if the pack has fewer cells.", std::span<const ValueName>());
    see("Cell28", "Voltage of this cell. Not known if the pack has fewer cells.", std::span<const ValueName>());
  }
};

/// Cells 29 to 32, counted from the negative end. Sent by packs of more than 28 cells.
struct CellVoltages8 {
  static constexpr const char* name = "CellVoltages8";
  static constexpr std::uint16_t id = 0x1bc;
  static constexpr std::uint32_t cycle_us = 500000;  ///< 0: not cyclic
  static constexpr std::uint16_t data_id = 444;
  static constexpr SignalLayout cell29_layout = {12, 13, false, 0.001F, 0.0F, 0.0F, 8.19F, true, 8191};
  float cell29 = unknown;  ///< [V] Voltage of this cell. Not known if the pack has fewer cells.
  static constexpr SignalLayout cell30_layout = {25, 13, false, 0.001F, 0.0F, 0.0F, 8.19F, true, 8191};
  float cell30 = unknown;  ///< [V] Voltage of this cell. Not known if the pack has fewer cells.
  static constexpr SignalLayout cell31_layout = {38, 13, false, 0.001F, 0.0F, 0.0F, 8.19F, true, 8191};
  float cell31 = unknown;  ///< [V] Voltage of this cell. Not known if the pack has fewer cells.
  static constexpr SignalLayout cell32_layout = {51, 13, false, 0.001F, 0.0F, 0.0F, 8.19F, true, 8191};
  float cell32 = unknown;  ///< [V] Voltage of this cell. Not known if the pack has fewer cells.

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{id, 8, {}, false};
    put<cell29_layout>(out, cell29);
    put<cell30_layout>(out, cell30);
    put<cell31_layout>(out, cell31);
    put<cell32_layout>(out, cell32);
    protect(out, data_id, counter);
    return out;
  }
  static constexpr CellVoltages8 of(const can::Frame& frame) {
    CellVoltages8 out;
    out.cell29 = get<cell29_layout, decltype(out.cell29)>(frame);
    out.cell30 = get<cell30_layout, decltype(out.cell30)>(frame);
    out.cell31 = get<cell31_layout, decltype(out.cell31)>(frame);
    out.cell32 = get<cell32_layout, decltype(out.cell32)>(frame);
    return out;
  }
  /// Calls see(name, unit, value, layout) for each signal.
  template <class See>
  constexpr void each(See&& see) {
    see("Cell29", "V", cell29, cell29_layout);
    see("Cell30", "V", cell30, cell30_layout);
    see("Cell31", "V", cell31, cell31_layout);
    see("Cell32", "V", cell32, cell32_layout);
  }
  /// Calls see(name, comment, names of values) for each signal: texts for people.
  template <class See>
  static void each_in_words(See&& see) {
    see("Cell29", "Voltage of this cell. Not known if the pack has fewer cells.", std::span<const ValueName>());
    see("Cell30", "Voltage of this cell. Not known if the pack has fewer cells.", std::span<const ValueName>());
    see("Cell31", "Voltage of this cell. Not known if the pack has fewer cells.", std::span<const ValueName>());
    see("Cell32", "Voltage of this cell. Not known if the pack has fewer cells.", std::span<const ValueName>());
  }
};

/// All messages.
using Messages = std::tuple<PackState, PackElectrical, Status, Identity, LastFaultAddress, LastFaultCause, CurrentLimits, Health, SocAnchor, ModelDetail, SensorErrors, CellVoltages1, CellVoltages2, CellVoltages3, CellVoltages4, CellVoltages5, CellVoltages6, PackVoltage, CellExtremes, Temperatures, SampleCurrent, SampleVoltage, SampleTime, EstimateHash, StartingSoc, StartingSigma, Command, CommandAnswer, Faults, MoreFaults, ContactorState, Balancing, AllowedCurrent, Storage, FrontEnd, Board, TruckInputs, StoredFault, StoredFaultPack, StoredFaultCells, StoredUse, StoredThroughput, StoredExtremes, StoredCounts, CanErrors, Stop, ServiceChallenge, ServiceRequest, CommandAuthority, DriveRequest, RequestChallenge, StoredAction, StoredActionDetail, ParameterValue, PackCurrent, PulseCurrents, CellVoltages7, CellVoltages8>;

}  // namespace bms::can
