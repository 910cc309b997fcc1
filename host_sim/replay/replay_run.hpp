// Replays a recording through the estimator with one scalar type.
//
// The estimator is compiled for two numbers of states, and for each scalar: twelve and more seconds, so each scalar has
// a source of its own. In fixed point the estimator consists of many small functions,
// and inlining all of them takes a minute of compile time: the estimators with mechanisms are compiled apart, with
// little inlining.
#pragma once

#include <algorithm>
#include <concepts>
#include <cstddef>
#include <optional>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include "estimator/soc_estimator.hpp"
#include "model/extended.hpp"
#include "replay/processor_time.hpp"
#include "replay/replay.hpp"

namespace bms::replay {

/// Number of the first values of an estimator::ExtendedEstimate if sensor errors are states: error of the voltage,
/// offset of the current, standard deviation of the offset.
inline constexpr std::size_t error_values = 3;

namespace replay_detail {

template <class S>
inline constexpr ScalarKind kind_of = std::same_as<S, float> ? ScalarKind::float32 : ScalarKind::fixed;

inline constexpr double timing_s = 0.03;  ///< long enough for the clock and a cold cache

inline constexpr std::size_t block_rows = 4'096;  ///< samples and estimates in between stay in the cache

template <class S>
EstimateRow row_of(const estimator::Estimate<S>& e) {
  return {arithmetic::as_double(e.soc), arithmetic::as_double(e.soc_sigma), arithmetic::as_double(e.v_rc_v),
          arithmetic::as_double(e.voltage_predicted_v), e.flags};
}

/// The estimator is a local variable, so that its state may stay in registers.
template <class Estimator, class Cell>
void step_through(const Cell& cell, std::span<const measurement::Sample> samples, Estimator& continued,
                  std::vector<typename Estimator::Result>& estimates) {
  Estimator estimator = continued;
  for (std::size_t k = 0; k < samples.size(); ++k) estimates[k] = estimator.step(cell, samples[k]);
  continued = estimator;
}

template <class Estimator, class Cell>
[[gnu::flatten]] void step_through_flat(const Cell& cell, std::span<const measurement::Sample> samples,
                                        Estimator& continued, std::vector<typename Estimator::Result>& estimates) {
  step_through<Estimator>(cell, samples, continued, estimates);
}

/// Runs once and calls take(estimates, count) for each block. Returns the processor time of the estimator alone [s].
template <class Estimator, class Cell, class Take>
double run_once(const Cell& cell, const measurement::SampleList& samples, const Start& start, Take&& take) {
  Estimator estimator = start.soc ? Estimator(*start.soc) : Estimator();
  if (start.capacity) estimator.restore_capacity(*start.capacity);
  std::vector<measurement::Sample> space;
  std::vector<typename Estimator::Result> estimates(std::min(block_rows, samples.size()));
  double seconds = 0;
  for (std::size_t first = 0; first < samples.size(); first += block_rows) {
    const std::span<const measurement::Sample> block = samples.part(first, block_rows, space);
    const double begin_s = processor_time_s();
    if constexpr (Estimator::extra_values == 0)
      step_through_flat<Estimator>(cell, block, estimator, estimates);
    else
      step_through<Estimator>(cell, block, estimator, estimates);
    seconds += processor_time_s() - begin_s;
    take(estimates, block.size());
  }
  return seconds;
}

template <class Estimator, class Cell>
Track run_estimator(const Cell& cell, const measurement::SampleList& samples, const Start& start, std::size_t extra,
                    Timing timing) {
  using S = typename Estimator::Scalar;
  constexpr bool numbers = std::same_as<S, double>;
  std::vector<std::conditional_t<numbers, EstimateRow, estimator::EstimateWords>> rows;
  rows.reserve(samples.size());
  Track track;
  if constexpr (numbers)
    track.state_numbers.reserve(samples.size() * extra);
  else
    track.state_words.reserve(samples.size() * extra);
  const auto keep = [&](const std::vector<typename Estimator::Result>& estimates, std::size_t count) {
    for (std::size_t row = 0; row < count; ++row) {
      const auto& e = estimates[row];
      if constexpr (numbers)
        rows.push_back(row_of<S>(e));
      else
        rows.push_back(estimator::words(static_cast<const estimator::Estimate<S>&>(e)));
      if constexpr (Estimator::extra_values > 0) {
        for (std::size_t k = 0; k < extra; ++k) {
          if constexpr (numbers)
            track.state_numbers.push_back(e.extra[k]);
          else
            track.state_words.push_back(estimator::word(e.extra[k]));
        }
      }
    }
  };
  double best_s = run_once<Estimator>(cell, samples, start, keep), total_s = best_s;
  while (timing == Timing::measured && samples.size() > 0 && total_s < timing_s) {
    const double seconds = run_once<Estimator>(cell, samples, start, [](const auto&, std::size_t) {});
    best_s = std::min(best_s, seconds);
    total_s += seconds;
  }
  track.steps_per_second = static_cast<double>(samples.size()) / best_s;
  if constexpr (numbers)
    track.rows = Estimates(std::move(rows));
  else
    track.rows = Estimates(std::move(rows), kind_of<S>);
  return track;
}

/// Places for voltages of mechanisms, besides as many as there can be: as the built-in extended cells have.
inline constexpr std::size_t usual_voltages = 3;

template <class S, std::size_t Voltages, bool Errors>
using ExtendedEstimator =
    estimator::SocEstimator<S, model::ExtendedRc<Voltages, model::ChosenLaws<S>::most_states, Errors>::template Of>;

/// Returns run(std::type_identity<E>()) for the estimator E that has room for these laws. Places that are left do not
/// change the estimates. errors: sensor errors are states of the filter.
template <class S, class Run>
auto with_estimator_for(const model::ChosenLaws<S>& laws, bool errors, Run run) {
  constexpr std::size_t most = model::ChosenLaws<S>::most_voltage_states;
  const bool usual = laws.voltage_states() <= usual_voltages;
  if (errors)
    return usual ? run(std::type_identity<ExtendedEstimator<S, usual_voltages, true>>())
                 : run(std::type_identity<ExtendedEstimator<S, most, true>>());
  return usual ? run(std::type_identity<ExtendedEstimator<S, usual_voltages, false>>())
               : run(std::type_identity<ExtendedEstimator<S, most, false>>());
}

template <class S>
Track run_with_mechanisms(const model::ExtendedCell<S, model::max_intervals, model::ChosenLaws<S>>& cell, bool errors,
                          const measurement::SampleList& samples, const Start& start, Timing timing) {
  return with_estimator_for<S>(cell.laws, errors, [&]<class E>(std::type_identity<E>) {
    return run_estimator<E>(cell, samples, start, (errors ? error_values : 0) + cell.laws.states(), timing);
  });
}

using FixedExtendedCell =
    model::ExtendedCell<arithmetic::FixedPoint, model::max_intervals, model::ChosenLaws<arithmetic::FixedPoint>>;
extern template Track run_with_mechanisms<arithmetic::FixedPoint>(const FixedExtendedCell& cell, bool errors,
                                                                  const measurement::SampleList& samples,
                                                                  const Start& start, Timing timing);

}  // namespace replay_detail

template <class S>
Track run(const files::CellFile& file, const measurement::SampleList& samples, const Start& start, Timing timing) {
  const auto cell = model::prepare<S, model::max_intervals>(file.parameters);
  const auto mechanisms = files::on_board(file.mechanisms);
  const bool errors = file.parameters.noise.errors_are_states;
  if (mechanisms.empty() && !errors)
    return replay_detail::run_estimator<estimator::SocEstimator<S>>(cell, samples, start, 0, timing);
  const model::ExtendedCell<S, model::max_intervals, model::ChosenLaws<S>> extended{
      cell, model::chosen<S>(mechanisms, file.parameters.capacity_ah)};
  return replay_detail::run_with_mechanisms<S>(extended, errors, samples, start, timing);
}

extern template Track run<float>(const files::CellFile& file, const measurement::SampleList& samples,
                                 const Start& start, Timing timing);
extern template Track run<double>(const files::CellFile& file, const measurement::SampleList& samples,
                                  const Start& start, Timing timing);
extern template Track run<arithmetic::FixedPoint>(const files::CellFile& file, const measurement::SampleList& samples,
                                                  const Start& start, Timing timing);

}  // namespace bms::replay
