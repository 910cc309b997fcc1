#include "host_sim/replay.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <iterator>
#include <limits>

#include <fmt/format.h>

#include "estimator/soc_estimator.hpp"
#include "identification/figures.hpp"
#include "host_sim/simulation.hpp"

namespace bms {

namespace {

constexpr double thirty_minutes_s = 1'800;
/// As an ExtendedEstimate tells them.
constexpr std::array error_names = {"voltage_error_v", "current_offset_a", "current_offset_sigma_a"};
constexpr std::size_t current_offset_at = 1, current_offset_sigma_at = 2;

constexpr double timing_s = 0.03;  // long enough that a clock and a cold cache do not matter

template <class S>
EstimateRow row_of(const Estimate<S>& e) {
  return {model::as_double(e.soc), model::as_double(e.soc_sigma), model::as_double(e.v_rc_v), model::as_double(e.voltage_predicted_v), e.flags};
}

template <class Estimator, class Cell>
void step_through(const Cell& cell, const std::vector<Sample>& samples, const std::optional<StartingPoint>& start, std::vector<typename Estimator::Result>& estimates) {
  Estimator estimator = start ? Estimator(*start) : Estimator();
  for (std::size_t k = 0; k < samples.size(); ++k) estimates[k] = estimator.step(cell, samples[k]);
}

template <class Estimator, class Cell>
[[gnu::flatten]] void step_through_flat(const Cell& cell, const std::vector<Sample>& samples, const std::optional<StartingPoint>& start, std::vector<typename Estimator::Result>& estimates) {
  step_through<Estimator>(cell, samples, start, estimates);
}

template <class Estimator, class Cell>
Track run_estimator(const Cell& cell, const std::vector<Sample>& samples, const std::optional<StartingPoint>& start, std::size_t further) {
  using S = typename Estimator::Scalar;
  std::vector<typename Estimator::Result> estimates(samples.size());
  double best_s = std::numeric_limits<double>::infinity(), total_s = 0;
  do {
    const auto begin = std::chrono::steady_clock::now();
    if constexpr (Estimator::further_values == 0) step_through_flat<Estimator>(cell, samples, start, estimates);
    else step_through<Estimator>(cell, samples, start, estimates);
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    best_s = std::min(best_s, seconds);
    total_s += seconds;
  } while (total_s < timing_s);

  Track track;
  track.steps_per_second = static_cast<double>(samples.size()) / best_s;
  track.rows.reserve(samples.size());
  for (const auto& e : estimates) {
    track.rows.push_back(row_of<S>(e));
    if constexpr (!std::same_as<S, double>) track.words.push_back(words(static_cast<const Estimate<S>&>(e)));
    if constexpr (Estimator::further_values > 0) {
      for (std::size_t k = 0; k < further; ++k) {
        if constexpr (std::same_as<S, double>) track.states.push_back(e.further[k]);
        else track.state_words.push_back(word(e.further[k]));
      }
    }
  }
  return track;
}

/// A cell with mechanisms: as many states in the filter as they have voltages.
template <class S, bool Errors, std::size_t Voltages = 0>
Track run_extended(const model::ExtendedCell<S, model::max_intervals, model::ChosenLaws<S>>& cell, const std::vector<Sample>& samples, const std::optional<StartingPoint>& start) {
  using Laws = model::ChosenLaws<S>;
  if constexpr (Voltages < Laws::most_voltage_states) {
    if (cell.laws.voltage_states() > Voltages) return run_extended<S, Errors, Voltages + 1>(cell, samples, start);
  }
  return run_estimator<SocEstimator<S, model::ExtendedRc<Voltages, Laws::most_states, Errors>::template Of>>(cell, samples, start, (Errors ? error_names.size() : 0) + cell.laws.states());
}

template <class S>
Track run(const CellFile& file, const std::vector<Sample>& samples, const std::optional<StartingPoint>& start) {
  const auto cell = model::prepare<S, model::max_intervals>(file.parameters);
  const auto mechanisms = on_board(file.mechanisms);
  const bool errors = file.parameters.noise.errors_are_states;
  if (mechanisms.empty() && !errors) return run_estimator<SocEstimator<S>>(cell, samples, start, 0);
  const model::ExtendedCell<S, model::max_intervals, model::ChosenLaws<S>> extended{cell, model::chosen<S>(mechanisms, file.parameters.capacity_ah)};
  return errors ? run_extended<S, true>(extended, samples, start) : run_extended<S, false>(extended, samples, start);
}

/// The value of an estimate's word as a board writes it.
double number_of(std::uint32_t word, ScalarKind scalar) {
  if (scalar == ScalarKind::single) return std::bit_cast<float>(word);
  return static_cast<double>(model::Soc<model::FixedPoint>::from_raw(static_cast<std::int32_t>(word)));  // all four are Q3.28
}

std::string formatted(double value, ScalarKind scalar) {
  return scalar == ScalarKind::single ? fmt::format("{}", static_cast<float>(value)) : fmt::format("{}", value);
}

}  // namespace

const char* name_of(ScalarKind scalar) {
  switch (scalar) {
    case ScalarKind::single: return "float";
    case ScalarKind::fixed: return "fixed";
    case ScalarKind::twice: return "double";
  }
  return "";
}

std::optional<StartingPoint> starting_point(const std::optional<Belief>& belief, double shift) {
  if (!belief) return std::nullopt;
  return StartingPoint{static_cast<std::int32_t>(std::lround(std::clamp(belief->soc + shift, 0.0, 1.0) * 1e9)), static_cast<std::int32_t>(std::lround(belief->sigma * 1e9))};
}

Track run_on_host(const CellFile& cell, const std::vector<Sample>& samples, const std::optional<StartingPoint>& start, ScalarKind scalar) {
  Track track = [&] {
    switch (scalar) {
      case ScalarKind::fixed: refuse_without_fpu(cell); return run<model::FixedPoint>(cell, samples, start);
      case ScalarKind::twice: return run<double>(cell, samples, start);
      default: return run<float>(cell, samples, start);
    }
  }();
  name_states(track, cell);
  number_states(track, scalar);
  return track;
}

std::size_t state_count(const CellFile& cell) {
  std::size_t count = cell.parameters.noise.errors_are_states ? error_names.size() : 0;
  for (const model::MechanismSetting& m : on_board(cell.mechanisms)) count += model::catalogue[m.index].states;
  return count;
}

void name_states(Track& track, const CellFile& cell) {
  if (cell.parameters.noise.errors_are_states) {
    track.state_names.assign(error_names.begin(), error_names.end());
    track.state_scales = {1, cell.parameters.capacity_ah, cell.parameters.capacity_ah};
  }
  for (const model::MechanismSetting& m : on_board(cell.mechanisms)) {
    const model::MechanismInfo& info = model::catalogue[m.index];
    for (std::size_t k = 0; k < info.states; ++k) {
      track.state_names.push_back(fmt::format("{}{}_{}", info.id, info.states > 1 ? fmt::format("_{}", k + 1) : "", info.state_unit.name));
      track.state_scales.push_back(info.state_unit.scale);
    }
  }
}

void number_states(Track& track, ScalarKind scalar) {
  if (scalar != ScalarKind::twice) {
    track.states.clear();
    for (const std::uint32_t w : track.state_words) track.states.push_back(number_of(w, scalar));
  }
  for (std::size_t k = 0; k < track.states.size(); ++k) {
    track.states[k] *= track.state_scales[k % track.state_scales.size()];
  }
}

std::vector<EstimateRow> rows_of(const std::vector<EstimateWords>& words, ScalarKind scalar) {
  static_assert(std::same_as<model::Soc<model::FixedPoint>, model::Voltage<model::FixedPoint>>, "one conversion serves all four numbers");
  std::vector<EstimateRow> rows;
  rows.reserve(words.size());
  for (const EstimateWords& w : words) {
    rows.push_back({number_of(w[0], scalar), number_of(w[1], scalar), number_of(w[2], scalar), number_of(w[3], scalar), w[4]});
  }
  return rows;
}

std::optional<Difference> first_difference(const Track& host, const Track& board, ScalarKind scalar) {
  const std::size_t both = std::min(host.words.size(), board.words.size());
  for (std::size_t k = 0; k < both; ++k) {
    for (std::size_t w = 0; w < estimate_words; ++w) {
      const std::uint32_t a = host.words[k][w], b = board.words[k][w];
      if (a == b) continue;
      const bool flags = w + 1 == estimate_words;
      return Difference{k, estimate_word_names[w], flags ? a : number_of(a, scalar), flags ? b : number_of(b, scalar)};
    }
    for (std::size_t s = 0; s < host.state_names.size() && host.state_names == board.state_names; ++s) {
      const std::uint32_t a = host.state_words[k * host.state_names.size() + s], b = board.state_words[k * host.state_names.size() + s];
      if (a != b) return Difference{k, host.state_names[s], number_of(a, scalar), number_of(b, scalar)};
    }
  }
  if (host.words.size() != board.words.size()) return Difference{both, "number of estimates", static_cast<double>(host.words.size()), static_cast<double>(board.words.size())};
  return std::nullopt;
}

void evaluate(ReplayResult& result) {
  const Recording& r = result.recording;
  const std::vector<EstimateRow>& rows = result.track.rows;
  const bool has_reference = !r.soc_ref.empty();

  ErrorFigure soc, soc_later, prediction, open_loop;
  FitFigure fit;
  std::size_t inside = 0;
  const auto cell = model::prepare<double, model::max_intervals>(result.cell.parameters);
  if (!result.belief) result.initial_soc = rows.front().soc;
  const bool start_known = has_reference && r.soc_ref.front() >= 0 && r.soc_ref.front() <= 1;
  // a shift of the start is about what was believed
  const double shift = value_of(result.cell.mechanisms, model::InitialSoc::id, 0), started = result.belief ? result.initial_soc : result.initial_soc - shift;
  const auto open = simulate(cell, result.cell.parameters.capacity_ah, result.cell.mechanisms, r.time_s, r.current_a, r.temperature_c,
                             start_known ? r.soc_ref.front() - shift : started);

  for (std::size_t k = 0; k < rows.size(); ++k) {
    const EstimateRow& e = rows[k];
    if (has_reference && !std::isnan(r.soc_ref[k])) {
      const double error = e.soc - r.soc_ref[k];
      soc.add(error);
      if (r.time_s[k] - r.time_s.front() >= thirty_minutes_s) soc_later.add(error);
      if (std::abs(error) <= 2 * e.soc_sigma) ++inside;
    }
    // a reading that the filter did not believe says nothing about its prediction
    constexpr std::uint32_t not_believed = voltage_missing | voltage_implausible | voltage_stuck | time_not_later | not_started;
    if (k > 0 && (e.flags & not_believed) == 0) prediction.add(r.voltage_v[k] - e.voltage_predicted_v);
    if ((e.flags & (voltage_missing | voltage_implausible)) == 0) {
      open_loop.add(r.voltage_v[k] - open[k].voltage_v);
      fit.add(r.voltage_v[k], open[k].voltage_v);
    }
    result.open_loop_v.push_back(open[k].voltage_v);
  }
  result.soc.final = rows.back().soc;
  result.soc.final_sigma = rows.back().soc_sigma;
  if (result.cell.parameters.noise.errors_are_states) {
    const std::size_t last = (rows.size() - 1) * result.track.state_names.size();
    result.soc.current_offset_a = result.track.states[last + current_offset_at];
    result.soc.current_offset_sigma_a = result.track.states[last + current_offset_sigma_at];
  }
  if (soc.count() > 0) {
    result.soc.rmse = soc.rms();
    result.soc.max_error = soc.max();
    result.soc.within_2_sigma = static_cast<double>(inside) / static_cast<double>(soc.count());
  }
  if (soc_later.count() > 0) {
    result.soc.rmse_after_30min = soc_later.rms();
    result.soc.max_error_after_30min = soc_later.max();
  }
  result.voltage = {};
  if (prediction.count() > 0) {
    result.voltage.prediction_rmse_v = prediction.rms();
    result.voltage.prediction_max_v = prediction.max();
  }
  if (open_loop.count() > 0) {
    result.voltage.open_loop_rmse_v = open_loop.rms();
    result.voltage.open_loop_fit_percent = fit.percent();
  }
}

std::string trace_csv(const ReplayResult& result) {
  const auto& names = result.track.state_names;
  std::string csv = "time_s,soc,soc_sigma,v_rc_v,voltage_predicted_v,voltage_measured_v,";
  for (const std::string& name : names) csv += name + ",";
  csv += "flags\n";
  csv.reserve(result.track.rows.size() * 80);
  const ScalarKind s = result.scalar;
  for (std::size_t k = 0; k < result.track.rows.size(); ++k) {
    const EstimateRow& e = result.track.rows[k];
    fmt::format_to(std::back_inserter(csv), "{},{},{},{},{},{},", result.recording.time_s[k], formatted(e.soc, s), formatted(e.soc_sigma, s),
                   formatted(e.v_rc_v, s), formatted(e.voltage_predicted_v, s), result.recording.voltage_v[k]);
    for (std::size_t i = 0; i < names.size(); ++i) fmt::format_to(std::back_inserter(csv), "{},", formatted(result.track.states[k * names.size() + i], s));
    fmt::format_to(std::back_inserter(csv), "{}\n", e.flags);
  }
  return csv;
}

}  // namespace bms
