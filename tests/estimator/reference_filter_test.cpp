// The estimator against a textbook filter: the same equations, dense matrices by Eigen.
#include "tests/estimator/reference_filter.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "estimator/soc_estimator.hpp"
#include "tests/cells.hpp"
#include "tests/estimator/eigen_covariance.hpp"
#include "tests/starting_point.hpp"

namespace bms::estimator {
namespace {

using Ud = tests::ReferenceFilter<double, UdCovariance<double, 2>>;
using Joseph = tests::ReferenceFilter<double, tests::EigenCovariance<double, 2, tests::Form::joseph>>;
using Plain = tests::ReferenceFilter<double, tests::EigenCovariance<double, 2, tests::Form::plain>>;

/// An hour of pulses at 1 Hz, calls f(current_a, voltage_v) for each second.
template <class F>
void hour(F&& f) {
  const auto cell = tests::prepared<double>();
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0, 0.001);
  model::OneRc<double>::State x{};
  double soc = 0.77;
  for (int k = 1; k <= 3'600; ++k) {
    constexpr double phases_a[] = {-5, 1, 0};
    const double current_a = phases_a[(k / 40) % 3];
    soc += current_a / 3'600 / 6;
    const auto at = model::look_up(cell, soc);
    x = model::OneRc<double>::advance(x, at, model::OneRc<double>::discretise(at, 1), {current_a, 1});
    f(current_a, model::OneRc<double>::voltage(x, at, {current_a, 1}) + noise(random));
  }
}

TEST(ReferenceFilter, EveryFormOfTheCovarianceGivesTheSameEstimate) {
  const auto cell = tests::prepared<double>();
  Ud ud(0.77, 0.02, 0.005);
  Joseph joseph(0.77, 0.02, 0.005);
  Plain plain(0.77, 0.02, 0.005);
  hour([&](double current_a, double voltage_v) {
    const double soc = ud.step(cell, current_a, voltage_v, 1);
    ASSERT_NEAR(joseph.step(cell, current_a, voltage_v, 1), soc, 1e-9);
    ASSERT_NEAR(plain.step(cell, current_a, voltage_v, 1), soc, 1e-9);
    ASSERT_NEAR(joseph.soc_variance() / ud.soc_variance(), 1, 1e-7);
    ASSERT_NEAR(plain.soc_variance() / ud.soc_variance(), 1, 1e-7);
  });
}

TEST(ReferenceFilter, IsWhatTheEstimatorComputesWhereItsGuardsHaveNothingToDo) {
  const auto cell = tests::prepared<double>();
  SocEstimator<double> estimator(starting_at(0.77, 0.005));
  const auto first = estimator.step(cell, {0, 0, measurement::no_reading, 2'500});
  Joseph reference(first.soc, first.soc_sigma, std::sqrt(estimator.state().covariance.variance<0>()));
  std::uint64_t time_us = 0;
  hour([&](double current_a, double voltage_v) {
    const auto voltage_uv = static_cast<std::int32_t>(std::lround(1e6 * voltage_v));
    const auto e = estimator.step(
        cell, {time_us += 1'000'000, static_cast<std::int32_t>(std::lround(1e6 * current_a)), voltage_uv, 2'500});
    const double soc = reference.step(cell, current_a, 1e-6 * voltage_uv, 1);
    ASSERT_EQ(e.flags, 0U);
    ASSERT_NEAR(e.soc, soc, 1e-6);
    ASSERT_NEAR(e.soc_sigma, std::sqrt(reference.soc_variance()), 1e-6);
    ASSERT_NEAR(e.v_rc_v, reference.v_rc_v(), 1e-6);
  });
}

}  // namespace
}  // namespace bms::estimator
