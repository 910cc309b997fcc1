// The shipped recording of a forklift shift, for tests that do without the readers of host_sim/files/.
#pragma once

#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace bms::tests {

struct ShiftRow {
  double time_s = 0, current_a = 0, voltage_v = 0, temperature_c = 0;
};

/// Rows of evidence/recordings/forklift_shift.csv, whose first four columns are those of ShiftRow. source: the folder
/// that holds evidence/recordings/. Throws std::runtime_error if the file has another form.
inline std::vector<ShiftRow> forklift_shift(const std::string& source) {
  std::ifstream file(source + "/evidence/recordings/forklift_shift.csv");
  std::string line;
  while (std::getline(file, line) && line.starts_with('#')) {
  }
  if (!line.starts_with("time_s,current_a,voltage_v,temperature_c")) throw std::runtime_error("columns: " + line);
  std::vector<ShiftRow> rows;
  while (std::getline(file, line)) {
    ShiftRow row;
    std::istringstream fields(line);
    char comma = ',';
    fields >> row.time_s >> comma >> row.current_a >> comma >> row.voltage_v >> comma >> row.temperature_c;
    if (!fields) throw std::runtime_error("row: " + line);
    rows.push_back(row);
  }
  return rows;
}

}  // namespace bms::tests
