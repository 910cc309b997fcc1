#include "host_sim/identified_cell.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <stdexcept>

#include <fmt/format.h>

#include "host_sim/bad_input.hpp"
#include "host_sim/cell_fields.hpp"
#include "identification/ocv_curve.hpp"

namespace bms {

namespace id = identification;

OcvTaken take_ocv(const std::vector<std::string>& paths, double error_asked_v, CellFile& cell) {
  OcvTaken taken;
  std::vector<id::SlowRun> runs;
  std::string files;
  for (const std::string& path : paths) {
    const Recording r = read_recording(path);
    runs.push_back({{r.time_s, r.current_a, r.voltage_v, 0}, r.soc_ref});
    files += (files.empty() ? "" : ", ") + std::filesystem::path(path).filename().string();
  }
  id::OcvCurve curve;
  try {
    curve = id::ocv_curve(runs);
  } catch (const std::invalid_argument& error) {
    throw BadInput(paths.front(), 1, error.what());
  }
  double error_v = error_asked_v;
  auto pieces = id::fewest_pieces(curve, error_v);
  while (!pieces || pieces->soc.size() > model::max_ocv_edges) {
    error_v *= 1.5;
    if (error_v > 0.05) throw BadInput(paths.front(), 1, "the open-circuit voltage does not rise with the state of charge, expected slow runs of a whole charge or discharge");
    pieces = id::fewest_pieces(curve, error_v);
  }
  if (error_v > error_asked_v) {
    taken.warnings.push_back({"ocv_error", fmt::format("the straight pieces of the OCV are up to {:.1f} mV off, {:.1f} were asked for", 1e3 * pieces->largest_error_v, 1e3 * error_asked_v)});
  }
  auto& ocv = cell.parameters.ocv;
  ocv = {};
  for (std::size_t k = 0; k < pieces->soc.size(); ++k) {
    ocv.soc.push_back(pieces->soc[k]);
    if (curve.coulombic_efficiency) ocv.half_gap_v.push_back(pieces->half_gap_v[k]);
    if (k == 0) continue;
    const double b1_v = (pieces->ocv_v[k] - pieces->ocv_v[k - 1]) / (pieces->soc[k] - pieces->soc[k - 1]);
    ocv.b0_v.push_back(pieces->ocv_v[k] - b1_v * pieces->soc[k]);
    ocv.b1_v.push_back(b1_v);
  }
  cell.parameters.tolerance.ocv_v = std::max(0.0005, pieces->largest_error_v);
  cell.parameters.capacity_ah = curve.capacity_ah;
  taken.coulombic_efficiency = curve.coulombic_efficiency;
  cell.sources["ocv"] = fmt::format("{} of {}; {} straight pieces, within {:.1f} mV", curve.coulombic_efficiency ? "middle of slow charge and discharge" : "slow run", files,
                                    pieces->soc.size() - 1, 1e3 * pieces->largest_error_v);
  return taken;
}

void take_noise(const std::vector<Recording>& recordings, const id::Fit& judge, const std::vector<id::Parameter>& parameters, model::CellParameters<>& p) {
  std::vector<double> voltage_steps, current_steps;
  double step_s = 1;
  for (const Recording& r : recordings) {
    const double quiet_a = 0.02 * p.capacity_ah;
    for (std::size_t k = 2; k < r.rows(); ++k) {
      if (std::abs(r.current_a[k]) > quiet_a || std::abs(r.current_a[k - 1]) > quiet_a || std::abs(r.current_a[k - 2]) > quiet_a) continue;
      // second differences: what relaxes slowly is not noise
      const double v = r.voltage_v[k] - 2 * r.voltage_v[k - 1] + r.voltage_v[k - 2], i = r.current_a[k] - 2 * r.current_a[k - 1] + r.current_a[k - 2];
      if (std::isfinite(v) && std::isfinite(i)) voltage_steps.push_back(v * v), current_steps.push_back(i * i);
    }
    step_s = std::max(0.01, r.duration_s() / static_cast<double>(r.rows() - 1));
  }
  const auto sigma = [](const std::vector<double>& squares) {
    double sum = 0;
    for (const double s : squares) sum += s;
    return std::sqrt(sum / static_cast<double>(squares.size()) / 6);  // 1 + 4 + 1
  };
  constexpr std::size_t enough = 30;
  if (voltage_steps.size() >= enough) {
    p.noise.voltage_v = std::clamp(sigma(voltage_steps), 0.0002, 0.05);
    p.noise.current_a = std::clamp(sigma(current_steps), 1e-4 * p.capacity_ah, 0.1 * p.capacity_ah);
  }
  double model_v = judge.rmse_v;
  // with its mean, which is an error that lasts
  p.noise.model_correlation_s = std::clamp(id::correlation_length(id::without_missing(judge.error_v)) * step_s, 1.0, 20'000.0);
  if (p.ocv.half_gap_v.size > 0) {
    double gap_v = 0;
    for (std::size_t k = 0; k < p.ocv.half_gap_v.size; ++k) {
      if (p.ocv.soc[k] > 0.1 && p.ocv.soc[k] < 0.95) gap_v = std::max(gap_v, p.ocv.half_gap_v[k]);
    }
    // The voltage is somewhere between the slow curves, and the model leans: how far it is off on the other side no recording needs to
    // have shown. As evenly distributed; and it lasts until the current has turned for a good part of an hour.
    model_v = std::max(model_v, (1 + std::abs(p.ocv.lean)) * gap_v / std::sqrt(3.0));
    p.noise.model_correlation_s = std::max(p.noise.model_correlation_s, 3'000.0);
    p.noise.rest_v = std::clamp((1 + std::abs(p.ocv.lean)) * gap_v, p.noise.rest_v, 0.2);
  }
  p.noise.model_v = std::clamp(model_v, 0.0005, 0.2);
  double largest = 0.005;
  for (const id::Parameter& q : parameters) {
    if (q.name == "r0_ohm" && q.value > 0) largest = std::max(largest, std::min(0.5, 2 * q.std / q.value));
  }
  p.tolerance.resistance_fraction = largest;
}

namespace {

struct Rounding {
  static void table(const char*) {}
  static void number(const char*, double& value) { value = std::stod(fmt::format("{:.7g}", value)); }
  static void optional_number(const char* key, double& value) { number(key, value); }
  template <class Column>
  static void column(const char* key, Column& values) {
    for (std::size_t k = 0; k < values.size; ++k) number(key, values[k]);
  }
  template <class Column>
  static void optional_column(const char* key, Column& values) {
    column(key, values);
  }
};

}  // namespace

void round_digits(CellFile& cell) {
  Rounding rounding;
  visit_cell(rounding, cell.parameters);
  for (TemperatureTable& at : cell.at_temperature) visit_rc(rounding, at.rc);
}

}  // namespace bms
