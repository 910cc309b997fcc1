// Content of the chip's data memory for a board, as a table that is written in CONFIG_UPDATE mode and read back.
//
// The chip's own protections are the second line. They are wider and slower than protection/ and have signals of their
// own (pins DDSG and DCHG to the enable inputs of the contactor drivers). They also open if this core has not
// communicated for host_silence_s.
//
// Addresses and fields: SLUUBY2B, chapter 13. README.md lists those that could not be checked there.
#pragma once

#include <array>
#include <bit>
#include <cstdint>

namespace bms::hal::bq76952 {

/// Components around the chip, and thresholds of its own protections.
struct Board {
  double shunt_mohm = 0.1;             ///< +-327 A, the range of 16 bits of 10 mA, are +-33 mV of its +-200 mV
  std::uint16_t cell_inputs = 0xFFFF;  ///< one bit per connected input
  double overvoltage_v = 3.8, undervoltage_v = 2.0;  ///< LiFePO4 cell; steps of 50.6 mV
  double voltage_delay_s = 1;
  /// 3: 60 mV, 600 A. Steps 10, 20, 40, 60, 80, 100, 125, 150, 175, 200, 250, ... 500 mV.
  std::uint8_t short_circuit_step = 3;
  double short_circuit_delay_us = 450;
  std::uint16_t host_silence_s = 3;
};

inline constexpr std::int32_t current_step_ua = 10'000;      // userA
inline constexpr std::int64_t charge_step_uas = 36'000'000;  // userAh = 10 mAh
inline constexpr std::int32_t voltage_step_uv = 10'000;      // userV
inline constexpr std::uint8_t crc_over_i2c = 0x11;           // Comm Type: 400 kHz, CRC

struct Setting {
  std::uint16_t address;
  std::uint8_t bytes;
  std::uint32_t value;  ///< little-endian in the memory
};

/// The settings of a board, in the order of their addresses.
constexpr auto settings(const Board& b) {
  const double cc_gain = 7.5684 / b.shunt_mohm;  // [4.12]: 1.24 V / (5 x 32768 x shunt)
  const auto floating = [](double value) { return std::bit_cast<std::uint32_t>(static_cast<float>(value)); };
  const auto steps = [](double value, double step) { return static_cast<std::uint32_t>(value / step + 0.5); };
  return std::array{
      Setting{0x91A8, 4, floating(cc_gain)},                 // CC Gain
      Setting{0x91AC, 4, floating(cc_gain * 298'261.6178)},  // Capacity Gain [4.12]
      Setting{0x9234, 2, 0x28C2},        // Power Config: no SLEEP; FASTADC: all cells in 31.5 ms, stack and LD in 94.5
      Setting{0x9236, 1, 0x0D},          // REG12 Config: REG1 at 3.3 V, for the pins below
      Setting{0x9237, 1, 0x01},          // REG0 Config: the pre-regulator of REG1
      Setting{0x9239, 1, crc_over_i2c},  // Comm Type
      Setting{0x9261, 1, 0x8C},          // Enabled Protections A: SCD, COV, CUV
      Setting{0x9263, 1, 0x02},          // C: host watchdog
      Setting{0x9265, 1, 0x98},          // CHG FET Protections A: SCD, OCC, COV
      Setting{0x9267, 1, 0x56},          // C, includes the host watchdog
      Setting{0x9269, 1, 0xE4},          // DSG FET Protections A: SCD, OCD, CUV
      Setting{0x926B, 1, 0xE2},          // C, includes the host watchdog
      Setting{0x926D, 2, 0xF882},        // Default Alarm Mask: factory value and the end of each scan
      Setting{0x9275, 1, steps(b.undervoltage_v, 0.0506)},          // CUV Threshold
      Setting{0x9276, 2, steps(b.voltage_delay_s, 0.0033) - 2},     // CUV Delay
      Setting{0x9278, 1, steps(b.overvoltage_v, 0.0506)},           // COV Threshold
      Setting{0x9279, 2, steps(b.voltage_delay_s, 0.0033) - 2},     // COV Delay
      Setting{0x9286, 1, b.short_circuit_step},                     // SCD Threshold
      Setting{0x9287, 1, steps(b.short_circuit_delay_us, 15) + 1},  // SCD Delay
      Setting{0x92B2, 2, b.host_silence_s},                         // HWD Delay
      Setting{0x92FA, 1, 0x07},           // CFETOFF Pin Config: cell thermistor, 18 kohm pull-up
      Setting{0x92FC, 1, 0x2A},           // ALERT Pin Config: alert, drives high from REG1
      Setting{0x92FD, 1, 0x07},           // TS1 Config
      Setting{0x92FF, 1, 0x07},           // TS3 Config; TS2 is the wake-up pin from SHUTDOWN
      Setting{0x9300, 1, 0x07},           // HDQ Pin Config
      Setting{0x9301, 1, 0xAA},           // DCHG Pin Config: low forbids charging, high from REG1
      Setting{0x9302, 1, 0xAA},           // DDSG Pin Config: low forbids discharging
      Setting{0x9303, 1, 0x06},           // DA Configuration: userA 10 mA, userV 10 mV
      Setting{0x9304, 2, b.cell_inputs},  // Vcell Mode
      Setting{0x9307, 1, 67},             // CC3 Samples: 67 x 1.5 ms = 100.5 ms, one sample period
      Setting{0x9308, 1, 0x05},           // FET Options: no FETs
      Setting{0x9309, 1, 0x00},           // Chg Pump Control: off
      Setting{0x9314, 1, 5},              // Cell Open-Wire Check Time [s]
      Setting{0x9335, 1, 0x00},           // Balancing Configuration: only by the host
      Setting{0x933A, 1, 8},              // Cell Balance Max Cells: every second cell
      Setting{0x9343, 2, 0x0050},         // Mfg Status Init: protections enabled
  };
}

}  // namespace bms::hal::bq76952
