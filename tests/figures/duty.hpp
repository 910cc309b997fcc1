// A thousand hours of a forklift cell's life, simulated by the plant: shifts, charges that are not always made,
// displays that are left on, leakage that no sensor sees, sensors that drift. What an estimator makes of it.
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <limits>

#include "estimator/soc_estimator.hpp"
#include "files/cell_file.hpp"
#include "model/extended.hpp"
#include "plant/random.hpp"
#include "plant/truth_cell.hpp"

namespace bms {

struct DutyFigures {
  std::uint64_t steps = 0;
  double rmse = 0, largest = 0, rmse_first = 0,
         rmse_last = 0;  ///< of soc; over all, the first and the last hundred hours
  double inside = 0, mean_sigma = 0, largest_sigma = 0;
  bool finite = true;
  std::uint64_t subnormal =
      0;              ///< numbers of the covariance, looked at every 1,000 steps, that are too small for a normal float
  double slower = 0;  ///< time of a step in the last hundred hours over that in the first
};

/// First-order Gauss-Markov errors of the measuring chain.
struct Drift {
  double current_a = 0.02, current_s = 3'600;  ///< table9's
  double voltage_v = 0.0005, voltage_s = 36'000;
};

/// Samples of 1 Hz. Cell: prepared from table9, 6 Ah. Estimator: of float.
template <class Estimator, class Cell>
DutyFigures duty(const Cell& cell, const Drift& drift, std::uint64_t seed, int hours = 1'000) {
  plant::CellParameters parameters;
  parameters.step_s = 0.5;
  plant::Cell plant(parameters, {.soc = 0.9, .v_rc_v = 0, .temperature_c = 20});
  plant::Random random(seed);
  Estimator estimator(measurement::StartingPoint{900'000'000, 20'000'000});
  DutyFigures figures;
  double squares[3] = {}, counts[3] = {}, times_s[3] = {};
  double offset_a = 0, offset_v = 0, shift_load = 1;
  bool charges = false;
  const int seconds = hours * 3'600, part = seconds / 10;
  constexpr double leakage_a = 0.003, display_a = 0.012;
  const auto drifts = [&](double& error, double sigma, double seconds_) {
    error += -error / seconds_ + sigma * std::sqrt(2 / seconds_) * random.normal();
  };
  for (int k = 0; k < seconds; ++k) {
    const int of_day = k % 86'400;
    if (of_day == 0) {
      shift_load = 0.2 + 0.3 * random.uniform();
      charges = plant.soc() < 0.5 || random.uniform() < 0.7;
    }
    double current_a = -display_a;
    if (of_day >= 6 * 3'600 && of_day < 14 * 3'600 && plant.soc() > 0.08)
      current_a = shift_load * (k % 120 < 40 ? -6 * (0.5 + random.uniform()) : k % 120 < 60 ? 3 : 0);
    if (of_day >= 18 * 3'600 && charges && plant.soc() < 0.985) current_a = 1.5;
    plant.run(current_a - leakage_a, 20, 1);
    drifts(offset_a, drift.current_a, drift.current_s);
    drifts(offset_v, drift.voltage_v, drift.voltage_s);
    const measurement::Sample sample{
        static_cast<std::uint64_t>(k + 1) * 1'000'000,
        static_cast<std::int32_t>(1e6 * (current_a + offset_a + 0.01 * random.normal())),
        static_cast<std::int32_t>(1e6 * (plant.voltage_v() + offset_v + 0.001 * random.normal())),
        static_cast<std::int16_t>(100 * plant.temperature_c())};
    const auto begin = std::chrono::steady_clock::now();
    const auto estimate = estimator.step(cell, sample);
    const double took_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    const double error = static_cast<double>(estimate.soc) - plant.soc(),
                 sigma = static_cast<double>(estimate.soc_sigma);
    const int which = k < part ? 0 : k >= seconds - part ? 2 : 1;
    squares[which] += error * error;
    counts[which] += 1;
    times_s[which] += took_s;
    figures.finite = figures.finite && std::isfinite(error) && std::isfinite(sigma);
    figures.largest = std::max(figures.largest, std::abs(error));
    figures.largest_sigma = std::max(figures.largest_sigma, sigma);
    figures.mean_sigma += sigma / seconds;
    figures.inside += (std::abs(error) <= 2 * sigma ? 1.0 : 0.0) / seconds;
    ++figures.steps;
    if (k % 1'000 == 0) {
      for (const auto v : estimator.state().covariance.variances())
        figures.subnormal += std::fpclassify(v) == FP_SUBNORMAL ? 1 : 0;
      for (const auto& row : estimator.state().covariance.dense()) {
        for (const double p : row)
          figures.subnormal += p != 0 && std::abs(p) < static_cast<double>(std::numeric_limits<float>::min()) ? 1 : 0;
      }
    }
  }
  const double all = squares[0] + squares[1] + squares[2];
  figures.rmse = std::sqrt(all / seconds);
  figures.rmse_first = std::sqrt(squares[0] / counts[0]);
  figures.rmse_last = std::sqrt(squares[2] / counts[2]);
  figures.slower = times_s[2] / counts[2] / (times_s[0] / counts[0]);
  return figures;
}

/// The two that are tested and told: with table9 as it is and sensors as its file says; and with errors as states and
/// sensors that drift by half a percent of 1C and a channel of 2 mV.
inline DutyFigures duty_as_in_the_file() {
  return duty<estimator::SocEstimator<float>>(
      model::prepare<float, model::max_intervals>(files::read_cell("table9").parameters), {}, 1);
}
inline DutyFigures duty_with_errors() {
  using Laws = model::ChosenLaws<float>;
  files::CellFile file = files::read_cell("table9");
  file.parameters.noise.current_offset_a =
      0.06;  // a hundredth of 1C, over a day's work: as identify --extend writes it
  file.parameters.noise.current_offset_correlation_s = 36'000;
  file.parameters.noise.model_correlation_s = 3'000;
  const model::ExtendedCell<float, model::max_intervals, Laws> cell{
      model::prepare<float, model::max_intervals>(file.parameters), {}};
  return duty<estimator::SocEstimator<float, model::ExtendedRc<0, Laws::most_states, true>::Of>>(
      cell, {0.03, 36'000, 0.002, 36'000}, 1);
}

}  // namespace bms
