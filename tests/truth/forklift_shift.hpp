// recordings/forklift_shift.csv: the experiment of that name as the true current of a truth cell, seen through its
// instruments.
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
  double soc;            ///< true
};

/// Goes straight from start to end over the profile.
struct Ambient {
  double start_c = 20;
  double end_c = 20;
};

/// Drives the cell through the profile, whose current is the true one.
std::vector<RecordedRow> record(const std::vector<bms::experiments::ProfileRow>& profile, Cell& cell,
                                Instruments& instruments, const Ambient& ambient);

/// The text of the file, comment lines included.
std::string forklift_shift_csv();

}  // namespace bms::plant
