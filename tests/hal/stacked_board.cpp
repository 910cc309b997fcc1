#include "tests/hal/stacked_board.hpp"

#include <algorithm>
#include <cmath>

#include "hal/clock.hpp"
#include "hal/isolated_i2c.hpp"
#include "tests/hal/thermistor.hpp"

namespace bms {

namespace {

constexpr hal::bq76952::Board upper_board_under_test = [] {
  hal::bq76952::Board board = lower_board_under_test;
  board.cell_inputs = hal::bq76952::inputs_of_pack(12);
  return board;
}();
constexpr auto lower_settings = hal::bq76952::settings(lower_board_under_test),
               upper_settings = hal::bq76952::settings(upper_board_under_test);

}  // namespace

constexpr hal::bq76952::Configuration hal::bq76952::board_configuration =
    hal::bq76952::configuration(lower_board_under_test, lower_settings);
constexpr hal::bq76952::Configuration hal::bq76952::upper_configuration =
    hal::bq76952::configuration(upper_board_under_test, upper_settings);

StackedBoard* stacked_board = nullptr;

StackedBoard::StackedBoard() {
  stacked_board = this;
  for (std::size_t k = 0; k < cells; ++k) cell_v[k] = 3.28 + 0.001 * static_cast<double>(k);
}

StackedBoard::~StackedBoard() { stacked_board = nullptr; }

/// The wiring of the two chips: docs of the board stm32f405_80v.
Bq76952Inputs StackedBoard::circuit(std::size_t which) const {
  Bq76952Inputs in;
  const std::size_t first = which == lower ? 0 : cells_below,
                    count = which == lower ? cells_below : cells - cells_below;
  for (std::size_t k = 0; k < count; ++k) {
    in.cell_v[k + 1 < count ? k : 15] = cell_v[first + k];
    in.stack_v += cell_v[first + k];
  }
  in.pack_v = (which == upper) == strapped[which] ? in.stack_v : 0;
  in.internal_c = die_c[which];
  in.shunt_v = which == lower ? 1e-4 * current_a : 0;
  const auto set = [&](ThermistorPin pin, double celsius) {
    in.thermistor_ohm[static_cast<std::size_t>(pin)] = thermistor_ohm(celsius);
  };
  set(ThermistorPin::ts1, temperature_c[2 * which]);
  set(ThermistorPin::ts3, temperature_c[2 * which + 1]);
  return in;
}

/// The time of a chip goes on while that of the core advances.
void StackedBoard::pass(std::size_t which, double core_us) {
  rest_us_[which] += core_us * clock[which];
  const double whole_us = std::max(0.0, std::floor(rest_us_[which]));
  rest_us_[which] -= whole_us;
  chip[which].advance(static_cast<std::uint64_t>(whole_us));
}

void StackedBoard::advance(std::uint64_t us) {
  if (follow) follow();
  time_us += us;
  for (const std::size_t which : {lower, upper}) {
    chip[which].advance(0, circuit(which));
    pass(which, static_cast<double>(us));
  }
}

/// A transfer has taken time of one chip; it passes for the core and for the other chip, too.
void StackedBoard::catch_up(std::size_t which, std::uint64_t before_us) {
  const std::uint64_t us = chip[which].time_us - before_us;
  time_us += us;
  rest_us_[which] += static_cast<double>(us) * (clock[which] - 1);  // the wire has the clock of the core
  pass(1 - which, static_cast<double>(us));
}

hal::I2cResult StackedBoard::transfer(std::size_t bus, std::uint8_t address, std::span<const std::uint8_t> out,
                                      std::span<std::uint8_t> in) {
  const std::size_t which = swapped ? 1 - bus : bus;
  if (which == upper && !isolator_supplied) {
    advance(25);
    return hal::I2cResult::no_acknowledge;
  }
  if (follow) {
    follow();
    for (const std::size_t of : {lower, upper}) chip[of].advance(0, circuit(of));
  }
  const std::uint64_t before_us = chip[which].time_us;
  const hal::I2cResult result = chip[which].transfer(address, out, in);
  catch_up(which, before_us);
  return result;
}

bool StackedBoard::recover(std::size_t bus) {
  const std::size_t which = swapped ? 1 - bus : bus;
  if (which == upper && !isolator_supplied) return true;
  const std::uint64_t before_us = chip[which].time_us;
  const bool free = chip[which].recover();
  catch_up(which, before_us);
  return free;
}

namespace hal {
void i2c_start() {}
void isolated_i2c_start() {}
I2cResult i2c_transfer(std::uint8_t address, std::span<const std::uint8_t> out, std::span<std::uint8_t> in) {
  return stacked_board->transfer(StackedBoard::lower, address, out, in);
}
I2cResult isolated_i2c_transfer(std::uint8_t address, std::span<const std::uint8_t> out, std::span<std::uint8_t> in) {
  return stacked_board->transfer(StackedBoard::upper, address, out, in);
}
bool i2c_recover() { return stacked_board->recover(StackedBoard::lower); }
bool isolated_i2c_recover() { return stacked_board->recover(StackedBoard::upper); }
std::uint64_t now_us() { return stacked_board->time_us; }
void wait_for_interrupt() { stacked_board->advance(1'000 - stacked_board->time_us % 1'000); }
}  // namespace hal

}  // namespace bms
