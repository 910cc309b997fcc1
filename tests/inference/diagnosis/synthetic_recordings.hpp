// Synthetic recordings for the tests of the diagnosis: the plant's cell, with equations that the diagnosis does not
// know.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "diagnosis/prepared_recording.hpp"
#include "files/cell_file.hpp"
#include "plant/random.hpp"
#include "plant/truth_cell.hpp"

namespace bms::test {

/// Drive of so many hours: charging and discharging spells of up to 2C, with rests; samples every second.
inline std::vector<double> drive(double hours, std::uint64_t seed, double capacity_ah = 6) {
  plant::Random random(seed);
  std::vector<double> current_a;
  const auto samples = static_cast<std::size_t>(hours * 3'600);
  double soc_moved = 0;
  while (current_a.size() < samples) {
    const double spell_s = 20 + 160 * random.uniform(), level = random.uniform();
    double c = 0;
    if (level >= 0.25) c = (level < 0.65 ? -2 : 1.6) * random.uniform();
    if (soc_moved < -0.4) c = std::abs(c);
    if (soc_moved > 0.05) c = -std::abs(c);
    for (int k = 0; k < static_cast<int>(spell_s); ++k) {
      current_a.push_back(c * capacity_ah);
      soc_moved += c / 3'600;
    }
  }
  current_a.resize(samples);
  return current_a;
}

/// The plant's cell (Table 9 made smooth) as instruments with 1 mV and 10 mA of noise read it. add_v(row, current,
/// soc): added to the voltage.
inline diagnosis::PreparedRecording recorded(const std::vector<double>& current_a, double initial_soc,
                                             std::uint64_t seed,
                                             const std::function<double(std::size_t, double, double)>& add_v = {}) {
  plant::Random random(seed);
  plant::Cell cell({}, {.soc = initial_soc, .v_rc_v = 0, .temperature_c = 25});
  diagnosis::PreparedRecording r;
  r.name = "plant";
  r.initial_soc = initial_soc;
  for (std::size_t k = 0; k < current_a.size(); ++k) {
    cell.run(current_a[k], 25, 1);
    r.time_s.edit().push_back(static_cast<double>(k));
    r.current_a.edit().push_back(current_a[k] + 0.01 * random.normal());
    r.voltage_v.edit().push_back(cell.voltage_v() + (add_v ? add_v(k, current_a[k], cell.soc()) : 0) +
                                 0.001 * random.normal());
  }
  return r;
}

inline model::CellParameters<> table9() { return files::read_cell("table9").parameters; }

}  // namespace bms::test
