#include "diagnosis/pack/diagnose_pack.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <Eigen/Cholesky>

#include "diagnosis/pack/cell_fit.hpp"
#include "diagnosis/pack/current_kind.hpp"
#include "diagnosis/pack/isolability.hpp"
#include "diagnosis/pack/loose_wires.hpp"
#include "diagnosis/pack/pack_likelihood.hpp"
#include "diagnosis/pack/pack_texts.hpp"
#include "diagnosis/pack/pack_thresholds.hpp"
#include "diagnosis/pack/sampling_times.hpp"
#include "diagnosis/pack/selection.hpp"
#include "diagnosis/pack/sensors.hpp"
#include "diagnosis/pack/shared_blocks.hpp"
#include "diagnosis/pack/shared_current.hpp"
#include "diagnosis/pack/unexplained.hpp"
#include "measurement/statistics.hpp"

namespace bms::diagnosis::pack {

namespace {

/// The fits of all cells, and what they say of the pack.
struct State {
  const PackOptions& options;
  PackRecording& pack;
  Track track;
  Channels channels;
  std::vector<PackFinding> bad_sensors;
  std::vector<CellFit> fits;
  NoiseModel noise;
  Vector healthy = Vector::Zero();
  std::vector<Accusation> late;  ///< channels that lag by whole rows: certain
  std::vector<Accusation> accused;
  std::optional<PackFinding> staggered;

  void progress(double share, const std::string& what) const {
    if (options.progress) options.progress(share, what);
  }
};

FitInput input_of(const State& s, std::size_t cell) {
  FitInput input{.pack = &s.pack,
                 .track = &s.track,
                 .warmer_k = warmer_than_mean(s.pack, cell, s.bad_sensors),
                 .cell = cell,
                 .known_delay_s = {}};
  if (!s.track.uses_moving) input.known_delay_s = s.channels.cells[cell].lag_s;
  return input;
}

/// Standard deviations of the parameters of a cell if these accusations hold.
Vector prior_of(const State& s, std::size_t cell, bool anything) {
  const Vector fault = fault_spread(s.track.r0_ohm);
  Vector prior = s.healthy;
  for (Eigen::Index p = 0; anything && p < prior.size(); ++p) prior[p] = std::hypot(s.healthy[p], fault[p]);
  for (const Cause cause : {Cause::resistance, Cause::capacity, Cause::late}) {
    if (anything) widen_for(cause, s.healthy, s.track.r0_ohm, s.track.unseen_share, prior);
  }
  for (const Accusation& a : s.accused) {
    if (a.touches(cell)) widen_for(a.cause, s.healthy, s.track.r0_ohm, s.track.unseen_share, prior);
  }
  return prior;
}

/// Own white noise of a channel, at least that of the typical one.
NoiseModel noise_for(const State& s, std::size_t cell) {
  NoiseModel noise = s.noise;
  noise.white_v = std::max(noise.white_v, white_noise(s.fits[cell].difference_v, s.pack.current_a,
                                                      limits.noise.quiet_c * s.track.capacity_ah, noise.white_v));
  return noise;
}

NoiseModel starting_noise() {
  return {.white_v = limits.noise.white_v, .fast_v = limits.noise.fast_v, .slow_v = limits.noise.slow_v};
}

PackLikelihood likelihood_of(const State& s) {
  return {s.fits, s.healthy, s.track.r0_ohm, s.track.days.back(), s.track.step_s, s.track.unseen_share};
}

void fit_all(State& s, bool anything, double from, double to) {
  for (std::size_t c = 0; c < s.fits.size(); ++c) {
    const double share = static_cast<double>(c) / static_cast<double>(s.fits.size());
    s.progress(from + share * (to - from), "cells");
    s.fits[c] = fit_cell(input_of(s, c), s.fits[c].theta, prior_of(s, c, anything), noise_for(s, c));
  }
}

/// The noise of the cells that differ least from their neighbours: the median of each amplitude.
void learn_noise(State& s) {
  std::vector<std::size_t> order(s.fits.size());
  for (std::size_t c = 0; c < order.size(); ++c) order[c] = c;
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return s.fits[a].square < s.fits[b].square; });
  // neither the best nor the worst ones
  const std::size_t count = std::min(limits.noise.cells, (order.size() + 1) / 2), first = order.size() / 2 - count / 2;
  std::vector<NoiseModel> found;
  for (std::size_t k = first; k < first + count; ++k)
    found.push_back(noise_of(input_of(s, order[k]), s.fits[order[k]]));
  for (double NoiseModel::*part :
       {&NoiseModel::white_v, &NoiseModel::fast_v, &NoiseModel::slow_v, &NoiseModel::slow_s, &NoiseModel::edge}) {
    std::vector<double> values;
    for (const NoiseModel& n : found) values.push_back(n.*part);
    s.noise.*part = measurement::median(values);
  }
}

/// The cells without accusations that are usual, or all usual ones if every one is accused.
std::vector<std::size_t> reference_of(const State& s) {
  std::vector<std::size_t> cells = usual_cells(s.pack);
  std::vector<std::size_t> clean = cells;
  std::erase_if(clean, [&](std::size_t c) {
    return std::any_of(s.accused.begin(), s.accused.end(), [&](const Accusation& a) { return a.touches(c); });
  });
  return clean.size() < 2 ? cells : clean;
}

/// A parameter by which so many cells differ that they are no exceptions; nothing without such a parameter.
std::optional<Eigen::Index> common_difference(const State& s) {
  const double most = std::max(limits.exceptions, limits.exceptions_share * static_cast<double>(s.pack.cells()));
  for (std::size_t p = 0; p < parameter_count; ++p) {
    const auto count = std::count_if(s.accused.begin(), s.accused.end(), [&](const Accusation& a) {
      return parameter_of(a.cause) == p && std::find(s.late.begin(), s.late.end(), a) == s.late.end();
    });
    if (static_cast<double>(count) > most) return static_cast<Eigen::Index>(p);
  }
  return std::nullopt;
}

void accuse(State& s) {
  s.healthy = healthy_spread(s.fits, s.track.r0_ohm);
  for (int round = 0; round < limits.fit.widenings; ++round) {
    s.accused = select(likelihood_of(s), s.late);
    const std::optional<Eigen::Index> common = common_difference(s);
    if (!common) return;
    s.healthy[*common] *= limits.wider;
  }
}

/// Puts in place of an accusation the one of its rivals that the last fit supports better.
void exchange_for_rivals(State& s) {
  const PackLikelihood likelihood = likelihood_of(s);
  const std::size_t now = likelihood.last_checkpoint();
  for (std::size_t k = 0; k < s.accused.size(); ++k) {
    if (std::find(s.late.begin(), s.late.end(), s.accused[k]) != s.late.end()) continue;
    std::vector<Accusation> others = s.accused;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(k));
    Accusation best = s.accused[k];
    for (const Accusation& rival : likelihood.rivals_of(s.accused[k])) {
      if (std::find(others.begin(), others.end(), rival) != others.end()) continue;
      std::vector<Accusation> instead = others;
      instead.push_back(rival);
      const bool possible = likelihood.is_possible(rival, likelihood.size(instead, rival, now));
      if (possible && likelihood.gain(others, rival, now) > likelihood.gain(others, best, now)) best = rival;
    }
    s.accused[k] = best;
  }
}

/// Accusations that the last fit no longer supports.
void drop_unsupported(State& s) {
  const PackLikelihood likelihood = likelihood_of(s);
  const std::vector<Accusation> all = s.accused;
  std::erase_if(s.accused, [&](const Accusation& a) {
    if (std::find(s.late.begin(), s.late.end(), a) != s.late.end()) return false;
    std::vector<Accusation> others = all;
    std::erase(others, a);
    return likelihood.gain(others, a, likelihood.last_checkpoint()) < likelihood.least_gain();
  });
}

/// Channels that are read at different times; those that are accused or held do not count.
std::optional<PackFinding> staggered(const State& s, const PackLikelihood& likelihood) {
  std::vector<std::size_t> cells;
  for (std::size_t c = 0; c < s.fits.size(); ++c) {
    const bool accused = std::any_of(s.accused.begin(), s.accused.end(), [&](const auto& a) { return a.touches(c); });
    if (!accused && !s.channels.cells[c].held_s) cells.push_back(c);
  }
  return staggered_channels(s.track, s.pack, cells, likelihood);
}

/// Leaves out the rows in which the current changes, and keeps what they show of the channels' times. Where channels
/// are read at different moments of a row with several steps, the current at a reading is unknown: not noise, but an
/// error that goes with the current and that resistances would follow.
void leave_moving_rows_out(State& s) {
  s.healthy = healthy_spread(s.fits, s.track.r0_ohm);
  s.staggered = staggered(s, likelihood_of(s));
  s.track.uses_moving = false;
  s.healthy = least_spread(s.track.r0_ohm);
  s.noise = starting_noise();
  fit_all(s, true, limits.done.first, limits.done.noise);
  learn_noise(s);
  fit_all(s, true, limits.done.noise, limits.done.second);
}

void fit_and_accuse(State& s) {
  s.healthy = least_spread(s.track.r0_ohm);
  s.noise = starting_noise();
  set_neighbours(s.track, s.pack, reference_of(s), s.channels.are_mostly_held());
  s.fits.resize(s.pack.cells());
  for (std::size_t c = 0; c < s.fits.size(); ++c) {
    s.fits[c].theta[delay] = s.channels.cells[c].lag_s;
    for (std::size_t k = 0; k < s.pack.rows(); ++k)
      s.fits[c].difference_v.push_back(s.pack.cell_v[c][k] - s.track.neighbours_v[k]);
  }
  constexpr const PackThresholds::Shares& done = limits.done;
  fit_all(s, true, done.channels, done.first);
  // the OCV bends: a fit from the state of the neighbours may end where another one is better
  for (std::size_t c = 0; c < s.fits.size(); ++c) {
    const Vector start = starting_point(input_of(s, c), s.channels.cells[c].lag_s);
    CellFit other = fit_cell(input_of(s, c), start, prior_of(s, c, true), noise_for(s, c));
    if (other.cost < s.fits[c].cost) s.fits[c] = std::move(other);
  }
  learn_noise(s);
  fit_all(s, true, done.noise, done.second);
  // Of held channels only the rows with a new reading count: they are few, and their moments are known. Rows far apart
  // do not show whether the current was constant between them. The learned error at steps says whether the channels are
  // read at other moments: where they are not, a current that changes in each row is as good as any.
  const bool unknown_moment = s.noise.edge > limits.noise.unknown_edge;
  if (unknown_moment && !s.channels.are_mostly_held() && s.track.step_s <= limits.noise.longest_constant_s)
    leave_moving_rows_out(s);
  accuse(s);
  // again around the accusations, with neighbours that are not accused
  set_neighbours(s.track, s.pack, reference_of(s), s.channels.are_mostly_held());
  fit_all(s, false, done.second, done.third);
  accuse(s);
  fit_all(s, false, done.third, 1);
  exchange_for_rivals(s);
  drop_unsupported(s);
}

/// First time from which on this accusation was named and was the best one.
std::optional<double> named_after_s(const State& s, const PackLikelihood& likelihood,
                                    const std::vector<Accusation>& others, const Accusation& a) {
  std::optional<double> since;
  for (std::size_t c = 0; c <= likelihood.last_checkpoint(); ++c) {
    const double gain = likelihood.gain(others, a, c);
    bool best = gain >= likelihood.least_gain();
    for (const Accusation& rival : likelihood.rivals_of(a)) best = best && likelihood.gain(others, rival, c) <= gain;
    if (!best) since.reset();
    if (best && !since) since = s.fits.front().until[c].until_s - s.pack.time_s.front();
  }
  return since;
}

/// The one of two alike causes, resistance and joint, that is not named. They differ only in their course over charge
/// and time, and the model knows this course badly.
std::optional<Cause> alike_of(Cause cause) {
  if (cause == Cause::resistance) return Cause::joint;
  if (cause == Cause::joint) return Cause::resistance;
  return std::nullopt;
}

/// Size of an accusation. One that is alike is taken for exactly that of the neighbours: what it is within its healthy
/// spread is part of the sigma, and what the recording says that it is beyond shows how badly the model knows the
/// course.
Estimated size_of(const State& s, const PackLikelihood& likelihood, const Accusation& a) {
  const std::optional<Cause> alike = alike_of(a.cause);
  if (!alike) return likelihood.size(s.accused, a, likelihood.last_checkpoint());
  const auto p = static_cast<Eigen::Index>(parameter_of(*alike));
  const double to_named = a.cause == Cause::joint ? s.track.r0_ohm : 1 / s.track.r0_ohm;
  const double value = likelihood.size(s.accused, {*alike, a.cell}, likelihood.last_checkpoint()).value;
  const double beyond = std::max(0.0, std::abs(value) - limits.healthy_sigmas * s.healthy[p]);
  Vector healthy = s.healthy;
  healthy[p] *= limits.negligible;
  const Estimated size =
      PackLikelihood(s.fits, healthy, s.track.r0_ohm, s.track.days.back(), s.track.step_s, s.track.unseen_share)
          .size(s.accused, a, likelihood.last_checkpoint());
  return {size.value, std::hypot(size.sigma, to_named * s.healthy[p], to_named * beyond)};
}

PackFinding finding_of(const State& s, const PackLikelihood& likelihood, const Accusation& a) {
  std::vector<Accusation> others = s.accused;
  std::erase(others, a);
  const std::size_t now = likelihood.last_checkpoint();
  const Estimated size = size_of(s, likelihood, a);
  PackFinding f;
  f.cause = a.cause;
  f.cell = a.cell;
  f.value = size.value;
  f.sigma = size.sigma;
  f.gain = likelihood.gain(others, a, now);
  double sum = 1;
  for (const Accusation& rival : likelihood.rivals_of(a)) {
    if (std::find(others.begin(), others.end(), rival) != others.end()) continue;
    std::vector<Accusation> instead = others;
    instead.push_back(rival);
    const bool alike = rival.cell == a.cell && are_alike(a.cause, rival.cause);
    const double lead = f.gain - likelihood.gain(others, rival, now);
    double odds = std::exp(-lead);
    if (alike) odds = std::max(odds, std::exp(std::min(0.0, limits.alike_margin - lead)));
    // the data want both of two that are alike: which one it is cannot be said
    if (alike && likelihood.gain(s.accused, rival, now) >= likelihood.least_gain()) odds = std::max(odds, 1.0);
    if (!likelihood.is_possible(rival, likelihood.size(instead, rival, now))) continue;
    sum += odds;
    f.rivals.push_back({rival.cause, rival.cell, odds});
  }
  // nothing at all is one of the alternatives
  const double nothing = std::exp(likelihood.least_gain() - limits.least_odds - f.gain);
  f.probability = 1 / (sum + nothing);
  for (Rival& r : f.rivals) r.probability *= f.probability;
  std::erase_if(f.rivals, [](const Rival& r) { return r.probability < limits.listed_from; });
  if (std::find(s.late.begin(), s.late.end(), a) != s.late.end()) {
    f.rivals.clear();
    f.probability = 1;
    if (!s.track.uses_moving) {  // whole rows
      f.value = s.channels.cells[a.cell].lag_s - s.channels.usual_lag_s();
      f.sigma = s.track.step_s / 2;
    }
  }
  std::stable_sort(f.rivals.begin(), f.rivals.end(),
                   [](const Rival& x, const Rival& y) { return x.probability > y.probability; });
  f.after_s = named_after_s(s, likelihood, others, a);
  if (a.cause == Cause::capacity) {  // from 1 / capacity to capacity
    f.sigma /= (1 + f.value) * (1 + f.value);
    f.value = f.value / (1 + f.value);
  }
  return f;
}

/// Takes the errors of the current sensor out of current and state of charge, before cells are compared.
std::optional<PackFinding> correct_current(State& s, const model::CellParameters<>& cell, PackDiagnosis& d) {
  std::string& text = d.current_sensor;
  set_neighbours(s.track, s.pack, usual_cells(s.pack), s.channels.are_mostly_held());
  SharedState shared = shared_state_of(s.track, s.pack);
  text = shared.not_tested;
  if (!text.empty()) return std::nullopt;
  text = fmt::format("Offset of the current sensor: {:.0f} ± {:.0f} mA.", 1e3 * shared.offset_a,
                     1e3 * shared.offset_sigma_a);
  s.pack.soc = std::move(shared.soc);
  for (double& a : s.pack.current_a) a = (1 - shared.gain) * a - shared.offset_a;
  s.track = track_of(cell, s.pack, shared.resistance_factor, shared.polarisation);
  s.track.soc_sigma = std::move(shared.soc_sigma);
  d.another_cell = shared.ocv_apart_v > limits.shared.another_cell * s.track.ocv_tolerance_v;
  return std::move(shared.finding);
}

/// The cell without accusations whose fit is in the middle.
std::size_t typical_cell(const State& s) {
  const std::vector<std::size_t> reference = reference_of(s);
  return reference[reference.size() / 2];
}

}  // namespace

PackDiagnosis diagnose_pack(const model::CellParameters<>& cell, PackRecording& pack, const PackOptions& options) {
  find_current_kind(pack, cell.capacity_ah);
  State s{.options = options,
          .pack = pack,
          .track = track_of(cell, pack),
          .channels = {},
          .bad_sensors = {},
          .fits = {},
          .noise = {},
          .late = {},
          .accused = {},
          .staggered = {}};
  PackDiagnosis d;
  d.cells = pack.cells();
  d.duration_s = pack.time_s.back() - pack.time_s.front();
  const std::vector<PackFinding> of_voltmeter = check_pack_voltage(pack, s.track);
  s.progress(0, "channels");
  const std::vector<LooseWire> loose = take_loose_wires(pack, limits.channels.step_c * s.track.capacity_ah);
  s.channels = check_channels(s.track, pack);
  for (const std::size_t c : s.channels.late(s.track.step_s)) s.late.push_back({Cause::late, c});
  s.accused = s.late;
  s.bad_sensors = check_thermistors(pack);
  const std::optional<PackFinding> of_current = correct_current(s, cell, d);
  fit_and_accuse(s);
  const PackLikelihood likelihood = likelihood_of(s);
  add_findings(s.channels, d.findings);
  add_loose_wires(loose, pack.rows(), d.findings);
  if (s.track.uses_moving) s.staggered = staggered(s, likelihood);
  if (s.staggered) d.findings.push_back(*s.staggered);
  if (of_current) d.findings.push_back(*of_current);
  for (const Accusation& a : s.accused) d.findings.push_back(finding_of(s, likelihood, a));
  d.findings.insert(d.findings.end(), s.bad_sensors.begin(), s.bad_sensors.end());
  d.findings.insert(d.findings.end(), of_voltmeter.begin(), of_voltmeter.end());
  std::vector<std::size_t> explained;
  for (const Accusation& a : s.accused) explained.push_back(a.cell);
  d.unexplained = unexplained_cells(pack, s.fits, explained, d.noise_v);
  d.is_finite = std::all_of(s.fits.begin(), s.fits.end(),
                            [](const CellFit& fit) { return std::isfinite(fit.cost) && fit.theta.allFinite(); });
  const Matrix& information = s.fits[typical_cell(s)].all().of_parameters;
  d.isolability = isolability_of(information, s.healthy, s.track.r0_ohm, s.track.unseen_share);
  d.detection_limits = detection_limits_of(information, s.healthy, s.track.r0_ohm, likelihood);
  d.not_visible = without_limit(d.detection_limits);
  d.reference = reference_of(s);
  d.channels = s.channels;
  return d;
}

}  // namespace bms::diagnosis::pack
