// An emulated board: the firmware's replay image in QEMU, samples in, estimates out.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "estimator/estimate.hpp"
#include "host_sim/replay.hpp"
#include "measurement/sample.hpp"

namespace bms::images {

struct BoardRun {
  std::vector<estimator::EstimateWords> words;
  std::vector<std::uint32_t> state_words;  ///< of what the filter knows besides, row by row
  double steps_per_second = 0;  ///< from the first block of estimates to the last: the emulator's start-up is not in it
};

/// Boards that can be emulated: folder in boards/, QEMU's name, arithmetic.
struct EmulatedBoard {
  std::string name;
  std::string machine;
  host_sim::ScalarKind scalar;
};
const std::vector<EmulatedBoard>& emulated_boards();

/// Command line of the emulator for `image`; `semihosting`: the program's arguments.
std::vector<std::string> emulator_command(const EmulatedBoard& board, const std::filesystem::path& image,
                                          const std::vector<std::string>& semihosting);

/// Streams samples through `image` (a *_replay.elf). `more`: further options of the emulator.
/// states: of mechanisms, in each estimate. Throws std::runtime_error when the emulator fails or stops answering.
BoardRun run_on_board(const EmulatedBoard& board, const std::filesystem::path& image,
                      const std::vector<measurement::Sample>& samples,
                      const std::optional<measurement::StartingPoint>& start, const std::vector<std::string>& more = {},
                      std::size_t states = 0);

/// The same with the board's firmware for this cell, which is built if need be, as numbers.
host_sim::Track run_on_board(const EmulatedBoard& board, const files::CellFile& cell,
                             const std::vector<measurement::Sample>& samples,
                             const std::optional<measurement::StartingPoint>& start);

}  // namespace bms::images
