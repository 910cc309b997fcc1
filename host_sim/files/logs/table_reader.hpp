// The rows of a table as a recording.
#pragma once

#include "files/logs/text_lines.hpp"
#include "files/recording.hpp"

namespace bms::files {

inline constexpr std::size_t fewest_rows = 10;    ///< of a recording
inline constexpr double largest_step_back_s = 2;  ///< of rows and frames that are left out
inline constexpr double longest_s = 3.2e8;        ///< of a recording: ten years
inline constexpr double largest_reading = 1e9;    ///< in any unit from microvolts to amperes

/// Reads all lines. Throws BadInput. The recording is not checked for plausibility yet.
measurement::Recording read_table(TextLines& lines, const std::string& path, VoltageColumn voltage,
                                  const ReadOptions& options);

/// Reserves memory for the columns of a table of this size, from the length of its first line.
std::size_t expected_rows(std::size_t bytes, std::size_t line_length);

}  // namespace bms::files
