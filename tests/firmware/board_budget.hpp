// What the image of each board's chip takes of flash, RAM and stack, against what its board.cmake allows:
// BMS_BUDGET_FLASH, BMS_BUDGET_RAM, BMS_BUDGET_STACK, in bytes, BMS_BUDGET_SAMPLE_MS. A new board joins by its folder.
// The table in boards/README.md is written by `./bms figures`.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace bms::firmware {

struct BoardFigures {
  std::uint64_t flash = 0;        ///< code, constants, and what .data begins with
  std::uint64_t ram = 0;          ///< static
  std::uint64_t stack_worst = 0;  ///< tests/firmware/stack_depth.hpp
};

struct BoardBudget {
  std::uint64_t flash = 0, ram = 0, stack = 0;
  double sample_ms = 0;
};
BoardBudget budget_of(const std::string& board);

/// The image is built if need be, with the built-in cell table9.
BoardFigures figures_of(const std::string& board);

struct BudgetRun {
  std::uint64_t stack = 0;  ///< the deepest that was written to [bytes]
  double sample_ms = 0;     ///< the longest from a sample to the end of all that is done with it, as the board itself
                            ///< tells (Board.LongestSample)
};

/// Two minutes of the shift's samples, at the end of each of which the record is written: in Unicorn what QEMU does not
/// have (the image whose samples come over CAN; an instruction is a cycle, flash makes the core wait), in QEMU the
/// application with the emulated pins (an instruction takes 8 ns, UART and flash no time). Nothing: neither has the
/// board.
std::optional<BudgetRun> run_of(const std::string& board);

/// The rows of the table in boards/README.md.
std::string board_table();

}  // namespace bms::firmware
