// Flash, RAM and stack of the image of each board, compared with its board.cmake: BMS_BUDGET_FLASH, BMS_BUDGET_RAM and
// BMS_BUDGET_STACK in bytes, BMS_BUDGET_SAMPLE_MS. A new board is found by its folder. `./bms figures` writes the table
// in boards/README.md.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace bms::firmware {

struct BoardFigures {
  std::uint64_t flash = 0;        ///< code, constants, initial values of .data
  std::uint64_t ram = 0;          ///< static
  std::uint64_t stack_worst = 0;  ///< tests/firmware/stack_depth.hpp
};

struct BoardBudget {
  std::uint64_t flash = 0, ram = 0, stack = 0;
  double sample_ms = 0;
};
BoardBudget budget_of(const std::string& board);

/// Builds the image if necessary, with the built-in cell table9.
BoardFigures figures_of(const std::string& board);

struct BudgetRun {
  std::uint64_t stack = 0;  ///< deepest written word [bytes]
  double sample_ms = 0;     ///< longest processing time of a sample, as the board reports it (Board.LongestSample)
};

/// Runs two minutes of the shift; after each minute a record is written. Boards that QEMU does not emulate run in
/// Unicorn with samples over CAN: an instruction takes one cycle, and flash makes the core wait. In QEMU an instruction
/// takes 8 ns, UART and flash take no time. Returns nothing if no emulator has the board.
std::optional<BudgetRun> run_of(const std::string& board);

/// The rows of the table in boards/README.md.
std::string board_table();

}  // namespace bms::firmware
