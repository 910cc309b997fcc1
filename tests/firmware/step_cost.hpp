// What an estimator step costs on an emulated board, counted in instructions (tests/firmware/instruction_count.c).
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "files/cell_file.hpp"
#include "images/emulator.hpp"
#include "measurement/sample.hpp"

namespace bms::firmware {

struct StepCost {
  std::uint64_t calls = 0, first = 0, least = 0, most = 0;
  double mean = 0;  ///< of all calls but the first, which starts the estimator
};

/// Instructions inside a function of the firmware and all that it calls, interrupts left out. states: that the cell's
/// estimates tell besides.
StepCost count_instructions(const images::EmulatedBoard& board, const std::filesystem::path& replay_image,
                            const std::vector<measurement::Sample>& samples, std::size_t states = 0,
                            const char* function = "bms::firmware::estimator_step(");

/// The same of an image that needs no samples and ends by itself.
StepCost count_instructions(const images::EmulatedBoard& board, const std::filesystem::path& image,
                            const char* function);

/// Bytes.
struct Footprint {
  std::uint64_t estimator_text = 0;  ///< code of estimator and model, start-up of the filter included
  std::uint64_t cell_tables = 0;     ///< the cell's constants
  std::uint64_t step_stack = 0;      ///< frame of a step; what it calls is inline
  std::uint64_t image_text = 0;      ///< code and constants of the whole application
  std::uint64_t image_ram = 0;       ///< its data and bss, without the stack
};
Footprint footprint(const std::filesystem::path& application_image);

/// The rows of the table in estimator/README.md that a board in integers has: what it is, and the figure.
std::vector<std::pair<std::string, double>> core_figures(const images::EmulatedBoard& board,
                                                         const files::CellFile& cell,
                                                         const std::vector<measurement::Sample>& samples);

/// The rows of the float board's.
std::vector<std::pair<std::string, double>> step_figures(const images::EmulatedBoard& board,
                                                         const files::CellFile& cell,
                                                         const std::vector<measurement::Sample>& samples);

/// The rows of the table of costs in protection/README.md.
std::vector<std::pair<std::string, double>> protection_figures(const images::EmulatedBoard& board,
                                                               const files::CellFile& cell);

}  // namespace bms::firmware
