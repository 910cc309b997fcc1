#include "identification/joint_structure.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include <fmt/format.h>
#include <Eigen/Cholesky>

#include "identification/residuals.hpp"
#include "identification/vanished_pair.hpp"
#include "identification/variance_parts.hpp"
#include "measurement/statistics.hpp"

namespace bms::identification {

namespace {

/// What a candidate is fitted to, and what it then predicts.
struct Fold {
  std::string name;
  std::vector<JointRecording> fit, left_out;
  /// For each of left_out, its place in fit if it is a part of the same recording, whose state is then known; or empty.
  std::vector<std::size_t> same_as;

  RecordingState state(std::size_t left_out_index, const JointFit& of_fit) const {
    return same_as.empty() ? RecordingState{} : of_fit.states[same_as[left_out_index]];
  }
};

/// The recording with the voltages of one half of those it has.
JointRecording half_of(const JointRecording& recording, bool second) {
  JointRecording half = recording;
  std::size_t count = 0, seen = 0;
  for (const double v : recording.data.voltage_v) count += std::isfinite(v) ? 1 : 0;
  for (double& v : half.data.voltage_v.edit()) {
    if (!std::isfinite(v)) continue;
    if ((seen >= count / 2) != second) v = std::numeric_limits<double>::quiet_NaN();
    ++seen;
  }
  return half;
}

/// The recording with the voltages of every second of a few blocks of its rows.
JointRecording blocks_of(const JointRecording& recording, bool odd) {
  constexpr std::size_t blocks = 8;
  JointRecording part = recording;
  const std::size_t rows = recording.data.size();
  for (std::size_t k = 0; k < rows; ++k) {
    if ((k * blocks / rows % 2 == 1) != odd) part.data.voltage_v.edit()[k] = std::numeric_limits<double>::quiet_NaN();
  }
  return part;
}

Fold without(std::span<const JointRecording> recordings, const std::vector<std::size_t>& left_out, std::string name) {
  Fold fold{std::move(name), {}, {}, {}};
  for (std::size_t k = 0; k < recordings.size(); ++k) {
    const bool out = std::find(left_out.begin(), left_out.end(), k) != left_out.end();
    (out ? fold.left_out : fold.fit).push_back(recordings[k]);
  }
  return fold;
}

/// Leaves blocks of these recordings out.
Fold without_blocks(std::span<const JointRecording> recordings, const std::vector<std::size_t>& of, std::string name) {
  Fold fold{std::move(name), {}, {}, {}};
  for (std::size_t k = 0; k < recordings.size(); ++k) {
    const bool partly = std::find(of.begin(), of.end(), k) != of.end();
    fold.fit.push_back(partly ? blocks_of(recordings[k], false) : recordings[k]);
    if (!partly) continue;
    fold.left_out.push_back(blocks_of(recordings[k], true));
    fold.same_as.push_back(k);
  }
  return fold;
}

std::string text_of_temperature(std::span<const JointRecording> recordings, const std::vector<std::size_t>& group) {
  return fmt::format("{:.0f} degrees C", *mean_temperature_c(recordings[group[0]]));
}

/// By what a candidate is chosen: how well it predicts inside of the range of the recordings. The coldest and the
/// warmest temperature are its edges; of them, blocks are left out.
std::vector<Fold> folds_of(std::span<const JointRecording> recordings, std::string& kind) {
  const auto groups = by_temperature(recordings);
  std::vector<Fold> folds;
  const bool each_twice = std::all_of(groups.begin(), groups.end(), [](const auto& group) { return group.size() > 1; });
  if (groups.size() > 2) {
    kind = "temperature";
    for (std::size_t g = 0; g < groups.size(); ++g) {
      const std::string name = text_of_temperature(recordings, groups[g]);
      const bool edge = g == 0 || g + 1 == groups.size();
      folds.push_back(edge ? without_blocks(recordings, groups[g], "parts of " + name)
                           : without(recordings, groups[g], name));
    }
  } else if (each_twice) {
    kind = "recording";
    for (std::size_t k = 0; k < recordings.size(); ++k) folds.push_back(without(recordings, {k}, recordings[k].name));
  } else {
    kind = "second half";
    Fold& fold = folds.emplace_back();
    fold.name = kind;
    for (std::size_t k = 0; k < recordings.size(); ++k) {
      fold.fit.push_back(half_of(recordings[k], false));
      fold.left_out.push_back(half_of(recordings[k], true));
      fold.same_as.push_back(k);
    }
  }
  return folds;
}

/// Values of `of` from a fit of another candidate, where both have the unknown.
Eigen::VectorXd carried_over(const JointModel& of, const JointModel& from, const JointFit& fit) {
  Eigen::VectorXd start(static_cast<Eigen::Index>(of.unknowns.size()));
  for (std::size_t k = 0; k < of.unknowns.size(); ++k) {
    start[static_cast<Eigen::Index>(k)] = of.unknowns[k].start;
    for (std::size_t j = 0; j < from.unknowns.size(); ++j) {
      if (from.unknowns[j].name() == of.unknowns[k].name())
        start[static_cast<Eigen::Index>(k)] = fit.value[static_cast<Eigen::Index>(j)];
    }
  }
  return start;
}

/// RMSE of a few stretches of the rows with a voltage: a single fold has several parts to be judged by.
void add_stretches(const JointRecording& r, std::span<const double> simulated_v, std::vector<double>& rmse) {
  constexpr std::size_t stretches = 4;
  std::vector<double> errors;
  for (std::size_t k = 0; k < r.data.size(); ++k) {
    if (std::isfinite(r.data.voltage_v[k])) errors.push_back(simulated_v[k] - r.data.voltage_v[k]);
  }
  const std::size_t length = (errors.size() + stretches - 1) / stretches;
  for (std::size_t from = 0; from < errors.size(); from += length)
    rmse.push_back(measurement::rms(std::span(errors).subspan(from, std::min(length, errors.size() - from))));
}

/// A candidate with its fits.
struct Tried {
  CandidateResult result;
  bool pair_vanished = false;  ///< its second pair ended at the least resistance: not a pair, never chosen
  JointFit fit;
  std::vector<JointFit> fold_fits;
};

/// From the fit of all recordings it is not far.
JointOptions quick_fit(const JointOptions& options) {
  JointOptions quick = options;
  quick.rows = std::min<std::size_t>(options.rows, 1'500);
  quick.uncertainty = false;
  quick.stopping.cost = std::max(options.stopping.cost, 1e-4);
  quick.stopping.iterations = std::min(options.stopping.iterations, 12);
  return quick;
}

Tried try_candidate(const JointCandidate& candidate, std::span<const JointRecording> recordings,
                    const std::vector<Fold>& folds, const JointOptions& options, const Eigen::VectorXd& start) {
  Tried tried;
  tried.result.name = candidate.name;
  tried.result.unknowns = candidate.model.unknowns.size();
  tried.fit = fit_joint(candidate.model, recordings, options, start);
  tried.result.fitted_rmse_v = measurement::rms(tried.fit.rmse_v);
  const JointOptions quick = quick_fit(options);
  for (const Fold& fold : folds) {
    const JointFit& fit = tried.fold_fits.emplace_back(fit_joint(candidate.model, fold.fit, quick, tried.fit.value));
    const JointModel found = with_values(candidate.model, fit.value);
    std::vector<double> own;
    for (std::size_t k = 0; k < fold.left_out.size(); ++k) {
      const auto simulated = simulate(found, fold.left_out[k], fold.state(k, fit));
      if (folds.size() == 1)
        add_stretches(fold.left_out[k], simulated.voltage_v, tried.result.left_out_rmse_v);
      else
        own.push_back(rmse_v(fold.left_out[k].data, simulated.voltage_v));
    }
    if (folds.size() > 1) tried.result.left_out_rmse_v.push_back(measurement::rms(own));
  }
  double logs = 0;
  for (const double v : tried.result.left_out_rmse_v) logs += std::log(v);
  tried.result.left_out_v = std::exp(logs / static_cast<double>(tried.result.left_out_rmse_v.size()));
  return tried;
}

/// Mean of ln (a / b) over the parts, in units of its standard error.
bool within_one_standard_error(const CandidateResult& a, const CandidateResult& best) {
  const std::size_t n = a.left_out_rmse_v.size();
  double mean = 0, squares = 0;
  for (std::size_t k = 0; k < n; ++k) mean += std::log(a.left_out_rmse_v[k] / best.left_out_rmse_v[k]);
  mean /= static_cast<double>(n);
  for (std::size_t k = 0; k < n; ++k)
    squares += std::pow(std::log(a.left_out_rmse_v[k] / best.left_out_rmse_v[k]) - mean, 2);
  const double error = n > 1 ? std::sqrt(squares / static_cast<double>((n - 1) * n)) : 0;
  return mean <= error;
}

std::size_t chosen_of(const std::vector<Tried>& tried) {
  const auto best = std::min_element(tried.begin(), tried.end(), [](const Tried& a, const Tried& b) {
    if (a.pair_vanished != b.pair_vanished) return b.pair_vanished;
    return a.result.left_out_v < b.result.left_out_v;
  });
  std::size_t chosen = static_cast<std::size_t>(best - tried.begin());
  for (std::size_t k = 0; k < tried.size(); ++k) {
    if (!tried[k].pair_vanished && tried[k].result.unknowns < tried[chosen].result.unknowns &&
        within_one_standard_error(tried[k].result, best->result))
      chosen = k;
  }
  return chosen;
}

/// Distance in 1 / (k T) [1/eV] from the nearest temperature of the fit; 0 between them or if unknown.
double beyond_per_ev(const JointRecording& left_out, const std::vector<JointRecording>& fit) {
  constexpr double boltzmann_ev_per_k = 8.617333262e-5;
  const auto inverse = [](const JointRecording& r) -> std::optional<double> {
    const auto c = mean_temperature_c(r);
    if (!c) return std::nullopt;
    return 1 / (boltzmann_ev_per_k * (*c + 273.15));
  };
  const auto at = inverse(left_out);
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const JointRecording& r : fit) {
    const auto there = inverse(r);
    if (!there || !at) return 0;
    low = std::min(low, *there);
    high = std::max(high, *there);
  }
  return std::max({0.0, low - *at, *at - high});
}

/// The edges of the range, each left out whole: how fast errors grow outside.
std::vector<Fold> outside_of(std::span<const JointRecording> recordings) {
  const auto groups = by_temperature(recordings);
  std::vector<Fold> folds;
  if (groups.size() < 3) return folds;
  for (const auto& group : {groups.front(), groups.back()})
    folds.push_back(without(recordings, group, text_of_temperature(recordings, group)));
  return folds;
}

void add_left_out(const JointModel& model, const Fold& fold, const JointFit& fit, std::vector<LeftOutError>& errors) {
  const JointModel found = with_values(model, fit.value);
  for (std::size_t k = 0; k < fold.left_out.size(); ++k) {
    LeftOutError& e = errors.emplace_back(left_out_error(found, fold.left_out[k], fold.state(k, fit)));
    e.beyond_per_ev = beyond_per_ev(fold.left_out[k], fold.fit);
  }
}

ModelErrors errors_of(const std::vector<LeftOutError>& all) {
  const bool any_between =
      std::any_of(all.begin(), all.end(), [](const LeftOutError& e) { return e.beyond_per_ev == 0; });
  std::vector<double> resistance, soc, rest, overpotential, correlation;
  for (const LeftOutError& e : all) {
    if (any_between && e.beyond_per_ev > 0) continue;
    resistance.push_back(e.resistance_error);
    soc.push_back(e.soc_error);
    rest.push_back(e.rest_v);
    overpotential.push_back(e.overpotential_v);
    correlation.push_back(e.correlation_s);
  }
  ModelErrors errors;
  // the residual is larger under a larger load and in the cold: that part is an error of the overpotential as well
  const VarianceParts remaining = variance_parts(rest, overpotential);
  errors.resistance_fraction = std::hypot(measurement::rms(resistance), remaining.per);
  errors.initial_soc = measurement::rms(soc);
  errors.model_v = remaining.constant;
  errors.correlation_s =
      std::accumulate(correlation.begin(), correlation.end(), 0.0) / static_cast<double>(correlation.size());
  std::vector<GrowthAt> outside;
  for (const LeftOutError& e : all) {
    if (!(e.beyond_per_ev > 0)) continue;
    const double of_rest = std::max(0.0, std::pow(e.rest_v, 2) - std::pow(errors.model_v, 2)) /
                           std::max(1e-12, std::pow(e.overpotential_v, 2));
    const double more = std::pow(e.resistance_error, 2) + of_rest - std::pow(errors.resistance_fraction, 2);
    outside.push_back({e.temperature_c.value_or(0), std::sqrt(std::max(0.0, more)) / e.beyond_per_ev});
  }
  errors.resistance_per_ev = growth_outside(by_edge(outside));  // it is of two edges, not of all their recordings
  return errors;
}

IdentifiedExtent extent_of(const JointModel& model, std::span<const JointRecording> recordings) {
  IdentifiedExtent e;
  for (const JointRecording& r : recordings) {
    if (const auto c = mean_temperature_c(r)) {
      e.temperature_min_c = std::min(e.temperature_min_c.value_or(*c), *c);
      e.temperature_max_c = std::max(e.temperature_max_c.value_or(*c), *c);
    }
    const std::vector<double> soc = simulate(model, r, {}).soc;
    for (std::size_t k = 0; k < r.data.size(); ++k) {
      if (!std::isfinite(r.data.voltage_v[k])) continue;
      e.soc_min = std::min(e.soc_min, soc[k]);
      e.soc_max = std::max(e.soc_max, soc[k]);
      if (std::isfinite(r.data.current_a[k]))
        e.current_max_a = std::max(e.current_max_a, std::abs(r.data.current_a[k]));
    }
    e.duration_s = std::max(e.duration_s, r.data.time_s.back() - r.data.time_s.front());
  }
  return e;
}

}  // namespace

std::vector<std::vector<std::size_t>> by_temperature(std::span<const JointRecording> recordings) {
  constexpr double near_k = 5;  // as far apart as recordings of one temperature can be
  std::vector<double> means_c;
  for (const JointRecording& r : recordings) means_c.push_back(measurement::mean(r.temperature_c));
  return measurement::groups_within(means_c, near_k);
}

std::optional<double> mean_temperature_c(const JointRecording& recording) {
  const double c = measurement::mean(recording.temperature_c);
  return std::isnan(c) ? std::nullopt : std::optional(c);
}

StructureChoice choose_structure(const std::vector<JointCandidate>& candidates,
                                 std::span<const JointRecording> recordings, const JointOptions& options) {
  StructureChoice choice;
  const std::vector<Fold> folds = folds_of(recordings, choice.left_out);
  for (const Fold& fold : folds) choice.parts.push_back(fold.name);
  JointOptions without_uncertainty = options;
  without_uncertainty.uncertainty = false;
  std::vector<Tried> tried;
  for (std::size_t k = 0; k < candidates.size(); ++k) {
    // the pairs of a circuit with one pair are no start for one with two
    const Eigen::VectorXd start =
        k > 1 ? carried_over(candidates[k].model, candidates[k - 1].model, tried[k - 1].fit) : Eigen::VectorXd();
    tried.push_back(try_candidate(candidates[k], recordings, folds, without_uncertainty, start));
    const JointModel& model = candidates[k].model;
    if (candidates.size() == 1 || !pair_vanished(model, tried[k].fit)) continue;
    // the rest of this circuit is the first candidate, perhaps at a better optimum than its own search has found
    tried[k].pair_vanished = true;
    tried[k].result.name += ": its second pair has no resistance, so it is left out";
    Tried rest = try_candidate(candidates[0], recordings, folds, without_uncertainty,
                               carried_over(candidates[0].model, model, tried[k].fit));
    if (rest.result.left_out_v < tried[0].result.left_out_v) tried[0] = std::move(rest);
  }
  choice.chosen = chosen_of(tried);
  tried[choice.chosen].result.chosen = true;
  const Tried& winner = tried[choice.chosen];
  const JointModel& model = candidates[choice.chosen].model;
  choice.fit = fit_joint(model, recordings, options, winner.fit.value);
  choice.model = with_values(model, choice.fit.value);
  for (std::size_t f = 0; f < folds.size(); ++f) add_left_out(model, folds[f], winner.fold_fits[f], choice.left_outs);
  for (const Fold& fold : outside_of(recordings))
    add_left_out(model, fold, fit_joint(model, fold.fit, quick_fit(options), choice.fit.value), choice.left_outs);
  choice.errors = errors_of(choice.left_outs);
  choice.extent = extent_of(choice.model, recordings);
  for (Tried& t : tried) choice.candidates.push_back(std::move(t.result));
  return choice;
}

StructureChoice fitted_again(const StructureChoice& choice, std::span<const JointRecording> recordings,
                             const JointOptions& options) {
  StructureChoice again = choice;
  again.fit = fit_joint(choice.model, recordings, options, choice.fit.value);
  again.model = with_values(choice.model, again.fit.value);
  again.extent = extent_of(again.model, recordings);
  return again;
}

LeftOutError left_out_error(const JointModel& model, const JointRecording& recording, const RecordingState& state) {
  constexpr double usual_resistance_error = 0.3, usual_soc_error = 0.05, independent_s = 1'800;
  const JointSimulation s = simulate(model, recording, state);
  const auto tables = model::prepare<double, model::max_intervals>(model.cell);
  LeftOutError found;
  found.name = recording.name;
  found.temperature_c = mean_temperature_c(recording);
  found.rmse_v = rmse_v(recording.data, s.voltage_v);
  std::vector<Eigen::Vector2d> by;
  std::vector<double> error_v;
  std::uint8_t interval = 0;
  for (std::size_t k = 0; k < recording.data.size(); ++k) {
    if (!std::isfinite(recording.data.voltage_v[k])) continue;
    const auto at = model::look_up(tables, s.soc[k], interval);
    by.emplace_back(s.overpotential_v[k], at.ocv_delta_v * at.per_width);
    error_v.push_back(s.voltage_v[k] - recording.data.voltage_v[k]);
  }
  if (error_v.empty()) return found;
  Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
  Eigen::Vector2d toward = Eigen::Vector2d::Zero();
  for (std::size_t k = 0; k < by.size(); ++k) {
    normal += by[k] * by[k].transpose();
    toward += by[k] * error_v[k];
  }
  const auto n = static_cast<double>(error_v.size());
  const double duration_s = recording.data.time_s.back() - recording.data.time_s.front();
  const double per_reading = n / std::max(1.0, duration_s / independent_s) * found.rmse_v * found.rmse_v;
  normal(0, 0) += per_reading / (usual_resistance_error * usual_resistance_error);
  normal(1, 1) += per_reading / (usual_soc_error * usual_soc_error);
  const Eigen::Vector2d x = normal.ldlt().solve(toward);
  found.resistance_error = x[0];
  found.soc_error = x[1];
  Eigen::VectorXd rest(static_cast<Eigen::Index>(error_v.size()));
  for (std::size_t k = 0; k < by.size(); ++k) rest[static_cast<Eigen::Index>(k)] = error_v[k] - by[k].dot(x);
  found.rest_v = std::sqrt(rest.squaredNorm() / n);
  double overpotential_v2 = 0;
  for (const Eigen::Vector2d& at_row : by) overpotential_v2 += at_row[0] * at_row[0];
  found.overpotential_v = std::sqrt(overpotential_v2 / n);
  found.correlation_s = correlation_length(rest) * duration_s / static_cast<double>(recording.data.size() - 1);
  return found;
}

}  // namespace bms::identification
