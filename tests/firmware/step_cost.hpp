// Cost of an estimator step on an emulated board, in instructions (tests/firmware/instruction_count.c).
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

/// Counts the instructions of a function and its callees, without interrupts. states: number of additional states in
/// the estimates of the cell.
StepCost count_instructions(const images::EmulatedBoard& board, const std::filesystem::path& replay_image,
                            const std::vector<measurement::Sample>& samples, std::size_t states = 0,
                            const char* function = "bms::firmware::estimator_step(");

/// The same for an image that needs no samples and ends by itself.
StepCost count_instructions(const images::EmulatedBoard& board, const std::filesystem::path& image,
                            const char* function);

/// Bytes.
struct Footprint {
  std::uint64_t estimator_text = 0;  ///< code of estimator and model, start-up of the filter included
  std::uint64_t cell_tables = 0;     ///< the cell's constants
  std::uint64_t step_stack = 0;      ///< frame of a step; its callees are inline
  std::uint64_t image_text = 0;      ///< code and constants of the whole application
  std::uint64_t image_ram = 0;       ///< its data and bss, without the stack
};
Footprint footprint(const std::filesystem::path& application_image);

/// Rows (name and figure) of the table in estimator/README.md for a board with fixed point.
std::vector<std::pair<std::string, double>> core_figures(const images::EmulatedBoard& board,
                                                         const files::CellFile& cell,
                                                         const std::vector<measurement::Sample>& samples);

/// Rows of the table for a board with float.
std::vector<std::pair<std::string, double>> step_figures(const images::EmulatedBoard& board,
                                                         const files::CellFile& cell,
                                                         const std::vector<measurement::Sample>& samples);

/// The same filter with its covariance in three forms (tests/firmware/filter_forms_image.cpp): what it is, and its
/// cost.
std::vector<std::pair<std::string, StepCost>> filter_form_costs(const images::EmulatedBoard& board,
                                                                const files::CellFile& cell);

/// Rows of the table in firmware/protection/README.md.
std::vector<std::pair<std::string, double>> protection_figures(const images::EmulatedBoard& board,
                                                               const files::CellFile& cell);

}  // namespace bms::firmware
