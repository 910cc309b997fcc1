// A slow polarisation whose surface is ahead by minutes of charge, with hardly any voltage drop of its own.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <utility>
#include <vector>

#include "estimator/soc_estimator.hpp"
#include "model/extended.hpp"
#include "tests/cells.hpp"

namespace bms::estimator {
namespace {

/// Largest error of the SOC from the sixth to the twelfth hour between 6 and 97 % after
/// minutes without a current, and the largest
/// in standard deviations.
template <class S>
std::pair<double, double> largest_error(double resistance_ohm, double time_constant_s, double lag_s) {
  constexpr std::size_t modes = 2, states = model::ChosenLaws<double>::most_states;
  const auto& parameters = tests::table9;
  model::MechanismSetting slow = model::default_setting(model::mechanism_index("slow_polarisation"), parameters);
  slow.value[0] = resistance_ohm;
  slow.value[1] = time_constant_s;
  slow.value[2] = 0;
  slow.value[3] = lag_s;
  const std::vector<model::MechanismSetting> all{slow};
  const auto tables = tests::prepared<double>();
  model::OpenLoopSimulation<double> truth(tables, parameters.capacity_ah,
                                          model::chosen<double>(all, parameters.capacity_ah), 0.7);
  const model::ExtendedCell<S, model::max_intervals, model::ChosenLaws<S>> cell{
      tests::prepared<S>(), model::chosen<S>(all, parameters.capacity_ah)};
  SocEstimator<S, model::ExtendedRc<modes, states>::template Of> estimator;
  std::mt19937 random(1);
  std::normal_distribution<double> noise_v(0, 0.001);
  std::uniform_real_distribution<double> any_a(-parameters.capacity_ah, parameters.capacity_ah);
  double direction = -1, worst = 0, in_sigmas = 0;
  for (int second = 1; second <= 12 * 3'600; ++second) {
    if (truth.soc() < 0.06) direction = 1;
    if (truth.soc() > 0.97) direction = -1;
    const double current_a = direction * (second / 60 % 3 != 0 ? 0.7 : 0.1) * parameters.capacity_ah;
    const bool missing = second < 200;  // of the current: the surface is somewhere
    const double v = truth.step(second, 1, missing ? any_a(random) : current_a, 25.0, [](auto&, double) {});
    const measurement::Sample sample{
        static_cast<std::uint64_t>(second) * 1'000'000,
        missing ? measurement::no_reading : static_cast<std::int32_t>(std::lround(1e6 * current_a)),
        static_cast<std::int32_t>(std::lround(1e6 * (v + noise_v(random)))), 2'500};
    const auto e = estimator.step(cell, sample);
    if (second < 6 * 3'600) continue;
    const double error = std::abs(arithmetic::as_double(e.soc) - truth.soc());
    worst = std::max(worst, error);
    in_sigmas = std::max(in_sigmas, error / arithmetic::as_double(e.soc_sigma));
  }
  return {worst, in_sigmas};
}

TEST(SurfaceLag, LeavesTheSocObservableAlsoWithoutAVoltageDrop) {
  for (const double resistance_ohm : {0.0, 2e-14, 0.0005, 0.002, 0.02}) {
    for (const double time_constant_s : {60.0, 600.0, 20'000.0}) {
      for (const double lag_s : {90.0, 300.0, 730.0, 900.0}) {
        const auto [error, in_sigmas] = largest_error<float>(resistance_ohm, time_constant_s, lag_s);
        EXPECT_LT(error, 0.05) << resistance_ohm << " ohm, " << time_constant_s << " s, lag " << lag_s << " s";
        EXPECT_LT(in_sigmas, 4) << resistance_ohm << " ohm, " << time_constant_s << " s, lag " << lag_s << " s";
      }
    }
  }
}

}  // namespace
}  // namespace bms::estimator
