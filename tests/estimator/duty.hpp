// A thousand hours of a forklift cell, simulated by the plant: shifts, charges that are sometimes left out, displays
// that stay on, leakage that no sensor measures, sensors that drift. The estimator runs along.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numbers>
#include <vector>

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

/// Temperature around the cell: one year is as long as the duty and begins in winter. It is charged indoors.
struct Climate {
  double winter_c = 20, summer_c = 20;
  double least_for_charge_c = 10;

  bool has_seasons() const { return winter_c != summer_c; }
  double at(double of_the_year) const {
    return winter_c + (summer_c - winter_c) * (1 - std::cos(2 * std::numbers::pi * of_the_year)) / 2;
  }
};

/// The plant, its load and its sensors, at 1 Hz.
class DutyWorld {
 public:
  DutyWorld(const Drift& drift, const Climate& climate, int seconds, std::uint64_t seed)
      : drift_(drift),
        climate_(climate),
        seconds_(seconds),
        plant_(parameters(climate), {.soc = 0.9, .v_rc_v = 0, .temperature_c = climate.at(0)}),
        random_(seed) {}

  /// Second k: runs the plant and measures it.
  measurement::Sample sample(int k) {
    constexpr double leakage_a = 0.003;
    const double current_a = load_a(k), outside_c = climate_.at(static_cast<double>(k) / seconds_);
    plant_.run(current_a - leakage_a, current_a > 0 ? std::max(outside_c, climate_.least_for_charge_c) : outside_c, 1);
    walk(offset_a_, drift_.current_a, drift_.current_s);
    walk(offset_v_, drift_.voltage_v, drift_.voltage_s);
    const double read_a = current_a + offset_a_ + 0.01 * random_.normal();
    const double read_v = plant_.voltage_v() + offset_v_ + 0.001 * random_.normal();
    return {static_cast<std::uint64_t>(k + 1) * 1'000'000, static_cast<std::int32_t>(1e6 * read_a),
            static_cast<std::int32_t>(1e6 * read_v), static_cast<std::int16_t>(100 * plant_.temperature_c())};
  }
  double soc() const { return plant_.soc(); }

 private:
  static plant::CellParameters parameters(const Climate& climate) {
    plant::CellParameters p;
    p.step_s = 0.5;
    if (climate.has_seasons()) p.over_temperature = plant::lfp_in_the_cold();
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

  /// Two minutes: 40 s of driving, 20 s of braking, a rest. A cold cell is given less to do.
  double shift_a(int second) {
    const double load = shift_load_ * std::clamp(1 + plant_.temperature_c() / 60, 0.5, 1.0);
    if (second < 40) return load * (-6 * (0.5 + random_.uniform()));
    return second < 60 ? load * 3 : 0;
  }

  void walk(double& error, double sigma, double correlation_s) {
    error += -error / correlation_s + sigma * std::sqrt(2 / correlation_s) * random_.normal();
  }

  Drift drift_;
  Climate climate_;
  int seconds_;
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
DutyFigures duty(const Cell& cell, const Drift& drift, const Climate& climate, std::uint64_t seed, int hours = 1'000) {
  struct Part {
    double squares = 0, count = 0, time_s = 0;
  };
  const int seconds = hours * 3'600, tenth = seconds / 10;
  DutyWorld world(drift, climate, seconds, seed);
  Estimator estimator(starting_at(0.9, 0.02));
  DutyFigures figures;
  Part first, middle, last;
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

/// Resistances over temperature as a user gets them: from pulses at four temperatures that scatter by 5 % each, fitted
/// to the law of the cell files. The plant's own factors are tables; the law's C1 is constant, the plant's is not.
inline model::MechanismSetting resistances_from_pulses(const model::CellParameters<>& parameters, std::uint64_t seed) {
  constexpr std::array celsius = {-20.0, 0.0, 25.0, 45.0};
  constexpr double gas_constant = 8.314462618;
  const plant::TemperatureFactors factors = plant::lfp_in_the_cold();
  plant::Random random(seed);
  std::array<double, 4> x{}, r0{}, r1{};
  for (std::size_t k = 0; k < 4; ++k) {
    x[k] = (1 / (celsius[k] + 273.15) - 1 / 298.15) / gas_constant;
    r0[k] = factors.r0.at(celsius[k]) * (1 + 0.05 * random.normal());
    r1[k] = factors.r1.at(celsius[k]) * (1 + 0.05 * random.normal());
  }
  double best = std::numeric_limits<double>::infinity(), e0 = 0, share = 0, slope = 0, squares = 0;
  for (double e = 20'000; e <= 60'000; e += 250) {
    double ab = 0, aa = 0, misfit = 0;  // r0 - 1 = s (a - 1), relative to r0
    for (std::size_t k = 0; k < 4; ++k) {
      const double a = (std::exp(e * x[k]) - 1) / r0[k];
      ab += a * (r0[k] - 1) / r0[k];
      aa += a * a;
    }
    for (std::size_t k = 0; k < 4; ++k)
      misfit += std::pow(((r0[k] - 1) - ab / aa * (std::exp(e * x[k]) - 1)) / r0[k], 2);
    if (misfit < best) {
      best = misfit;
      e0 = e;
      share = ab / aa;
    }
  }
  for (std::size_t k = 0; k < 4; ++k) {
    slope += x[k] * std::log(r1[k]);
    squares += x[k] * x[k];
  }
  model::MechanismSetting setting =
      model::default_setting(model::mechanism_index("temperature_resistance"), parameters);
  setting.value[0] = e0;
  setting.value[1] = slope / squares;
  setting.value[3] = std::min(share, 1.0);
  return setting;
}

/// table9 with what `identify --extend` writes for a cell with errors as states.
inline model::CellParameters<> table9_with_errors() {
  model::CellParameters<> parameters = tests::table9;
  parameters.noise.current_offset_a = 0.06;  // a hundredth of 1C, over a shift
  parameters.noise.current_offset_correlation_s = 36'000;
  parameters.noise.model_correlation_s = 3'000;
  return parameters;
}

/// The cases of the tests and of the README: table9 as it is, with sensors as in its file; with sensor errors as
/// states, sensors that drift by half a percent of 1C, and a voltage channel that drifts by 2 mV.
inline DutyFigures duty_as_in_the_file(const Climate& climate = {}) {
  return duty<estimator::SocEstimator<float>>(tests::prepared<float>(), {}, climate, 1);
}
inline constexpr Drift larger_drift{0.03, 36'000, 0.002, 36'000};
template <class Laws>
using WithErrors = estimator::SocEstimator<float, model::ExtendedRc<0, Laws::most_states, true>::template Of>;

inline DutyFigures duty_with_errors() {
  using Laws = model::ChosenLaws<float>;
  const model::ExtendedCell<float, model::max_intervals, Laws> cell{tests::prepared<float>(table9_with_errors()), {}};
  return duty<WithErrors<Laws>>(cell, larger_drift, {}, 1);
}

/// From -30 to 45 degrees C by season, with resistances identified at four temperatures.
inline constexpr Climate seasons{.winter_c = -30, .summer_c = 45};
inline DutyFigures duty_over_a_year(std::uint64_t seed = 1, int hours = 1'000) {
  using Laws = model::ChosenLaws<float>;
  model::CellParameters<> parameters = table9_with_errors();
  parameters.tolerance.resistance_fraction = 0.1;  // pulses that scatter by 5 %
  parameters.tolerance.resistance_per_ev = 0.2;    // as measured on a real cell (a123_26650_extended)
  parameters.range.temperature_min_c = -20;
  parameters.range.temperature_max_c = 45;
  const std::vector<model::MechanismSetting> mechanisms{resistances_from_pulses(parameters, seed)};
  const model::ExtendedCell<float, model::max_intervals, Laws> cell{
      tests::prepared<float>(parameters), model::chosen<float>(mechanisms, parameters.capacity_ah)};
  return duty<WithErrors<Laws>>(cell, larger_drift, seasons, seed, hours);
}

}  // namespace bms
