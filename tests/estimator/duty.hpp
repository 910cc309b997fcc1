// A thousand hours of a forklift cell, simulated by the plant: shifts, charges that are sometimes left out, displays
// that stay on, leakage that no sensor measures, sensors that drift. The estimator runs along.
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <limits>

#include "estimator/soc_estimator.hpp"
#include "model/extended.hpp"
#include "plant/random.hpp"
#include "plant/truth_cell.hpp"
#include "tests/cells.hpp"
#include "tests/starting_point.hpp"

namespace bms {

struct DutyFigures {
  std::uint64_t steps = 0;
  double rmse = 0, largest = 0;          ///< error of soc, over all hours
  double rmse_first = 0, rmse_last = 0;  ///< over the first and the last tenth
  double inside = 0;                     ///< fraction of samples within two sigma
  double mean_sigma = 0, largest_sigma = 0;
  bool finite = true;
  std::uint64_t subnormal = 0;  ///< elements of the covariance that are too small for a normal float; every 1,000 steps
  double slower = 0;            ///< time of a step in the last tenth over that in the first
};

/// First-order Gauss-Markov errors of the sensors: standard deviation and correlation time. Default: those of table9.
struct Drift {
  double current_a = 0.02, current_s = 3'600;
  double voltage_v = 0.0005, voltage_s = 36'000;
};

/// The plant, its load and its sensors, at 1 Hz.
class DutyWorld {
 public:
  DutyWorld(const Drift& drift, std::uint64_t seed)
      : drift_(drift), plant_(parameters(), {.soc = 0.9, .v_rc_v = 0, .temperature_c = 20}), random_(seed) {}

  /// Second k: runs the plant and measures it.
  measurement::Sample sample(int k) {
    constexpr double leakage_a = 0.003;
    const double current_a = load_a(k);
    plant_.run(current_a - leakage_a, 20, 1);
    walk(offset_a_, drift_.current_a, drift_.current_s);
    walk(offset_v_, drift_.voltage_v, drift_.voltage_s);
    const double read_a = current_a + offset_a_ + 0.01 * random_.normal();
    const double read_v = plant_.voltage_v() + offset_v_ + 0.001 * random_.normal();
    return {static_cast<std::uint64_t>(k + 1) * 1'000'000, static_cast<std::int32_t>(1e6 * read_a),
            static_cast<std::int32_t>(1e6 * read_v), static_cast<std::int16_t>(100 * plant_.temperature_c())};
  }
  double soc() const { return plant_.soc(); }

 private:
  static plant::CellParameters parameters() {
    plant::CellParameters p;
    p.step_s = 0.5;
    return p;
  }

  /// A shift from 6 to 14 h, a charge from 18 h on most days, else the display.
  double load_a(int k) {
    constexpr double display_a = 0.012;
    const int second_of_day = k % 86'400;
    if (second_of_day == 0) {
      shift_load_ = 0.2 + 0.3 * random_.uniform();
      charges_ = plant_.soc() < 0.5 || random_.uniform() < 0.7;
    }
    double current_a = -display_a;
    if (second_of_day >= 6 * 3'600 && second_of_day < 14 * 3'600 && plant_.soc() > 0.08) current_a = shift_a(k % 120);
    if (second_of_day >= 18 * 3'600 && charges_ && plant_.soc() < 0.985) current_a = 1.5;
    return current_a;
  }

  /// Two minutes: 40 s of driving, 20 s of braking, a rest.
  double shift_a(int second) {
    if (second < 40) return shift_load_ * (-6 * (0.5 + random_.uniform()));
    return second < 60 ? shift_load_ * 3 : 0;
  }

  void walk(double& error, double sigma, double correlation_s) {
    error += -error / correlation_s + sigma * std::sqrt(2 / correlation_s) * random_.normal();
  }

  Drift drift_;
  plant::Cell plant_;
  plant::Random random_;
  double offset_a_ = 0, offset_v_ = 0, shift_load_ = 1;
  bool charges_ = false;
};

/// Number of subnormal floats in the covariance of an estimator.
template <class Estimator>
std::uint64_t subnormal_elements(const Estimator& estimator) {
  std::uint64_t count = 0;
  for (const auto v : estimator.state().covariance.variances()) count += std::fpclassify(v) == FP_SUBNORMAL ? 1 : 0;
  for (const auto& row : estimator.state().covariance.dense()) {
    for (const double p : row)
      count += p != 0 && std::abs(p) < static_cast<double>(std::numeric_limits<float>::min()) ? 1 : 0;
  }
  return count;
}

/// Cell: prepared from table9, 6 Ah. Estimator: of float.
template <class Estimator, class Cell>
DutyFigures duty(const Cell& cell, const Drift& drift, std::uint64_t seed, int hours = 1'000) {
  struct Part {
    double squares = 0, count = 0, time_s = 0;
  };
  DutyWorld world(drift, seed);
  Estimator estimator(starting_at(0.9, 0.02));
  DutyFigures figures;
  Part first, middle, last;
  const int seconds = hours * 3'600, tenth = seconds / 10;
  const auto part_of = [&](int k) -> Part& {
    if (k < tenth) return first;
    return k >= seconds - tenth ? last : middle;
  };
  for (int k = 0; k < seconds; ++k) {
    const measurement::Sample sample = world.sample(k);
    const auto begin = std::chrono::steady_clock::now();
    const auto estimate = estimator.step(cell, sample);
    const double took_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    const double error = static_cast<double>(estimate.soc) - world.soc(),
                 sigma = static_cast<double>(estimate.soc_sigma);
    Part& part = part_of(k);
    part.squares += error * error;
    part.count += 1;
    part.time_s += took_s;
    figures.finite = figures.finite && std::isfinite(error) && std::isfinite(sigma);
    figures.largest = std::max(figures.largest, std::abs(error));
    figures.largest_sigma = std::max(figures.largest_sigma, sigma);
    figures.mean_sigma += sigma / seconds;
    figures.inside += (std::abs(error) <= 2 * sigma ? 1.0 : 0.0) / seconds;
    ++figures.steps;
    if (k % 1'000 == 0) figures.subnormal += subnormal_elements(estimator);
  }
  figures.rmse = std::sqrt((first.squares + middle.squares + last.squares) / seconds);
  figures.rmse_first = std::sqrt(first.squares / first.count);
  figures.rmse_last = std::sqrt(last.squares / last.count);
  figures.slower = last.time_s / last.count / (first.time_s / first.count);
  return figures;
}

/// The two cases of the tests and of the README: table9 as it is, with sensors as in its file; and with sensor errors
/// as states, sensors that drift by half a percent of 1C, and a voltage channel that drifts by 2 mV.
inline DutyFigures duty_as_in_the_file() {
  return duty<estimator::SocEstimator<float>>(tests::prepared<float>(), {}, 1);
}
inline DutyFigures duty_with_errors() {
  using Laws = model::ChosenLaws<float>;
  model::CellParameters<> parameters = tests::table9;
  parameters.noise.current_offset_a = 0.06;  // a hundredth of 1C, over a shift: as identify --extend writes it
  parameters.noise.current_offset_correlation_s = 36'000;
  parameters.noise.model_correlation_s = 3'000;
  const model::ExtendedCell<float, model::max_intervals, Laws> cell{tests::prepared<float>(parameters), {}};
  return duty<estimator::SocEstimator<float, model::ExtendedRc<0, Laws::most_states, true>::Of>>(
      cell, {0.03, 36'000, 0.002, 36'000}, 1);
}

}  // namespace bms
