// Replays a recording through the estimator with one scalar type.
//
// The estimator is compiled for every number of states that a cell file may ask for, and for each scalar. This takes
// half a minute, so each scalar has a source of its own. In fixed point the estimator consists of many small functions,
// and inlining all of them takes a minute of compile time: the estimators with mechanisms are compiled apart, with
// little inlining.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <limits>
#include <optional>
#include <vector>

#include "estimator/soc_estimator.hpp"
#include "host_sim/replay.hpp"
#include "model/extended.hpp"

namespace bms::host_sim {

/// Number of the first values of an estimator::ExtendedEstimate if sensor errors are states: error of the voltage,
/// offset of the current, standard deviation of the offset.
inline constexpr std::size_t error_values = 3;

namespace replay_detail {

inline constexpr double timing_s = 0.03;  ///< long enough for the clock and a cold cache

template <class S>
EstimateRow row_of(const estimator::Estimate<S>& e) {
  return {arithmetic::as_double(e.soc), arithmetic::as_double(e.soc_sigma), arithmetic::as_double(e.v_rc_v),
          arithmetic::as_double(e.voltage_predicted_v), e.flags};
}

template <class Estimator, class Cell>
void step_through(const Cell& cell, const std::vector<measurement::Sample>& samples,
                  const std::optional<measurement::StartingPoint>& start,
                  std::vector<typename Estimator::Result>& estimates) {
  Estimator estimator = start ? Estimator(*start) : Estimator();
  for (std::size_t k = 0; k < samples.size(); ++k) estimates[k] = estimator.step(cell, samples[k]);
}

template <class Estimator, class Cell>
[[gnu::flatten]] void step_through_flat(const Cell& cell, const std::vector<measurement::Sample>& samples,
                                        const std::optional<measurement::StartingPoint>& start,
                                        std::vector<typename Estimator::Result>& estimates) {
  step_through<Estimator>(cell, samples, start, estimates);
}

template <class Estimator, class Cell>
Track run_estimator(const Cell& cell, const std::vector<measurement::Sample>& samples,
                    const std::optional<measurement::StartingPoint>& start, std::size_t extra, Timing timing) {
  using S = typename Estimator::Scalar;
  std::vector<typename Estimator::Result> estimates(samples.size());
  double best_s = std::numeric_limits<double>::infinity(), total_s = 0;
  do {
    const auto begin = std::chrono::steady_clock::now();
    if constexpr (Estimator::extra_values == 0)
      step_through_flat<Estimator>(cell, samples, start, estimates);
    else
      step_through<Estimator>(cell, samples, start, estimates);
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    best_s = std::min(best_s, seconds);
    total_s += seconds;
  } while (timing == Timing::measured && total_s < timing_s);

  Track track;
  track.steps_per_second = static_cast<double>(samples.size()) / best_s;
  track.rows.reserve(samples.size());
  for (const auto& e : estimates) {
    track.rows.push_back(row_of<S>(e));
    if constexpr (!std::same_as<S, double>)
      track.words.push_back(estimator::words(static_cast<const estimator::Estimate<S>&>(e)));
    if constexpr (Estimator::extra_values > 0) {
      for (std::size_t k = 0; k < extra; ++k) {
        if constexpr (std::same_as<S, double>)
          track.states.push_back(e.extra[k]);
        else
          track.state_words.push_back(estimator::word(e.extra[k]));
      }
    }
  }
  return track;
}

/// Runs the estimator with as many states as the mechanisms of the cell have voltages.
template <class S, bool Errors, std::size_t Voltages = 0>
Track run_extended(const model::ExtendedCell<S, model::max_intervals, model::ChosenLaws<S>>& cell,
                   const std::vector<measurement::Sample>& samples,
                   const std::optional<measurement::StartingPoint>& start, Timing timing) {
  using Laws = model::ChosenLaws<S>;
  if constexpr (Voltages < Laws::most_voltage_states) {
    if (cell.laws.voltage_states() > Voltages)
      return run_extended<S, Errors, Voltages + 1>(cell, samples, start, timing);
  }
  return run_estimator<estimator::SocEstimator<S, model::ExtendedRc<Voltages, Laws::most_states, Errors>::template Of>>(
      cell, samples, start, (Errors ? error_values : 0) + cell.laws.states(), timing);
}

/// errors: sensor errors are states of the filter.
template <class S>
Track run_with_mechanisms(const model::ExtendedCell<S, model::max_intervals, model::ChosenLaws<S>>& cell, bool errors,
                          const std::vector<measurement::Sample>& samples,
                          const std::optional<measurement::StartingPoint>& start, Timing timing) {
  return errors ? run_extended<S, true>(cell, samples, start, timing)
                : run_extended<S, false>(cell, samples, start, timing);
}

using FixedExtendedCell =
    model::ExtendedCell<arithmetic::FixedPoint, model::max_intervals, model::ChosenLaws<arithmetic::FixedPoint>>;
extern template Track run_with_mechanisms<arithmetic::FixedPoint>(
    const FixedExtendedCell& cell, bool errors, const std::vector<measurement::Sample>& samples,
    const std::optional<measurement::StartingPoint>& start, Timing timing);

}  // namespace replay_detail

template <class S>
Track run(const files::CellFile& file, const std::vector<measurement::Sample>& samples,
          const std::optional<measurement::StartingPoint>& start, Timing timing) {
  const auto cell = model::prepare<S, model::max_intervals>(file.parameters);
  const auto mechanisms = files::on_board(file.mechanisms);
  const bool errors = file.parameters.noise.errors_are_states;
  if (mechanisms.empty() && !errors)
    return replay_detail::run_estimator<estimator::SocEstimator<S>>(cell, samples, start, 0, timing);
  const model::ExtendedCell<S, model::max_intervals, model::ChosenLaws<S>> extended{
      cell, model::chosen<S>(mechanisms, file.parameters.capacity_ah)};
  return replay_detail::run_with_mechanisms<S>(extended, errors, samples, start, timing);
}

extern template Track run<float>(const files::CellFile& file, const std::vector<measurement::Sample>& samples,
                                 const std::optional<measurement::StartingPoint>& start, Timing timing);
extern template Track run<double>(const files::CellFile& file, const std::vector<measurement::Sample>& samples,
                                  const std::optional<measurement::StartingPoint>& start, Timing timing);
extern template Track run<arithmetic::FixedPoint>(const files::CellFile& file,
                                                  const std::vector<measurement::Sample>& samples,
                                                  const std::optional<measurement::StartingPoint>& start,
                                                  Timing timing);

}  // namespace bms::host_sim
