#include "diagnosis/pack/accusations.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "diagnosis/noise.hpp"
#include "diagnosis/pack/pack_thresholds.hpp"
#include "diagnosis/pack/sampling_times.hpp"
#include "diagnosis/pack/selection.hpp"
#include "diagnosis/pack/sensors.hpp"
#include "measurement/statistics.hpp"

namespace bms::diagnosis::pack {

namespace {

FitInput input_of(const PackState& s, std::size_t cell) {
  FitInput input{.pack = &s.pack,
                 .track = &s.track,
                 .warmer_k = warmer_than_mean(s.pack, cell, s.bad_sensors),
                 .cell = cell,
                 .known_delay_s = {}};
  if (!s.track.uses_moving) input.known_delay_s = s.channels.cells[cell].lag_s;
  return input;
}

/// Standard deviations of the parameters of a cell if these accusations hold.
Vector prior_of(const PackState& s, std::size_t cell, bool anything) {
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
NoiseModel noise_for(const PackState& s, std::size_t cell) {
  NoiseModel noise = s.noise;
  noise.white_v = std::max(noise.white_v, white_noise(s.fits[cell].difference_v, s.pack.current_a,
                                                      limits.noise.quiet_c * s.track.capacity_ah, noise.white_v));
  if (s.own_noise.empty() || !s.own_noise[cell]) return noise;
  for (double NoiseModel::*part : {&NoiseModel::white_v, &NoiseModel::fast_v, &NoiseModel::edge})
    noise.*part = std::max(noise.*part, (*s.own_noise[cell]).*part);
  return noise;
}

NoiseModel starting_noise() {
  return {.white_v = limits.noise.white_v, .fast_v = limits.noise.fast_v, .slow_v = limits.noise.slow_v};
}

void fit_all(PackState& s, bool anything, double from, double to) {
  for (std::size_t c = 0; c < s.fits.size(); ++c) {
    const double share = static_cast<double>(c) / static_cast<double>(s.fits.size());
    s.progress(from + share * (to - from), "cells");
    s.fits[c] = fit_cell(input_of(s, c), s.fits[c].theta, prior_of(s, c, anything), noise_for(s, c));
  }
}

/// The noise of the cells that differ least from their neighbours: the median of each amplitude.
void learn_noise(PackState& s) {
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

/// A channel that is read at other moments than the typical ones has larger errors where the current changes: with the
/// pack's noise its fit would follow them, with a charge or a capacity of its own. Such a cell is fitted again with its
/// channel's noise, also from the start: the fit until now may be far away.
void learn_own_noise(PackState& s) {
  s.own_noise.assign(s.fits.size(), std::nullopt);
  for (std::size_t c = 0; c < s.fits.size(); ++c) {
    CellFit& fit = s.fits[c];
    const auto is_misfit = [&] { return fit.square > limits.noise.misfit * static_cast<double>(fit.used); };
    for (int round = 0; round < limits.noise.rounds && is_misfit(); ++round) {
      CellFit now = fit;
      now.noise.edge = std::max(now.noise.edge, starting_noise().edge);  // a search from far below ends elsewhere
      s.own_noise[c] = noise_of(input_of(s, c), now);
      now.theta = Vector::Zero();
      now.theta[delay] = s.channels.cells[c].lag_s;
      for (const Vector& start : {fit.theta, now.theta}) {
        CellFit again = fit_cell(input_of(s, c), start, prior_of(s, c, true), noise_for(s, c));
        if (start == fit.theta || again.cost < now.cost) now = std::move(again);
      }
      fit = std::move(now);
    }
  }
}

/// A parameter by which so many cells differ that they are no exceptions; nothing without such a parameter.
std::optional<Eigen::Index> common_difference(const PackState& s) {
  const double most = std::max(limits.exceptions, limits.exceptions_share * static_cast<double>(s.pack.cells()));
  for (std::size_t p = 0; p < parameter_count; ++p) {
    const auto count = std::count_if(s.accused.begin(), s.accused.end(), [&](const Accusation& a) {
      return parameter_of(a.cause) == p && std::find(s.late.begin(), s.late.end(), a) == s.late.end();
    });
    if (static_cast<double>(count) > most) return static_cast<Eigen::Index>(p);
  }
  return std::nullopt;
}

void accuse(PackState& s) {
  s.healthy = healthy_spread(s.fits, s.track.r0_ohm);
  for (int round = 0; round < limits.fit.widenings; ++round) {
    s.accused = select(likelihood_of(s), s.late);
    const std::optional<Eigen::Index> common = common_difference(s);
    if (!common) return;
    s.healthy[*common] *= limits.wider;
  }
}

/// Puts in place of an accusation the one of its rivals that the last fit supports better.
void exchange_for_rivals(PackState& s) {
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
void drop_unsupported(PackState& s) {
  const PackLikelihood likelihood = likelihood_of(s);
  const std::vector<Accusation> all = s.accused;
  std::erase_if(s.accused, [&](const Accusation& a) {
    if (std::find(s.late.begin(), s.late.end(), a) != s.late.end()) return false;
    std::vector<Accusation> others = all;
    std::erase(others, a);
    return likelihood.gain(others, a, likelihood.last_checkpoint()) < likelihood.least_gain();
  });
}

/// Leaves out the rows in which the current changes, and keeps what they show of the channels' times. Where channels
/// are read at different moments of a row with several steps, the current at a reading is unknown: not noise, but an
/// error that goes with the current and that resistances would follow.
void leave_moving_rows_out(PackState& s) {
  s.healthy = healthy_spread(s.fits, s.track.r0_ohm);
  s.staggered = staggered(s, likelihood_of(s));
  s.track.uses_moving = false;
  s.healthy = least_spread(s.track.r0_ohm);
  s.noise = starting_noise();
  s.own_noise.clear();
  fit_all(s, true, limits.done.first, limits.done.noise);
  learn_noise(s);
  fit_all(s, true, limits.done.noise, limits.done.second);
  learn_own_noise(s);
}

/// The OCV bends, and a load with a period of its own is alike a period later: a fit from the state of the neighbours
/// and the lag of the readings may end where another one is better. A fit that is better without the lag removes it.
void start_elsewhere(PackState& s, std::size_t c) {
  double& lag_s = s.channels.cells[c].lag_s;
  Vector start = starting_point(input_of(s, c), lag_s);
  CellFit other = fit_cell(input_of(s, c), start, prior_of(s, c, true), noise_for(s, c));
  if (other.cost < s.fits[c].cost) s.fits[c] = std::move(other);
  if (lag_s == 0) return;
  start[delay] = 0;
  other = fit_cell(input_of(s, c), start, prior_of(s, c, true), noise_for(s, c));
  // a fit that comes back to the lag says that it is there
  const bool without_lag = std::abs(other.theta[delay]) < std::abs(lag_s) / 2;
  if (!without_lag || !(other.cost < s.fits[c].cost)) return;
  s.fits[c] = std::move(other);
  lag_s = 0;
  for (std::vector<Accusation>* list : {&s.late, &s.accused}) std::erase(*list, Accusation{Cause::late, c});
}

}  // namespace

PackLikelihood likelihood_of(const PackState& s) {
  return {s.fits, s.healthy, s.track.r0_ohm, s.track.days.back(), s.track.step_s, s.track.unseen_share};
}

std::vector<std::size_t> reference_of(const PackState& s) {
  std::vector<std::size_t> cells = usual_cells(s.pack);
  std::vector<std::size_t> clean = cells;
  std::erase_if(clean, [&](std::size_t c) {
    return std::any_of(s.accused.begin(), s.accused.end(), [&](const Accusation& a) { return a.touches(c); });
  });
  return clean.size() < 2 ? cells : clean;
}

std::optional<PackFinding> staggered(const PackState& s, const PackLikelihood& likelihood) {
  std::vector<std::size_t> cells;
  for (std::size_t c = 0; c < s.fits.size(); ++c) {
    const bool accused = std::any_of(s.accused.begin(), s.accused.end(), [&](const auto& a) { return a.touches(c); });
    if (!accused && !s.channels.cells[c].held_s) cells.push_back(c);
  }
  return staggered_channels(s.track, s.pack, cells, likelihood);
}

void fit_and_accuse(PackState& s) {
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
  for (std::size_t c = 0; c < s.fits.size(); ++c) start_elsewhere(s, c);
  learn_noise(s);
  fit_all(s, true, done.noise, done.second);
  learn_own_noise(s);
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

}  // namespace bms::diagnosis::pack
