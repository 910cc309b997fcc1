// What the BQ76952 model takes from the circuit around it, and which of the chip's uncertain properties it has.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

namespace bms {

/// Pins that can measure a thermistor, in the order of their registers, their settings and their measurement
/// (SLUAB27, 2: CFETOFF, DFETOFF, ALERT, TS1, TS2, TS3, HDQ, DCHG, DDSG).
enum class ThermistorPin : std::uint8_t { cfetoff, dfetoff, alert, ts1, ts2, ts3, hdq, dchg, ddsg };
inline constexpr std::size_t thermistor_pins = 9;

/// Voltages at the pins against VSS, and what else the chip senses. Current > 0 charges: SRP is above SRN.
struct Bq76952Inputs {
  static constexpr double open_ohm = std::numeric_limits<double>::infinity();
  static constexpr std::array<double, thermistor_pins> all_open() {
    std::array<double, thermistor_pins> ohm{};
    ohm.fill(open_ohm);
    return ohm;
  }

  std::array<double, 16> cell_v{};  ///< between VC(k) and VC(k + 1)
  double stack_v = 0;               ///< VC16
  double pack_v = 0, ld_v = 0;
  double shunt_v = 0;                                               ///< SRP - SRN
  std::array<double, thermistor_pins> thermistor_ohm = all_open();  ///< 103AT to VSS; open_ohm: none or broken
  double internal_c = 25;                                           ///< temperature of the die
  bool ts2_low = false;                                             ///< a button or plug pulls TS2 to VSS

  double thermistor(ThermistorPin pin) const { return thermistor_ohm[static_cast<std::size_t>(pin)]; }
};

/// State of a pin: driven to VSS, driven to its supply, or not driven.
enum class PinLevel : std::uint8_t { low, high, floating };

/// Properties of the chip that the documents leave open, or on which they disagree. The defaults follow the manual, or
/// else the behaviour that the driver was written for.
struct ChipVariant {
  std::string name = "nominal";
  /// DDSG and DCHG also follow FET_EN, the host's commands and FET_CTRL_EN, as TI's FAQ states (E2E 1237508, and the
  /// observation in 1328137); false: only the protections, as in the manual (SLUUCF2C and SLUUCW9, DDSG and DCHG pins).
  bool pins_follow_fet_drivers = false;
  /// CONFIG_UPDATE mode, which turns the FETs off (SLUUBY1B, 7.6), asserts DDSG and DCHG too.
  bool config_update_asserts_pins = true;
  /// A protection recovers by itself only with FET_EN ("if configured for autonomous recovery", SLUUBY2B, 5.2).
  bool recovers_only_with_fet_en = false;
  /// An alarm bit that was cleared latches again only after its raw bit was 0; false: while the raw bit is 1.
  bool alarm_latches_on_edge = true;
  /// A current outside the 16 bits of userA wraps around; false: it saturates.
  bool user_current_wraps = false;
  /// Shunt voltage at which the coulomb counter saturates [V]: VREF2 / 5 (SLUUBY2B, 4.5), or the specified input range
  /// (SLUSE13B, 7.15).
  double adc_limit_v = 1.24 / 5;
  /// Readings of an open and of a shorted thermistor [0.1 K]. 0 and 32767 after E2E 1028993 (-273 and 3003 degrees C);
  /// 672 and 5051 are the constant terms a5 and b4 of the default polynomial (SLUUBY2B, 13.2: 18K Temperature Model).
  int open_thermistor_dk = 0, shorted_thermistor_dk = 32767;
  /// Time after which balancing by the host ends (20 s are documented for BQ76905).
  double balancing_lasts_s = 20;
  /// Comm Type takes effect by SWAP_COMM_MODE only, not at the end of CONFIG_UPDATE.
  bool comm_type_needs_swap = false;
  /// The high byte of a 16-bit register can belong to a newer value than the low byte even within one transfer
  /// (E2E 1328137: 0x0D00 and 0x0CFF read as 0x0C00).
  bool tears_within_transfer = false;
  /// A transfer reads across several direct commands; false: after two bytes it returns 0xFF.
  bool transfer_spans_commands = true;
  /// CC3 is the mean of the last n conversions at any time; false: of blocks of n.
  bool cc3_moving_mean = false;
  /// The blocks DASTATUS have the checksum of the manual; false: another one, as one user reports.
  bool dastatus_checksum_right = true;
  /// A latch limit of 0 latches at the first fault; false: never.
  bool latch_limit_zero_latches = false;
};

/// The nominal chip and each alternative alone.
std::vector<ChipVariant> all_chip_variants();

}  // namespace bms
