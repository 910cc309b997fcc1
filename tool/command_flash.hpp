// bms flash: build a board's image and write it onto the chip, by OpenOCD.
#pragma once

#include <string>

namespace bms::tool {

struct FlashOptions {
  std::string board = "stm32f405_forklift", cell;  ///< cell empty: the board's own
  std::string probe, serial;                       ///< probe empty: the board's own (BMS_PROBE in board.cmake)
  bool dry_run = false;
};

/// 0: written, compared, reset. 1: it did not work. Throws BadInput when OpenOCD, the probe or the board is missing.
int run(const FlashOptions& options);

}  // namespace bms::tool
