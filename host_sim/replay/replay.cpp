#include "replay/replay.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <iterator>

#include <fmt/format.h>

#include "identification/goodness_of_fit.hpp"
#include "measurement/soc_column_text.hpp"
#include "replay/capacity_estimate.hpp"
#include "replay/replay_run.hpp"
#include "replay/simulation.hpp"

namespace bms::replay {

namespace {

constexpr double thirty_minutes_s = 1'800;
/// The first values of an estimator::ExtendedEstimate if sensor errors are states.
constexpr std::array<const char*, error_values> error_names = {"voltage_error_v", "current_offset_a",
                                                               "current_offset_sigma_a"};
constexpr std::size_t current_offset_at = 1, current_offset_sigma_at = 2;

/// The number that a word of an estimate holds, as a board writes it.
double number_of(std::uint32_t word, ScalarKind scalar) {
  if (scalar == ScalarKind::float32) return std::bit_cast<float>(word);
  return static_cast<double>(
      arithmetic::Soc<arithmetic::FixedPoint>::from_raw(static_cast<std::int32_t>(word)));  // all four are Q3.27
}

}  // namespace

const char* name_of(ScalarKind scalar) {
  switch (scalar) {
    case ScalarKind::float32:
      return "float";
    case ScalarKind::fixed:
      return "fixed";
    case ScalarKind::float64:
      return "double";
  }
  return "";
}

std::optional<measurement::StartingPoint> starting_point(const std::optional<SocPrior>& prior, double shift) {
  if (!prior) return std::nullopt;
  return measurement::StartingPoint{
      static_cast<std::int32_t>(std::lround(std::clamp(prior->soc + shift, 0.0, 1.0) * 1e9)),
      static_cast<std::int32_t>(std::lround(prior->sigma * 1e9))};
}

EstimateRow Estimates::operator[](std::size_t row) const {
  static_assert(std::same_as<arithmetic::Soc<arithmetic::FixedPoint>, arithmetic::Voltage<arithmetic::FixedPoint>>,
                "one conversion serves all four numbers");
  if (scalar_ == ScalarKind::float64) return numbers_[row];
  const estimator::EstimateWords& w = words_[row];
  return {number_of(w[0], scalar_), number_of(w[1], scalar_), number_of(w[2], scalar_), number_of(w[3], scalar_), w[4]};
}

double Track::state(std::size_t row, std::size_t index) const {
  const std::size_t at = row * state_names.size() + index;
  return state_scales[index] * (scalar == ScalarKind::float64 ? state_numbers[at] : number_of(state_words[at], scalar));
}

Track run_on_host(const files::CellFile& cell, const measurement::SampleList& samples, const Start& start,
                  ScalarKind scalar, Timing timing) {
  Track track = [&] {
    switch (scalar) {
      case ScalarKind::fixed:
        files::reject_if_fpu_needed(cell);
        return run<arithmetic::FixedPoint>(cell, samples, start, timing);
      case ScalarKind::float64:
        return run<double>(cell, samples, start, timing);
      default:
        return run<float>(cell, samples, start, timing);
    }
  }();
  track.scalar = scalar;
  name_states(track, cell);
  return track;
}

std::size_t state_count(const files::CellFile& cell) {
  std::size_t count = cell.parameters.noise.errors_are_states ? error_names.size() : 0;
  for (const model::MechanismSetting& m : files::on_board(cell.mechanisms)) count += model::catalogue[m.index].states;
  return count;
}

void name_states(Track& track, const files::CellFile& cell) {
  if (cell.parameters.noise.errors_are_states) {
    track.state_names.assign(error_names.begin(), error_names.end());
    track.state_scales = {1, cell.parameters.capacity_ah, cell.parameters.capacity_ah};
  }
  for (const model::MechanismSetting& m : files::on_board(cell.mechanisms)) {
    const model::MechanismInfo& info = model::catalogue[m.index];
    for (std::size_t k = 0; k < info.states; ++k) {
      track.state_names.push_back(
          fmt::format("{}{}_{}", info.id, info.states > 1 ? fmt::format("_{}", k + 1) : "", info.state_unit.name));
      track.state_scales.push_back(info.state_unit.scale);
    }
  }
}

std::optional<Difference> first_difference(const Track& host, const Track& board, ScalarKind scalar) {
  const std::vector<estimator::EstimateWords>&words = host.rows.words(), &others = board.rows.words();
  const std::size_t both = std::min(words.size(), others.size());
  for (std::size_t k = 0; k < both; ++k) {
    for (std::size_t w = 0; w < estimator::estimate_words; ++w) {
      const std::uint32_t a = words[k][w], b = others[k][w];
      if (a == b) continue;
      const bool flags = w + 1 == estimator::estimate_words;
      return Difference{k, estimator::estimate_word_names[w], flags ? a : number_of(a, scalar),
                        flags ? b : number_of(b, scalar)};
    }
    for (std::size_t s = 0; s < host.state_names.size() && host.state_names == board.state_names; ++s) {
      const std::uint32_t a = host.state_words[k * host.state_names.size() + s],
                          b = board.state_words[k * host.state_names.size() + s];
      if (a != b) return Difference{k, host.state_names[s], number_of(a, scalar), number_of(b, scalar)};
    }
  }
  if (words.size() != others.size())
    return Difference{both, "number of estimates", static_cast<double>(words.size()),
                      static_cast<double>(others.size())};
  return std::nullopt;
}

namespace {

/// Flags of a sample whose voltage the filter did not use: its prediction cannot be judged.
constexpr std::uint32_t voltage_not_used = estimator::voltage_missing | estimator::voltage_implausible |
                                           estimator::voltage_stuck | estimator::time_not_increasing |
                                           estimator::not_started;
constexpr std::uint32_t voltage_not_measured = estimator::voltage_missing | estimator::voltage_implausible;

double open_loop_start(const ReplayResult& result) {
  const measurement::Recording& r = result.recording;
  if (result.open_loop_soc) return *result.open_loop_soc;
  // the mechanism initial_soc is a shift of the user's assumption, not of a reference or an estimate
  const double shift = model::start_shift(result.cell.mechanisms);
  const bool reference = !r.soc_ref.empty() && r.soc_ref.front() >= 0 && r.soc_ref.front() <= 1;
  if (reference) return r.soc_ref.front() - shift;
  return result.prior ? result.initial_soc : result.initial_soc - shift;
}

/// What the filter has found of the sensor's offset, at the end; nothing else.
SocFigures offset_figures(const ReplayResult& result) {
  SocFigures figures;
  if (!result.cell.parameters.noise.errors_are_states) return figures;
  const std::size_t last = result.track.rows.size() - 1;
  figures.current_offset_a = result.track.state(last, current_offset_at);
  figures.current_offset_sigma_a = result.track.state(last, current_offset_sigma_at);
  return figures;
}

SocFigures soc_figures(const ReplayResult& result) {
  const measurement::Recording& r = result.recording;
  const Estimates& rows = result.track.rows;
  identification::ErrorFigure all, later;
  std::size_t inside = 0;
  // a column that counts with another capacity says nothing of a count with the cell's own
  const bool other_count = result.counted_capacity_ah && result.soc_column &&
                           std::ranges::any_of(result.soc_column->events, [](const measurement::SocEvent& e) {
                             return e.fault == measurement::SocFault::capacity;
                           });
  const bool reference = !r.soc_ref.empty() && !other_count && !(result.soc_column && result.soc_column->contradicts());
  for (std::size_t k = 0; k < rows.size() && reference; ++k) {
    if (std::isnan(r.soc_ref[k])) continue;
    const EstimateRow e = rows[k];
    const double error = e.soc - r.soc_ref[k];
    all.add(error);
    if (r.time_s[k] - r.time_s.front() >= thirty_minutes_s) later.add(error);
    if (std::abs(error) <= 2 * e.soc_sigma) ++inside;
  }
  SocFigures figures = offset_figures(result);
  figures.final = rows.back().soc;
  figures.final_sigma = rows.back().soc_sigma;
  if (all.count() > 0) {
    figures.rmse = all.rms();
    figures.max_error = all.max();
    figures.within_2_sigma = static_cast<double>(inside) / static_cast<double>(all.count());
  }
  if (later.count() > 0) {
    figures.rmse_after_30min = later.rms();
    figures.max_error_after_30min = later.max();
  }
  return figures;
}

VoltageFigures voltage_figures(const ReplayResult& result) {
  const measurement::Column& measured_v = result.recording.voltage_v;
  const Estimates& rows = result.track.rows;
  identification::ErrorFigure prediction, open_loop;
  identification::FitFigure fit;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const EstimateRow e = rows[k];
    if (k > 0 && (e.flags & voltage_not_used) == 0) prediction.add(measured_v[k] - e.voltage_predicted_v);
    if ((e.flags & voltage_not_measured) != 0) continue;
    open_loop.add(measured_v[k] - result.open_loop_v[k]);
    fit.add(measured_v[k], result.open_loop_v[k]);
  }
  VoltageFigures figures;
  if (prediction.count() > 0) {
    figures.prediction_rmse_v = prediction.rms();
    figures.prediction_max_v = prediction.max();
  }
  if (open_loop.count() > 0) {
    figures.open_loop_rmse_v = open_loop.rms();
    figures.open_loop_fit_percent = fit.percent();
  }
  return figures;
}

}  // namespace

void evaluate(ReplayResult& result) {
  const measurement::Recording& r = result.recording;
  if (!result.prior) result.initial_soc = result.track.rows.front().soc;
  const auto cell = model::prepare<double, model::max_intervals>(result.cell.parameters);
  result.open_loop_v.clear();
  result.open_loop_v.reserve(r.rows());
  simulate({.cell = cell,
            .capacity_ah = result.counted_capacity_ah.value_or(result.cell.parameters.capacity_ah),
            .mechanisms = result.cell.mechanisms,
            .time_s = r.time_s,
            .current_a = r.current_a,
            .temperature_c = r.temperature_c,
            .initial_soc = open_loop_start(result)},
           [&](const SimulatedRow& row) { result.open_loop_v.push_back(row.voltage_v); });
  if (!result.counted_capacity_ah) {
    result.soc = offset_figures(result);
    result.capacity = estimate_capacity(result);
  }
  // a count with the file's capacity is wrong if the cell has another one
  const double capacity_ah = capacity_differs(result) ? result.capacity->value_ah : result.cell.parameters.capacity_ah;
  result.soc_column = measurement::own_soc_column(r, capacity_ah);
  result.soc = soc_figures(result);
  result.reasons = reasons_of(result);
  result.voltage = voltage_figures(result);
}

void write_trace(const ReplayResult& result, const files::Sink& sink) {
  constexpr std::size_t piece_bytes = 1U << 20;
  const auto& names = result.track.state_names;
  std::string csv = "time_s,soc,soc_sigma,v_rc_v,voltage_predicted_v,voltage_measured_v,";
  for (const std::string& name : names) csv += name + ",";
  csv += "flags\n";
  const auto field = [&](auto value) {  // empty: missing
    if (std::isfinite(value)) fmt::format_to(std::back_inserter(csv), "{}", value);
    csv += ",";
  };
  const auto number = [&](double value) {
    if (result.scalar == ScalarKind::float32)
      field(static_cast<float>(value));
    else
      field(value);
  };
  for (std::size_t k = 0; k < result.track.rows.size(); ++k) {
    const EstimateRow e = result.track.rows[k];
    fmt::format_to(std::back_inserter(csv), "{},", result.recording.time_s[k]);
    for (const double value : {e.soc, e.soc_sigma, e.v_rc_v, e.voltage_predicted_v}) number(value);
    field(result.recording.voltage_v[k]);
    for (std::size_t i = 0; i < names.size(); ++i) number(result.track.state(k, i));
    fmt::format_to(std::back_inserter(csv), "{}\n", e.flags);
    if (csv.size() < piece_bytes) continue;
    sink(csv);
    csv.clear();
  }
  sink(csv);
}

std::string trace_csv(const ReplayResult& result) {
  std::string csv;
  write_trace(result, [&](std::string_view piece) { csv += piece; });
  return csv;
}

}  // namespace bms::replay
