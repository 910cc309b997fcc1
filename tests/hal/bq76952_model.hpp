// Model of a BQ76952 between a circuit and an I2C bus, written from TI's documents and independent of the driver: bytes
// with a CRC by polynomial division, subcommands, data memory, CONFIG_UPDATE mode, measurement, protections, the
// outputs DDSG, DCHG and ALERT, balancing by the host, and faults of the bus and of the chip.
//
// Sources stand at each fact: SLUUBY2B is the manual, SLUSE13B the datasheet; SLUUBY1B (BQ76942), SLUUCF2C (BQ769142),
// SLUUCG7 (BQ76922) and SLUUCW9 (BQ76972) are manuals of sister chips, for sections that agree in what was compared;
// E2E numbers are threads of TI's forum. What the documents leave open is a member of ChipVariant. Not modelled: SLEEP
// mode, load detection, precharge FETs, fuse, OTP, autonomous balancing, HWD Regulator Options, PF checks beyond those
// listed.
//
// Time passes in advance() and on the wire (22.5 us per byte and 2.5 us per start or stop, 400 kHz).
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "hal/i2c.hpp"
#include "tests/hal/bq76952_circuit.hpp"
#include "tests/hal/bq76952_measurement.hpp"
#include "tests/hal/bq76952_memory.hpp"
#include "tests/hal/bq76952_protections.hpp"

namespace bms {

class Bq76952Model {
 public:
  explicit Bq76952Model(const ChipVariant& variant = {});
  Bq76952Model(const Bq76952Model&) = delete;
  Bq76952Model& operator=(const Bq76952Model&) = delete;

  // A simple circuit for tests that have none of their own; advance(us) connects it. PACK is connected to the stack.
  std::array<double, 16> cell_v{};
  double stack_v = 0, ld_v = 0, current_a = 0, shunt_mohm = 0.1;
  std::uint64_t ts2_low_from_us = 0, ts2_low_until_us = 0;
  std::array<double, 4> temperature_c{25, 25, 25, 25};  ///< of thermistors 103AT at TS1, TS3, HDQ, CFETOFF
  double die_c = 25;

  double charge_as = 0;  ///< true charge
  std::uint64_t time_us = 0;
  std::array<double, 16> bled_s{};  ///< bleeding time of each cell

  // faults
  double cc3_loses = 0;                           ///< fraction of the current that CC3 does not contain
  std::uint16_t zero_cells = 0, stale_cells = 0;  ///< cells whose register reads 0, or keeps its value
  bool gone = false, hung = false, frozen = false, torn_buffer = false, only_cells = false, crc_from_otp = false,
       deep_sleep = false, sealed = false, needs_swap = false, ignores_writes = false, ignores_reset = false;
  std::uint16_t device_number = 0x7695;
  double bus_hz = 400e3;  ///< clock of the host
  struct Fault {
    enum Kind { none, no_acknowledge, flipped_bit, timed_out, reset } kind = none;
    int at = 0, count = 0;  ///< first faulty transfer, counted from now; number of them
  } fault;

  hal::I2cResult transfer(std::uint8_t address, std::span<const std::uint8_t> out, std::span<std::uint8_t> in);
  bool recover();
  /// The circuit has these values for `us` microseconds, and during transfers until the next call.
  void advance(std::uint64_t us, const Bq76952Inputs& in);
  void advance(std::uint64_t us);
  void reset();

  std::uint32_t memory(std::uint16_t address, std::size_t bytes) const { return memory_.read(address, bytes); }
  void set_memory(std::uint16_t address, std::size_t bytes, std::uint32_t value) {
    memory_.write(address, bytes, value);
  }
  void set(const bq::Setting& setting, std::uint32_t value) { memory_.set(setting, value); }
  bool checked() const { return checked_; }
  bool in_config() const { return config_; }
  bool in_shutdown() const { return shutdown_; }
  /// "Soft SHUTDOWN" (TI's FAQ, E2E 1273427): after the command TS2 is low or LD high. The FETs are off, REG1 and the
  /// bus work; when both have ended, SHUTDOWN follows. RESET ends it, which the FAQ says of the pin RST_SHUT only.
  bool in_soft_shutdown() const { return ending_; }
  double ld_high_v = 1.45;  ///< typical (E2E 1356033)
  /// Between two calls of advance(), which sets it again.
  void pull_ts2(bool low) { in_.ts2_low = low; }
  std::uint16_t balancing() const { return balancing_; }
  const bq::Protections& protections() const { return protections_; }
  const bq::Measurement& measurement() const { return measurement_; }

  // outputs
  PinLevel ddsg_level() const { return level(bq::ddsg_pin, dsg_asserted(), 8); }
  PinLevel dchg_level() const { return level(bq::dchg_pin, chg_asserted(), 7); }
  PinLevel alert_level() const { return level(bq::alert_pin, alarm_ != 0, 2); }
  /// Return true if the pin is high; a pin that is not driven is pulled down.
  bool ddsg() const { return ddsg_level() == PinLevel::high; }
  bool dchg() const { return dchg_level() == PinLevel::high; }
  bool alert() const { return alert_level() == PinLevel::high; }
  /// Returns true if DDSG and DCHG are high, which enables the contactor drivers.
  bool enables_contactors() const { return ddsg() && dchg(); }

  unsigned transfers = 0, bytes_sent = 0, clocked_us = 0;
  std::vector<std::uint16_t> commands;  ///< received subcommands in order
  std::vector<std::string> violations;  ///< violations of the manual by the host

 private:
  Bq76952Inputs simple_circuit();
  void run_for(std::uint64_t us);
  void step(std::uint64_t us);
  bool runs() const { return !config_ && !deep_sleep && !shutdown_; }
  bool sealed_or_config() const { return sealed || config_; }
  void start_firmware();
  void update_alarm();
  std::uint16_t alarm_raw() const;
  void command(std::uint16_t address);
  bool control_command(std::uint16_t address);
  bool fet_command(std::uint16_t address);
  std::size_t block(std::uint16_t address, std::span<std::uint8_t> data);
  void exit_config();
  void commit(std::uint8_t length);
  void write_block(std::uint16_t address, std::span<const std::uint8_t> data);
  void fill(std::span<const std::uint8_t> data, std::size_t length, bool checksum_right);
  std::uint8_t register_byte(std::uint8_t at) const;
  std::uint8_t status_byte(std::uint8_t at) const;
  std::uint16_t manufacturing_status() const;
  std::uint8_t fet_status() const;
  void write_register(std::uint8_t at, std::uint8_t value);
  bool too_fast() const;
  hal::I2cResult take(std::span<const std::uint8_t> out);
  void give(std::uint8_t command, std::span<std::uint8_t> in, std::uint64_t start_us, std::size_t bytes_before);
  bool fet_on(bool turned_off, std::uint8_t off_bit, bool test) const;
  bool dsg_asserted() const;
  bool chg_asserted() const;
  PinLevel level(const bq::Setting& config, bool asserted, unsigned output) const;

  ChipVariant variant_;
  bq::Memory memory_;
  bq::Measurement measurement_{memory_, variant_};
  bq::Protections protections_{memory_, variant_, measurement_};
  Bq76952Inputs in_;
  std::array<double, 4> converted_c_{};
  std::array<double, 4> converted_ohm_{};
  std::array<std::uint8_t, 32> buffer_{};
  std::uint8_t low_ = 0, high_ = 0, checksum_ = 0, length_ = 0;
  std::uint64_t busy_until_us_ = 0, balancing_until_us_ = 0;
  std::uint16_t alarm_ = 0, alarm_before_ = 0, alarm_enable_ = 0xF800, balancing_ = 0, previous_command_ = 0;
  std::uint16_t outputs_high_ = 0;         ///< general-purpose outputs that subcommands set
  std::uint8_t host_off_ = 0, tests_ = 0;  ///< FET_CONTROL; FETs on in test mode, bits of Manufacturing Status
  bool checked_ = false, config_ = false, was_reset_ = true, stuck_ = false, shutdown_ = false, ending_ = false,
       own_circuit_ = false, fet_en_ = false, pf_en_ = false;
  unsigned quarters_seen_ = 0;
  double hot_s_ = 0;  ///< time of the die above Shutdown Temperature
};

}  // namespace bms
