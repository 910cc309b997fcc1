// A host on the bus of the BQ76952 model that knows nothing of the driver: direct commands, subcommands and settings,
// all without CRC. Base of the tests of the model by itself.
#pragma once

#include <array>
#include <initializer_list>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/hal/bq76952_model.hpp"
#include "tests/hal/thermistor.hpp"

namespace bms {

using Values = std::vector<std::pair<bq::Setting, std::uint32_t>>;

class ChipWithHost : public ::testing::Test {
 protected:
  explicit ChipWithHost(const ChipVariant& variant = {}) : chip_(variant) {
    in.cell_v.fill(3.3);
    in.stack_v = in.pack_v = 52.8;
    chip_.advance(1, in);
  }
  void TearDown() override { EXPECT_THAT(chip_.violations, ::testing::IsEmpty()); }

  void wait_us(std::uint64_t us) { chip_.advance(us, in); }
  void wait_s(double s) { wait_us(static_cast<std::uint64_t>(1e6 * s)); }

  unsigned read(std::uint8_t at, std::size_t bytes = 1) {
    std::vector<std::uint8_t> got(bytes);
    const std::array out{at};
    EXPECT_EQ(chip_.transfer(0x08, out, got), hal::I2cResult::done);
    unsigned value = 0;
    for (std::size_t k = 0; k < bytes; ++k) value |= static_cast<unsigned>(got[k]) << 8 * k;
    return value;
  }
  int read_signed(std::uint8_t at) { return static_cast<std::int16_t>(read(at, 2)); }
  void write(std::initializer_list<std::uint8_t> bytes) {
    const std::vector<std::uint8_t> out(bytes);
    EXPECT_EQ(chip_.transfer(0x08, out, {}), hal::I2cResult::done);
  }
  void subcommand(std::uint16_t address) {
    write({0x3E, static_cast<std::uint8_t>(address), static_cast<std::uint8_t>(address >> 8)});
  }
  /// Value of `bytes` bytes from byte `at` of the block that a subcommand returns.
  unsigned block(std::uint16_t address, std::uint8_t at, std::size_t bytes) {
    subcommand(address);
    wait_us(1'000);
    return read(static_cast<std::uint8_t>(0x40 + at), bytes);
  }
  void write_block(std::uint16_t address, std::size_t bytes, std::uint32_t value) {
    subcommand(address);
    unsigned sum = (address & 0xFFU) + (address >> 8);
    for (std::size_t k = 0; k < bytes; ++k) {
      const auto byte = static_cast<std::uint8_t>(value >> 8 * k);
      write({static_cast<std::uint8_t>(0x40 + k), byte});
      sum += byte;
    }
    write({0x60, static_cast<std::uint8_t>(~sum), static_cast<std::uint8_t>(bytes + 4)});
  }
  /// Writes settings in CONFIG_UPDATE mode.
  void configure(const Values& values) {
    subcommand(0x0090);
    for (const auto& [setting, value] : values) write_block(setting.address, setting.bytes, value);
    subcommand(0x0092);
  }
  /// DDSG and DCHG low at a fault, driven from REG1 at 3.3 V, ALERT high; nothing else enabled than `values` say.
  void configure_outputs(Values values = {}) {
    Values all{{bq::reg12_config, 0x0D},
               {bq::reg0_config, 1},
               {bq::ddsg_pin, 0xAA},
               {bq::dchg_pin, 0xAA},
               {bq::alert_pin, 0x2A},
               {bq::mfg_status_init, 0x50},
               {bq::enabled_protections_a, 0x00}};
    all.insert(all.end(), values.begin(), values.end());
    configure(all);
  }
  /// Ends all faults of the circuit and resets the chip.
  void restore() {
    in = {};
    in.cell_v.fill(3.3);
    in.stack_v = in.pack_v = 52.8;
    wait_us(1);
    chip_.reset();
  }
  unsigned safety_a() const { return chip_.protections().status(bq::Protections::a); }
  unsigned safety_b() const { return chip_.protections().status(bq::Protections::b); }
  unsigned safety_c() const { return chip_.protections().status(bq::Protections::c); }
  void set_thermistor(ThermistorPin pin, double celsius) {
    in.thermistor_ohm[static_cast<std::size_t>(pin)] = thermistor_ohm(celsius);
  }

  Bq76952Inputs in;
  Bq76952Model chip_;
};

}  // namespace bms
