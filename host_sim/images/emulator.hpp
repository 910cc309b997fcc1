// An emulated board: runs the replay image of the firmware in QEMU. It receives samples and returns estimates.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "estimator/estimate.hpp"
#include "measurement/sample.hpp"
#include "replay/replay.hpp"

namespace bms::images {

struct BoardRun {
  std::vector<estimator::EstimateWords> words;
  std::vector<std::uint32_t> state_words;  ///< further states of the filter, `states` for each sample
  double steps_per_second = 0;             ///< from the first block of estimates to the last, without the start of the
                                           ///< emulator
};

struct EmulatedBoard {
  std::string name;           ///< folder in boards/
  std::string machine;        ///< its name in QEMU
  replay::ScalarKind scalar;  ///< number type of its estimator
};
const std::vector<EmulatedBoard>& emulated_boards();

/// Command line of the emulator for `image`. semihosting: the arguments of the image. Throws BadInput if one of them
/// has a space.
std::vector<std::string> emulator_command(const EmulatedBoard& board, const std::filesystem::path& image,
                                          const std::vector<std::string>& semihosting);

/// Runs `image` (a *_replay.elf) with these samples. more: further options of the emulator; states: number of states of
/// mechanisms in each estimate. Throws std::runtime_error if the emulator fails or stops answering.
BoardRun run_on_board(const EmulatedBoard& board, const std::filesystem::path& image,
                      const std::vector<measurement::Sample>& samples,
                      const std::optional<measurement::StartingPoint>& start, const std::vector<std::string>& more = {},
                      std::size_t states = 0);

/// The same with the firmware of the board for this cell, which is built if necessary. Throws as firmware_image(), too.
replay::Track run_on_board(const EmulatedBoard& board, const files::CellFile& cell,
                           const std::vector<measurement::Sample>& samples,
                           const std::optional<measurement::StartingPoint>& start);

}  // namespace bms::images
