// Makes evidence/recordings/forklift_shift.csv: the experiment of that name is the true current of a plant cell, which
// is measured by imperfect instruments.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "experiments/experiment.hpp"
#include "plant/instruments.hpp"
#include "plant/truth_cell.hpp"

namespace bms::plant {

struct RecordedRow {
  double time_s;
  double current_a;      ///< as measured: mean over the interval that ends at time_s
  double voltage_v;      ///< as measured at time_s
  double temperature_c;  ///< as measured at time_s
  double soc;            ///< of the plant
};

/// Ambient temperature, linear over the profile.
struct Ambient {
  double start_c = 20;
  double end_c = 20;
};

/// Runs the cell with the profile, whose current is the true one, and measures it.
std::vector<RecordedRow> record(const std::vector<bms::experiments::ProfileRow>& profile, Cell& cell,
                                Instruments& instruments, const Ambient& ambient);

/// The text of the file, comment lines included.
std::string forklift_shift_csv();

}  // namespace bms::plant
