#include "tests/hal/bq76952_board.hpp"

#include <cstdio>
#include <cstdlib>

#include "hal/clock.hpp"
#include "hal/contactor_pins.hpp"
#include "hal/power.hpp"
#include "hal/sleep.hpp"
#include "hal/watchdog.hpp"

namespace bms {

namespace {

constexpr auto settings_under_test = hal::bq76952::settings(board_under_test);

}  // namespace

constexpr hal::bq76952::Configuration hal::bq76952::board_configuration =
    hal::bq76952::configuration(board_under_test, settings_under_test);

Bq76952Model* chip = nullptr;
std::vector<can::Frame> arriving;
std::vector<hal::PowerPath> switched;
std::vector<std::uint64_t> feeds_us;

ChipVariant variant_under_test() {
  const char* wanted = std::getenv("BMS_CHIP_VARIANT");
  const auto all = all_chip_variants();
  for (const ChipVariant& variant : all) {
    if (variant.name == (wanted == nullptr ? "nominal" : wanted)) return variant;
  }
  std::printf("BMS_CHIP_VARIANT: %s is not a variant of the chip; expected one of", wanted);
  for (const ChipVariant& variant : all) std::printf(" %s", variant.name.c_str());
  std::printf("\n");
  std::exit(2);
}

namespace hal {
I2cResult i2c_transfer(std::uint8_t address, std::span<const std::uint8_t> out, std::span<std::uint8_t> in) {
  return chip->transfer(address, out, in);
}
bool i2c_recover() { return chip->recover(); }
void i2c_start() {}
std::uint64_t now_us() { return chip->time_us; }
void wait_for_interrupt() { chip->advance(1'000 - chip->time_us % 1'000); }
void rest_until(std::uint64_t) { wait_for_interrupt(); }
bool can_receive(can::Frame& frame) {
  if (arriving.empty()) return false;
  frame = arriving.front();
  arriving.erase(arriving.begin());
  return true;
}
void contactor_pins_set(const PowerPath& wanted) { switched.push_back(wanted); }
void watchdog_feed() { feeds_us.push_back(now_us()); }
void finish(int) { throw RunEnded{}; }
}  // namespace hal

}  // namespace bms
