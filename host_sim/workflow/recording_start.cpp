#include "workflow/recording_start.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "diagnosis/thresholds.hpp"
#include "model/start.hpp"
#include "replay/replay.hpp"
#include "workflow/likeliest_start.hpp"

namespace bms::workflow {

namespace {

constexpr double least_start_sigma = 1e-4;  ///< of a given initial SOC
constexpr double contradiction_sigmas = 3;  ///< between two statements of one start

/// The first value of soc_ref; nothing if it is missing or not a state of charge.
std::optional<StartSoc> reference_start(const measurement::Recording& r, const files::CellFile& cell) {
  if (r.soc_ref.empty() || !(r.soc_ref.front() >= 0 && r.soc_ref.front() <= 1)) return std::nullopt;
  return given_start(cell, r.soc_ref.front() - model::start_shift(cell.mechanisms));
}

struct FirstVoltage {
  StartSoc start;  ///< as the estimator concludes
  double voltage_v = 0;
  bool at_rest = false;
};

/// Nothing if no sample has a voltage.
std::optional<FirstVoltage> first_voltage(const measurement::Recording& r, const files::CellFile& cell) {
  const auto first = std::find_if(r.voltage_v.begin(), r.voltage_v.end(), [](double v) { return std::isfinite(v); });
  if (first == r.voltage_v.end()) return std::nullopt;
  measurement::Recording one;
  const auto k = static_cast<std::size_t>(first - r.voltage_v.begin());
  one.time_s = r.time_s.part(k, 1);
  one.current_a = r.current_a.part(k, 1);
  one.voltage_v = r.voltage_v.part(k, 1);
  one.temperature_c = r.temperature_c.part(k, 1);
  const replay::EstimateRow row =
      replay::run_on_host(cell, measurement::samples(one), std::nullopt, replay::ScalarKind::float64).rows.front();
  return FirstVoltage{
      {row.soc - model::start_shift(cell.mechanisms), row.soc_sigma, false},
      *first,
      k == 0 && std::abs(r.current_a[0]) < diagnosis::thresholds.noise.start_current_c * cell.parameters.capacity_ah};
}

/// Of two statements of one start.
bool contradict(const StartSoc& a, const StartSoc& b) {
  return std::abs(a.soc - b.soc) > contradiction_sigmas * std::hypot(a.sigma, b.sigma);
}

/// Compares a known start with soc_ref, unless it is from there, and with the first voltage.
void find_contradiction(const measurement::Recording& r, const files::CellFile& cell, bool by_user,
                        RecordingStart& found) {
  std::string what;
  if (const auto reference = reference_start(r, cell); by_user && reference && contradict(*reference, found.start)) {
    found.start.contradicted_by = reference->soc;
    what = fmt::format("the column soc_ref begins at {:.1f} %", 100 * reference->soc);
  }
  if (const auto first = first_voltage(r, cell); first && first->at_rest && contradict(first->start, found.start)) {
    if (!found.start.contradicted_by) found.start.contradicted_by = first->start.soc;
    what +=
        fmt::format("{}the first voltage, {:.3f} V at rest, is that of {:.1f} %, standard deviation {:.1f} %",
                    what.empty() ? "" : " and ", first->voltage_v, 100 * first->start.soc, 100 * first->start.sigma);
  }
  if (what.empty()) return;
  found.contradiction = fmt::format("the start of {:.1f} % {} is contradicted: {}", 100 * found.start.soc,
                                    by_user ? "(--initial-soc)" : "(first value of soc_ref)", what);
}

}  // namespace

StartSoc given_start(const files::CellFile& cell, double soc) {
  return {soc, std::max(cell.parameters.tolerance.initial_soc, least_start_sigma), true};
}

RecordingStart recording_start(const measurement::Recording& r, const files::CellFile& cell,
                               const std::optional<double>& given) {
  RecordingStart found;
  if (given) {
    found.start = given_start(cell, *given);
    find_contradiction(r, cell, true, found);
  } else if (const auto reference = reference_start(r, cell)) {
    found.start = *reference;
    found.origin = fmt::format("starts at the first value of soc_ref, {:.1f} %", 100 * found.start.soc);
    find_contradiction(r, cell, false, found);
  } else if (const auto first = first_voltage(r, cell)) {
    found.start = likeliest_start(r, cell, first->start);
    found.origin = fmt::format(
        "starts at the state of charge estimated from the first voltage, {:.0f} % with a standard deviation of "
        "{:.0f} %",
        100 * first->start.soc, 100 * first->start.sigma);
    if (found.start.soc != first->start.soc)
      found.origin += fmt::format("; the whole recording fits best from {:.1f} % on", 100 * found.start.soc);
  }
  return found;
}

StartSoc start_of(const measurement::Recording& r, const files::CellFile& cell) {
  return recording_start(r, cell).start;
}

}  // namespace bms::workflow
