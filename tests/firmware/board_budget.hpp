// What the image of each board's chip takes of flash, RAM and stack, against what its board.cmake allows: BMS_BUDGET_FLASH, BMS_BUDGET_RAM, BMS_BUDGET_STACK, in bytes.
// A new board joins by its folder. The table in boards/README.md is written by `./bms figures`.
#pragma once

#include <cstdint>
#include <string>

namespace bms {

struct BoardFigures {
  std::uint64_t flash = 0;            ///< code, constants, and what .data begins with
  std::uint64_t ram = 0;              ///< static
  std::uint64_t stack_worst = 0;      ///< tests/firmware/stack_depth.hpp
  std::uint64_t stack_measured = 0;   ///< the deepest that was written to while it ran; 0: no emulator has the board
};

struct BoardBudget {
  std::uint64_t flash = 0, ram = 0, stack = 0;
};
BoardBudget budget_of(const std::string& board);

/// Without stack_measured. The image is built if need be, with the built-in cell table9.
BoardFigures figures_of(const std::string& board);

/// Runs two minutes of the shift's samples, at the end of each of which the record is written: in Unicorn what QEMU does not have (the image whose samples come over CAN),
/// in QEMU the application with the emulated pins. 0 for a board that neither has.
std::uint64_t measured_stack(const std::string& board);

/// The rows of the table in boards/README.md.
std::string board_table();

}  // namespace bms
