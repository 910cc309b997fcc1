// Model of a BQ76952 on an I2C bus, written from its manual and independent of the driver: bytes with a CRC by
// polynomial division, subcommands, data memory, CONFIG_UPDATE mode, the scan of the cells in slots, three current
// filters, balancing with its limit of 20 s, host watchdog, and faults.
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

namespace bms {

class Bq76952Model {
 public:
  Bq76952Model();

  // inputs of the chip
  std::array<double, 16> cell_v{};
  double stack_v = 0, ld_v = 0, current_a = 0, shunt_mohm = 0.1;
  double cc3_loses = 0;                                 ///< fraction of the current that CC3 does not contain
  std::array<double, 4> temperature_c{25, 25, 25, 25};  ///< at TS1, TS3, HDQ, CFETOFF
  double charge_as = 0;                                 ///< true charge
  std::uint64_t time_us = 0;
  std::array<double, 16> bled_s{};  ///< bleeding time of each cell

  // faults
  bool gone = false, hung = false, frozen = false, torn_buffer = false, only_cells = false, crc_from_otp = false,
       deep_sleep = false, sealed = false, needs_swap = false, ignores_writes = false;
  std::uint16_t device_number = 0x7695;
  struct Fault {
    enum Kind { none, no_acknowledge, flipped_bit, timed_out, reset } kind = none;
    int at = 0, count = 0;  ///< first faulty transfer, counted from now; number of them
  } fault;

  hal::I2cResult transfer(std::uint8_t address, std::span<const std::uint8_t> out, std::span<std::uint8_t> in);
  bool recover();
  void advance(std::uint64_t us);
  void reset();

  std::uint32_t memory(std::uint16_t address, std::size_t bytes) const;
  void set_memory(std::uint16_t address, std::size_t bytes, std::uint32_t value);
  bool checked() const { return checked_; }
  bool in_config() const { return config_; }
  std::uint16_t balancing() const { return balancing_; }
  /// Returns true if DDSG and DCHG are high, which enables the contactor drivers.
  bool enables_contactors() const;

  unsigned transfers = 0, bytes_sent = 0, clocked_us = 0;
  std::vector<std::uint16_t> commands;  ///< received subcommands in order
  std::vector<std::string> violations;  ///< violations of the manual by the host

 private:
  void step(std::uint64_t us);
  void slot_ends();
  void scan_ends();
  void command(std::uint16_t address);
  void commit(std::uint8_t length);
  void fill(std::span<const std::uint8_t> data, std::size_t length);
  std::uint8_t register_byte(std::uint8_t at) const;
  bool write_register(std::uint8_t at, std::uint8_t value);
  hal::I2cResult take(std::span<const std::uint8_t> out);
  void give(std::uint8_t command, bool written, std::span<std::uint8_t> in);
  std::int16_t to_user_current(double a) const;
  double gain_seen() const;

  std::map<std::uint16_t, std::uint8_t> memory_;
  std::array<std::uint8_t, 128> direct_{};
  std::array<std::uint8_t, 32> buffer_{};
  std::uint8_t low_ = 0, high_ = 0, checksum_ = 0, length_ = 0;
  std::uint64_t busy_until_us_ = 0, slot_left_us_ = 3'000, cc1_left_us_ = 250'000, balancing_until_us_ = 0,
                last_transfer_us_ = 0, over_since_us_ = 0;
  std::uint16_t alarm_ = 0, alarm_enable_ = 0xF800, balancing_ = 0;
  std::uint8_t safety_a_ = 0, safety_c_ = 0;
  bool checked_ = false, config_ = false, was_reset_ = true, stuck_ = false;
  int slot_ = 0, loop_ = 0;
  double slot_as_ = 0, cc1_as_ = 0, cc3_sum_a_ = 0;
  int cc3_count_ = 0;
  std::int16_t cc2_ = 0, cc3_ = 0;
  std::int64_t counted_ = 0x7FFF'FFFF;
  std::uint32_t quarter_seconds_ = 0;
};

}  // namespace bms
