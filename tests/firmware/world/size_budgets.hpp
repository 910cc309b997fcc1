// What a pack of 8, 16, 24 and 32 cells costs: image, front ends, processor and bus. The flashed images in the circuit
// of a truck that drives; 8 and 16 cells on stm32f405_forklift, 24 and 32 on stm32f405_80v, with the cell table9.
#pragma once

#include <array>
#include <cstddef>
#include <string>

namespace bms::world {

inline constexpr std::array<std::size_t, 4> budget_sizes{8, 16, 24, 32};

/// In the order of the columns in boards/stm32f405_80v/README.md.
struct SizeBudget {
  double period_ms = 0;                  ///< between two samples
  double i2c_ms = 0;                     ///< of the bytes from and to the front ends, per sample
  double instructions = 0;               ///< of the whole firmware, per sample
  double longest_sample_ms = 0;          ///< Board.LongestSample, with the configuration of the front ends
  double frames = 0;                     ///< that the battery sends, per second
  double load_percent = 0;               ///< of a bus of 250 kbit/s by them, with the most stuff bits
  double flash = 0, ram = 0, stack = 0;  ///< [bytes], as in boards/README.md
};
constexpr std::size_t budget_columns = 9;
std::array<double, budget_columns> columns_of(const SizeBudget& b);

/// Runs the image, and builds it if necessary.
SizeBudget size_budget_of(std::size_t cells);
/// The same for a battery of a group of two (BMS_PARALLEL), with cells of 100 Ah. Frames are those on the truck's bus.
SizeBudget size_budget_of_group();
inline constexpr const char* group_row = "24 cells, one of two in parallel";
std::string size_budget_table();

}  // namespace bms::world
