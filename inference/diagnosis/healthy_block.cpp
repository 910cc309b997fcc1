#include "diagnosis/healthy_block.hpp"

#include <cmath>

#include <fmt/format.h>

#include "diagnosis/charge_count.hpp"
#include "diagnosis/numerics.hpp"
#include "measurement/statistics.hpp"

namespace bms::diagnosis {

namespace {

/// Rounded, to be read in a file.
double in_short(double value) { return std::isfinite(value) ? std::stod(fmt::format("{:.4g}", value)) : value; }

}  // namespace

healthy_data::HealthyBlock healthy_block(const PreparedRecording& record, const Diagnosis& d) {
  healthy_data::HealthyBlock b;
  b.recording = record.name;
  b.start_s = record.time_s.front();
  b.duration_s = record.duration_s();
  measurement::MeanSquare error;
  for_each_row(record, d.cell.capacity_ah, [&](const CountedRow& row) {
    const double e = record.voltage_v[row.k] - d.views.front().base_v[row.k];
    if (std::isfinite(e)) error.add(e);
    b.soc.add(in_short(row.soc));
    b.current_a.add(in_short(row.current_a));
    if (!record.temperature_c.empty()) b.temperature_c.add(in_short(record.temperature_c[row.k]));
  });
  b.error_v = in_short(error.root());
  const auto add = [&](std::string cause, double gain) {
    if (gain >= numerics.search.least_gain) b.gains.push_back({std::move(cause), in_short(gain)});
  };
  for (const MechanismGain& e : d.gains) add(std::string(model::catalogue[e.mechanism].id), e.gain);
  add(healthy_data::unknown_cause, d.unknown_gain);
  return b;
}

}  // namespace bms::diagnosis
