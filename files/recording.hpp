// Recordings: current, voltage and temperature over time, as CSV.
//
//   time_s,current_a,voltage_v[,temperature_c][,soc_ref][,current_ref_a][,voltage_ref_v]
//   header by name in any order; ',' or ';'; '#' starts a comment line
//
// Row k: current_a is the mean current over the interval that ends at time_s (> 0 charges); voltage_v is sampled at
// time_s. current_ref_a, voltage_ref_v: what a trusted instrument says of the same row, empty where there was none. An
// open contactor is 0 A. voltage_ref_v is at the cell's own terminals, or, with the contactor open, of a reference
// source in place of the cell: a row with current_ref_a = 0 and a voltage_ref_v is not taken for the cell's voltage.
// Refused (BadInput): missing column, non-number, time going backwards, fewer than 10 rows, empty or binary file.
// Accepted with a warning: what looks wrong but can be read (Warning::id below). 'nan' is a missing reading; time must
// be there.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "measurement/sample.hpp"
#include "model/cell_parameters.hpp"

namespace bms::files {

/// id: gap, duplicate_time, current_inverted, current_in_ma, voltage_in_mv, outside_cell_range, missing_reading,
/// ignored_column, soc_ref_in_percent
struct Warning {
  std::string id;
  std::string text;  ///< one sentence for a person
};

struct Recording {
  std::string path;
  std::vector<double> time_s;
  std::vector<double> current_a;
  std::vector<double> voltage_v;                     ///< empty: a profile
  std::vector<double> temperature_c;                 ///< empty: not recorded
  std::vector<double> soc_ref;                       ///< empty: not known
  std::vector<double> current_ref_a, voltage_ref_v;  ///< NaN where there was none; empty: no such column
  std::vector<Warning> warnings;
  double read_mb_per_second = 0;  ///< of this file, read and parsed

  std::size_t rows() const { return time_s.size(); }
  double duration_s() const { return time_s.empty() ? 0 : time_s.back() - time_s.front(); }
};

enum class VoltageColumn { required, optional };

Recording read_recording(const std::string& path, VoltageColumn voltage = VoltageColumn::required);

/// The same from text; `path` is for messages only.
Recording parse_recording(const std::string& text, const std::string& path,
                          VoltageColumn voltage = VoltageColumn::required);

/// Adds the warnings that need to know the cell: values outside its range.
void compare_with_cell(Recording& recording, const model::CellParameters<>& cell);

/// What the estimator sees of it: rounded to micro-units, time from the first row; a voltage that may be a reference
/// source's is left out.
std::vector<measurement::Sample> samples(const Recording& recording);

}  // namespace bms::files
