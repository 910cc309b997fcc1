// The hardware around two stacked chips in a test: a pack of 25 cells, 13 at the lower chip and 12 at the upper one,
// the isolator before the upper one, and a clock for each of the three. Time is that of the core.
//
// A fault is a member that a test sets; nothing here knows the driver.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>

#include "hal/bq76952/configuration.hpp"
#include "hal/i2c.hpp"
#include "tests/hal/bq76952_board.hpp"
#include "tests/hal/bq76952_model.hpp"

namespace bms {

class StackedBoard {
 public:
  static constexpr std::size_t cells = 25, cells_below = 13, lower = 0, upper = 1;

  StackedBoard();
  StackedBoard(const StackedBoard&) = delete;
  StackedBoard& operator=(const StackedBoard&) = delete;
  ~StackedBoard();

  std::array<double, cells> cell_v{};
  double current_a = 0;
  std::array<double, 4> temperature_c{25, 26, 27, 28};  ///< two at the lower chip, two at the upper one

  std::array<double, 2> die_c{25, 25};

  /// Sets the values above to those at time_us. Called before time passes and before each transfer, so that the circuit
  /// also changes while a chip is read.
  std::function<void()> follow;

  // faults; those of a chip itself are in chip[]
  bool isolator_supplied = true;             ///< false: its far side; wires high here, enable signals low
  bool swapped = false;                      ///< the two buses are exchanged at the controller
  std::array<bool, 2> strapped{true, true};  ///< false: PACK has the level of the other chip
  std::array<double, 2> clock{1, 1};         ///< of the chip, in clocks of the core
  std::array<Bq76952Model, 2> chip;

  /// The circuit has the values above for `us` microseconds, and in transfers until the next call.
  void advance(std::uint64_t us);
  hal::I2cResult transfer(std::size_t bus, std::uint8_t address, std::span<const std::uint8_t> out,
                          std::span<std::uint8_t> in);
  bool recover(std::size_t bus);
  /// Both enable signals of both chips are high at the drivers.
  bool enables_contactors() const {
    return chip[lower].enables_contactors() && chip[upper].enables_contactors() && isolator_supplied;
  }

  std::uint64_t time_us = 0;

 private:
  void pass(std::size_t which, double core_us);
  void catch_up(std::size_t which, std::uint64_t before_us);
  Bq76952Inputs circuit(std::size_t which) const;

  std::array<double, 2> rest_us_{};  ///< of a chip's clock, below a microsecond
};

/// At the end of both buses; the last one that was made.
extern StackedBoard* stacked_board;

/// The chip of bq76952_board.hpp, with the lower cells and their two thermistors.
inline constexpr hal::bq76952::Board lower_board_under_test = [] {
  hal::bq76952::Board board = board_under_test;
  board.cell_inputs = hal::bq76952::inputs_of_pack(StackedBoard::cells_below);
  board.four_thermistors = false;
  return board;
}();

}  // namespace bms
