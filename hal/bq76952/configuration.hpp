// Content of the chip's data memory for a board, as a table that is written in CONFIG_UPDATE mode and read back; and
// what the driver has to know of the board.
//
// The chip's own protections are the second line. Their thresholds and delays come from the first line
// (firmware/protection/), so that they are wider and slower; firmware/front_end/ computes and compares them. They act
// on pins of their own (DDSG and DCHG to the enable inputs of the contactor drivers), and also if this core has not
// communicated for host_silence_s.
//
// Addresses and fields: SLUUBY2B, chapter 13. README.md lists those that could not be checked there.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>

namespace bms::hal::bq76952 {

inline constexpr std::size_t cell_inputs = 16;

/// Inputs of a pack of `cells` cells, 2 to 16, one bit each: its highest cell is between VC16 and VC15, the others are
/// the lowest ones. Unused inputs are connected to their neighbour.
constexpr std::uint16_t inputs_of_pack(std::size_t cells) {
  return static_cast<std::uint16_t>(((1U << (cells - 1)) - 1) | 1U << (cell_inputs - 1));
}

/// Cells of the chip at the negative end: all, or the larger half of a pack of more than 16 cells, which has two chips.
constexpr std::size_t lower_cells(std::size_t cells) { return cells > cell_inputs ? (cells + 1) / 2 : cells; }

/// Components around the chip, and thresholds of its own protections. A threshold is rounded away from the normal range
/// to the next step of the chip.
struct Board {
  double shunt_mohm = 0.1;
  double current_range_a = 327;               ///< a sample must be able to state this current: current_end_a()
  std::uint16_t cell_inputs = 0xFFFF;         ///< one bit per connected input
  bool four_thermistors = true;               ///< false: at TS1 and TS3 only
  double overvoltage_v, undervoltage_v;       ///< of a cell; steps of 50.6 mV
  double voltage_delay_s;                     ///< 0.01 to 6.7
  double overcurrent_a, overcurrent_delay_s;  ///< both directions; steps of 2 mV at the shunt; 0.01 to 0.425 s
  double high_overcurrent_a, high_overcurrent_delay_s;  ///< discharge only; the same steps
  double short_circuit_a;                               ///< discharge only; steps of the table below
  double short_circuit_delay_us = 450;                  ///< 15 to 450
  // Mean of 250 ms and the four thermistors; whole seconds up to 255, whole degrees C.
  double sustained_a = 400, sustained_delay_s = 20;  ///< discharge only; a current that is within the reading's range
  int charge_hot_c = 120, discharge_hot_c = 120, charge_cold_c = -40;
  std::uint8_t temperature_delay_s = 20;
  std::uint16_t host_silence_s = 3;
};

// ---- scale of the current ----

/// Unit of the chip's 16-bit current (userA) [uA]: 10 mA, or 100 mA for a range above 327 A.
constexpr std::int32_t current_step_ua(const Board& b) { return b.current_range_a > 327 ? 100'000 : 10'000; }
/// End of the range [A]: of 16 bits, of the specified +-200 mV at the shunt, and of a sample. A larger current reads as
/// the end of the range.
constexpr double current_end_a(const Board& b) {
  return std::min({32'767e-6 * current_step_ua(b), 200 / b.shunt_mohm, 2'100.0});
}

inline constexpr std::int32_t voltage_step_uv = 10'000;  // userV
// Comm Type: CRC above 100 kHz. 0x11 is CRC up to 100 kHz (SLUUCG7 and SLUUBY1B, data memory); the bus has 400 kHz.
inline constexpr std::uint8_t crc_over_fast_i2c = 0x12;
inline constexpr std::uint16_t default_alarm_mask = 0xF882;  // factory value and the end of each scan

// Faults that turn DSG and CHG off [13.3.3]: registers A and C. With these values of A they act at once.
inline constexpr std::uint8_t dsg_faults_a = 0xE4, dsg_faults_c = 0xE2;  // SCD, OCD2, OCD1, CUV; OCD3, SCDL, OCDL, HWDF
inline constexpr std::uint8_t chg_faults_a = 0x98, chg_faults_c = 0x56;  // SCD, OCC, COV; SCDL, COVL, PTO, HWDF
// Those of the temperatures, register B: OTF, OTINT, OTD, UTINT, UTD; OTF, OTINT, OTC, UTINT, UTC. The factory values.
inline constexpr std::uint8_t dsg_faults_b = 0xE6, chg_faults_b = 0xD5;
// Enabled Protections. What is off stands with its reason in docs/safety/assumptions.md, L-24.
inline constexpr std::uint8_t enabled_protections_a = 0xFC;  // SCD, OCD2, OCD1, OCC, COV, CUV
inline constexpr std::uint8_t enabled_protections_b = 0x31;  // OTD, OTC, UTC
inline constexpr std::uint8_t enabled_protections_c = 0xC2;  // OCD3, SCDL, HWDF

// ---- settings ----

struct Setting {
  std::uint16_t address;
  std::uint8_t bytes;
  std::uint32_t value;  ///< little-endian in the memory
};

inline constexpr double cell_step_v = 0.0506, shunt_step_mv = 2;
inline constexpr std::array<double, 16> short_circuit_mv{10,  20,  40,  60,  80,  100, 125, 150,
                                                         175, 200, 250, 300, 350, 400, 450, 500};

namespace detail {

constexpr std::uint32_t nearest(double value) { return static_cast<std::uint32_t>(value + 0.5); }
constexpr std::uint32_t at_least(double value) {  // a remainder of rounding errors does not count
  const auto whole = static_cast<std::uint32_t>(value);
  return value - whole > 1e-6 ? whole + 1 : whole;
}
constexpr std::uint32_t comparator_delay(double s) { return nearest(s / 0.0033) - 2; }
constexpr std::uint32_t shunt_steps(const Board& b, double a) {
  return std::max<std::uint32_t>(at_least(a * b.shunt_mohm / shunt_step_mv), 2);
}
constexpr std::uint32_t short_circuit_step(const Board& b) {
  std::uint32_t k = 0;
  while (k + 1 < short_circuit_mv.size() && short_circuit_mv[k] < b.short_circuit_a * b.shunt_mohm - 1e-6) ++k;
  return k;
}

inline constexpr std::uint32_t most_charge_steps = 62, most_discharge_steps = 100;  // OCC; OCD1 and OCD2

/// Of OCD3: minus the current in userA.
constexpr std::uint32_t minus_user_a(const Board& b, double a) {
  return 0x10000 - nearest(1e6 * a / current_step_ua(b));
}
constexpr std::uint32_t byte_of(int celsius) { return static_cast<std::uint8_t>(celsius); }
inline constexpr int temperature_hysteresis_c = 3;

}  // namespace detail

/// The settings of a board, in the order of their addresses.
constexpr auto settings(const Board& b) {
  using namespace detail;
  const double cc_gain = 7.5684 / b.shunt_mohm;  // [4.12]: 1.24 V / (5 x 32768 x shunt)
  const auto floating = [](double value) { return std::bit_cast<std::uint32_t>(static_cast<float>(value)); };
  const auto charge_steps = std::min(shunt_steps(b, b.overcurrent_a), most_charge_steps),
             discharge_steps = std::min(shunt_steps(b, b.overcurrent_a), most_discharge_steps),
             high_steps = std::min(shunt_steps(b, b.high_overcurrent_a), most_discharge_steps);
  const std::uint32_t further = b.four_thermistors ? 0x07 : 0x00;
  constexpr std::uint16_t rest_ma = 1'000, minus_rest_ma = 0xFC18;
  return std::array{
      Setting{0x91A8, 4, floating(cc_gain)},                 // CC Gain
      Setting{0x91AC, 4, floating(cc_gain * 298'261.6178)},  // Capacity Gain [4.12]
      Setting{0x9234, 2, 0x28C2},  // Power Config: no SLEEP; FASTADC: all cells in 31.5 ms, stack and LD in 94.5
      Setting{0x9236, 1, 0x0D},    // REG12 Config: REG1 at 3.3 V, for the pins below
      Setting{0x9237, 1, 0x01},    // REG0 Config: the pre-regulator of REG1
      Setting{0x9239, 1, crc_over_fast_i2c},  // Comm Type
      // Shutdown Temperature: the factory value 85 degrees C of the die opens main plus under load, and only LD or TS2
      // ends SHUTDOWN
      Setting{0x9244, 1, 110}, Setting{0x925F, 2, 0x0002},  // Protection Configuration: no latch ends by a current
      Setting{0x9261, 1, enabled_protections_a}, Setting{0x9262, 1, enabled_protections_b},
      Setting{0x9263, 1, enabled_protections_c}, Setting{0x9265, 1, chg_faults_a},  // CHG FET Protections
      Setting{0x9266, 1, chg_faults_b}, Setting{0x9267, 1, chg_faults_c},
      Setting{0x9269, 1, dsg_faults_a},  // DSG FET Protections
      Setting{0x926A, 1, dsg_faults_b}, Setting{0x926B, 1, dsg_faults_c},
      Setting{0x926D, 2, default_alarm_mask},                                          // Default Alarm Mask
      Setting{0x9275, 1, static_cast<std::uint32_t>(b.undervoltage_v / cell_step_v)},  // CUV Threshold
      Setting{0x9276, 2, comparator_delay(b.voltage_delay_s)},                         // CUV Delay
      Setting{0x9278, 1, at_least(b.overvoltage_v / cell_step_v)},                     // COV Threshold
      Setting{0x9279, 2, comparator_delay(b.voltage_delay_s)},                         // COV Delay
      Setting{0x9280, 1, charge_steps},                                                // OCC Threshold
      Setting{0x9281, 1, comparator_delay(b.overcurrent_delay_s)},                     // OCC Delay
      Setting{0x9282, 1, discharge_steps},                                             // OCD1 Threshold
      Setting{0x9283, 1, comparator_delay(b.overcurrent_delay_s)},                     // OCD1 Delay
      Setting{0x9284, 1, high_steps},                                                  // OCD2 Threshold
      Setting{0x9285, 1, comparator_delay(b.high_overcurrent_delay_s)},                // OCD2 Delay
      Setting{0x9286, 1, short_circuit_step(b)},                                       // SCD Threshold
      Setting{0x9287, 1, nearest(b.short_circuit_delay_us / 15) + 1},                  // SCD Delay
      Setting{0x9288, 2, rest_ma},                         // OCC Recovery Threshold: at rest; the default needs a load
      Setting{0x928A, 2, minus_user_a(b, b.sustained_a)},  // OCD3 Threshold [13.6.6]
      Setting{0x928C, 1, nearest(b.sustained_delay_s)},    // OCD3 Delay
      Setting{0x928D, 2, minus_rest_ma},  // OCD Recovery Threshold: at rest; the default needs a charger
      Setting{0x9295, 1, 1},              // SCDL Latch Limit: the first short circuit is latched until a command
      Setting{0x929A, 1, byte_of(b.charge_hot_c)},  // OTC Threshold, Delay, Recovery [13.6.8]
      Setting{0x929B, 1, b.temperature_delay_s}, Setting{0x929C, 1, byte_of(b.charge_hot_c - temperature_hysteresis_c)},
      Setting{0x929D, 1, byte_of(b.discharge_hot_c)},  // OTD
      Setting{0x929E, 1, b.temperature_delay_s},
      Setting{0x929F, 1, byte_of(b.discharge_hot_c - temperature_hysteresis_c)},
      Setting{0x92A6, 1, byte_of(b.charge_cold_c)},  // UTC
      Setting{0x92A7, 1, b.temperature_delay_s},
      Setting{0x92A8, 1, byte_of(b.charge_cold_c + temperature_hysteresis_c)},
      Setting{0x92AF, 1, 3},                 // Recovery Time [s]: the firmware has opened its outputs long before
      Setting{0x92B2, 2, b.host_silence_s},  // HWD Delay
      Setting{0x92FA, 1, further},           // CFETOFF Pin Config: cell thermistor, 18 kohm pull-up
      Setting{0x92FC, 1, 0x2A},              // ALERT Pin Config: alert, drives high from REG1
      Setting{0x92FD, 1, 0x07},              // TS1 Config
      Setting{0x92FF, 1, 0x07},              // TS3 Config; TS2 is the wake-up pin from SHUTDOWN
      Setting{0x9300, 1, further},           // HDQ Pin Config
      Setting{0x9301, 1, 0xAA},              // DCHG Pin Config: low forbids charging, high from REG1
      Setting{0x9302, 1, 0xAA},              // DDSG Pin Config: low forbids discharging
      Setting{0x9303, 1, current_step_ua(b) == 10'000 ? 0x06U : 0x07U},  // DA Configuration: userA, userV 10 mV
      Setting{0x9304, 2, b.cell_inputs},                                 // Vcell Mode: inputs with a cell
      Setting{0x9307, 1, 67},  // CC3 Samples: 67 x 1.5 ms = 100.5 ms, one sample period
      // FET Options: FET drivers on and their pins open, because DDSG and DCHG may follow them; no body diode (SFET),
      // which would enable DCHG against a protection; no commands
      Setting{0x9308, 1, 0x08}, Setting{0x9309, 1, 0x00},  // Chg Pump Control: off
      Setting{0x9314, 1, 5},                               // Cell Open-Wire Check Time [s]
      Setting{0x9335, 1, 0x00},                            // Balancing Configuration: only by the host
      Setting{0x933A, 1, 8},                               // Cell Balance Max Cells: every second cell
      Setting{0x9343, 2, 0x0050},                          // Mfg Status Init: FETs and permanent failures enabled
  };
}

/// Value of a setting in the table of a board; 0 if it is not there.
constexpr std::uint32_t value_of(std::span<const Setting> settings, std::uint16_t address) {
  for (const Setting& s : settings) {
    if (s.address == address) return s.value;
  }
  return 0;
}

/// Returns true if the chip can have these thresholds and delays (SLUUBY2B, 13.6: ranges of the settings).
constexpr bool possible(const Board& b) {
  const auto all = settings(b);
  const auto between = [&](std::uint16_t address, std::uint32_t least, std::uint32_t most) {
    return value_of(all, address) >= least && value_of(all, address) <= most;
  };
  return between(0x9275, 20, 90) && between(0x9276, 1, 2'047) && between(0x9278, 20, 110) &&
         between(0x9279, 1, 2'047) && b.sustained_a <= current_end_a(b) && between(0x9281, 1, 127) &&
         between(0x9285, 1, 127) && between(0x9287, 1, 31) &&
         short_circuit_mv[value_of(all, 0x9286)] >= b.short_circuit_a * b.shunt_mohm - 1e-6 &&
         current_end_a(b) >= b.current_range_a && b.overvoltage_v > b.undervoltage_v;
}

// ---- what the driver has to know ----

struct Configuration {
  std::span<const Setting> settings;
  std::int32_t current_step_ua, current_end_ua;
  std::int32_t current_na_per_count;  ///< of the 32-bit counts [4.12]: 256 of them are a step of CC Gain
  std::uint32_t max_silence_us;       ///< of this core: 9/10 of the chip's time, as the clocks differ
  std::uint8_t cells;                 ///< connected inputs
  std::array<std::uint8_t, cell_inputs> input_of_cell;  ///< of the cells from the lowest on
};

/// settings: settings(b); must outlive the result.
constexpr Configuration configuration(const Board& b, std::span<const Setting> settings) {
  Configuration c{settings,
                  current_step_ua(b),
                  static_cast<std::int32_t>(1e6 * current_end_a(b) + 0.5),
                  static_cast<std::int32_t>(7.5684e6 / b.shunt_mohm / 256 + 0.5),
                  b.host_silence_s * 900'000U,
                  0,
                  {}};
  for (std::uint8_t k = 0; k < cell_inputs; ++k) {
    if ((b.cell_inputs >> k & 1) != 0) c.input_of_cell[c.cells++] = k;
  }
  return c;
}

/// Of this image: firmware/front_end/settings.cpp.
extern const Configuration board_configuration;
/// Of the upper chip of a pack of more than 16 cells. board_configuration is then that of the lower one.
extern const Configuration upper_configuration;

}  // namespace bms::hal::bq76952
