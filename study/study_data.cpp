#include "study/study_data.hpp"

#include <algorithm>

#include "experiments/experiment.hpp"
#include "host_sim/gaussian_noise.hpp"
#include "plant/truth_cell.hpp"

namespace bms::study {

namespace {

constexpr double nominal_capacity_ah = 6, ambient_c = 20;
constexpr double current_noise_a = 0.010, voltage_noise_v = 0.001;
constexpr double window_margin_soc = 0.001;

void add(StudyData& part, double time_s, double current_a, double voltage_v, double soc) {
  part.data.time_s.edit().push_back(time_s);
  part.data.current_a.edit().push_back(current_a);
  part.data.voltage_v.edit().push_back(voltage_v);
  part.soc_min = std::min(part.soc_min, soc);
  part.soc_max = std::max(part.soc_max, soc);
}

}  // namespace

StudyData run_on_plant(const std::string& experiment, double soc_from, std::uint64_t seed) {
  const auto profile = experiments::experiment(experiment).value();
  plant::Cell cell({}, {.soc = soc_from, .v_rc_v = 0, .temperature_c = ambient_c});
  host_sim::GaussianNoise noise(seed);
  StudyData part{experiment, {}, soc_from, 1, 0};
  part.data.capacity_ah = nominal_capacity_ah;
  double before_s = 0;
  for (const experiments::ProfileRow& row : profile) {
    if (row.time_s > before_s) cell.run(row.current_a, ambient_c, row.time_s - before_s);
    before_s = row.time_s;
    const double current_a = row.current_a + current_noise_a * noise.next();
    const double voltage_v = cell.voltage_v() + voltage_noise_v * noise.next();
    add(part, row.time_s, current_a, voltage_v, cell.soc());
  }
  return part;
}

StudyData window(const StudyData& whole, const std::string& name, double high_soc, double low_soc) {
  StudyData part{name, {}, high_soc, 1, 0};
  const identification::Data& data = whole.data;
  part.data.capacity_ah = data.capacity_ah;
  double soc = whole.soc_from;
  for (std::size_t k = 0; k < data.size(); ++k) {
    if (k > 0) soc += data.current_a[k] * (data.time_s[k] - data.time_s[k - 1]) / (3'600 * data.capacity_ah);
    if (soc > high_soc + window_margin_soc) continue;
    if (soc < low_soc - window_margin_soc) break;
    if (part.data.size() == 0) part.soc_from = soc;
    add(part, data.time_s[k], data.current_a[k], data.voltage_v[k], soc);
  }
  return part;
}

}  // namespace bms::study
