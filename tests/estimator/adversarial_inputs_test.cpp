// The estimator in integers against whatever a cell file may hold and a sensor may say: random cell files that
// first_fault() accepts, random samples with extremes among them. Compiled with checks of every signed operation,
// whatever the rest of the build does (tests/CMakeLists.txt).
//
// BMS_HOSTILE_INPUTS in the environment: how many samples instead of the usual 100,000.
#include <gtest/gtest.h>

#include <cstdlib>
#include <random>

#include "estimator/soc_estimator.hpp"
#include "model/extended.hpp"

namespace bms::estimator {
namespace {

using S = arithmetic::FixedPoint;
using Random = std::mt19937_64;

double between(Random& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}
/// Evenly over the decades; now and then an end.
double over_decades(Random& random, double low, double high) {
  switch (random() % 8) {
    case 0:
      return low;
    case 1:
      return high;
    default:
      return low * std::pow(high / low, between(random, 0, 1));
  }
}

model::CellParameters<double> random_cell(Random& random) {
  model::CellParameters<double> p;
  p.capacity_ah = over_decades(random, 0.01, 1'000);
  p.limits.voltage_min_v = between(random, 0.5, 4);
  p.limits.voltage_max_v = between(random, p.limits.voltage_min_v + 0.1, 5);
  p.limits.charge_current_max_a = over_decades(random, 1e-3, model::accepted::current_a.high);
  p.limits.discharge_current_max_a = over_decades(random, 1e-3, model::accepted::current_a.high);
  p.limits.temperature_min_c = -20;
  p.limits.temperature_max_c = 60;
  const std::size_t pieces = 1 + random() % 8;
  double soc = 0, v = between(random, 0.6, 3);
  p.ocv.soc.push_back(0);
  for (std::size_t k = 0; k < pieces; ++k) {
    const double left = 1 - soc, next = k + 1 == pieces ? 1 : soc + between(random, 0.02, left / 2);
    const double most = (4.9 - v) / (next - soc), slope = over_decades(random, 1e-6, most < 60 ? most : 60);
    p.ocv.b0_v.push_back(v - slope * soc);
    p.ocv.b1_v.push_back(slope);
    v += slope * (next - soc);
    soc = next;
    p.ocv.soc.push_back(soc);
  }
  const std::size_t nodes = 1 + random() % 6;
  for (std::size_t k = 0; k < nodes; ++k) {
    p.rc.soc.push_back(p.ocv.soc[k % p.ocv.soc.size] * 0.5 + 0.07 * static_cast<double>(k) + 0.01);
    p.rc.r0_ohm.push_back(over_decades(random, 1e-5, 0.5));
    p.rc.r1_ohm.push_back(over_decades(random, 1e-5, 0.5));
    const double low = std::max(100.0, 0.2 / p.rc.r1_ohm[k]), high = std::min(100'000.0, 50'000 / p.rc.r1_ohm[k]);
    p.rc.c1_f.push_back(low < high ? over_decades(random, low, high) : low);
  }
  model::Noise& n = p.noise;
  n.voltage_v = over_decades(random, 1e-5, 0.5);
  n.model_v = over_decades(random, 1e-5, 0.5);
  n.model_correlation_s = random() % 8 == 0 ? 0 : over_decades(random, 1, 86'400);
  n.v_rc_v = over_decades(random, 1e-5, 0.5);
  n.rest_v = over_decades(random, 1e-4, 0.5);
  n.current_a = over_decades(random, 1e-7, 1) * p.capacity_ah;
  n.current_offset_a = over_decades(random, 1e-6, 1) * p.capacity_ah;
  n.current_offset_correlation_s = over_decades(random, 1, 1e6);
  n.current_unknown_a = over_decades(random, 1e-3, 10) * p.capacity_ah;
  p.tolerance = {.ocv_v = between(random, 0, 0.1),
                 .resistance_fraction = between(random, 0, 1),
                 .initial_soc = between(random, 0, 1),
                 .drift_v = between(random, 0, 0.1)};
  return p;
}

/// As random() wants it: within the cell's use, at the ends of what integers hold, or not there.
std::int32_t hostile(Random& random, double low, double high) {
  switch (random() % 12) {
    case 0:
      return measurement::no_reading;
    case 1:
      return std::numeric_limits<std::int32_t>::max();
    case 2:
      return std::numeric_limits<std::int32_t>::min() + 1;
    case 3:
      return static_cast<std::int32_t>(random());
    default:
      return static_cast<std::int32_t>(std::clamp(1e6 * between(random, low, high), -2'147'483'000.0, 2'147'483'000.0));
  }
}

std::uint64_t step_us(Random& random) {
  switch (random() % 16) {
    case 0:
      return 0;
    case 1:
      return 1;
    case 2:
      return random() >> 32;
    case 3:
      return random() >> 20;
    default:
      return 1'000ULL << random() % 14;
  }
}

struct Judged {
  std::size_t cells = 0, samples = 0;
};

template <class Estimator, class Cell>
void live(Random& random, const model::CellParameters<double>& p, const Cell& cell, Judged& judged) {
  Estimator estimator =
      random() % 2 == 0 ? Estimator()
                        : Estimator(measurement::StartingPoint{static_cast<std::int32_t>(random() % 1'000'000'001),
                                                               static_cast<std::int32_t>(random() % 1'000'000'001)});
  const bool calm = random() % 2 == 0;  // steady steps, so that a filter gets somewhere before the next blow
  const std::uint64_t usual_us = 1'000ULL << random() % 14;
  std::uint64_t time_us = random() >> 30;
  constexpr double ends = 1.26;
  for (int k = 0; k < 500; ++k) {
    time_us += calm && random() % 32 != 0 ? usual_us : step_us(random);
    const measurement::Sample sample{time_us,
                                     hostile(random, -p.limits.discharge_current_max_a, p.limits.charge_current_max_a),
                                     hostile(random, p.limits.voltage_min_v - 0.5, p.limits.voltage_max_v + 0.5),
                                     static_cast<std::int16_t>(random())};
    const auto e = estimator.step(cell, sample);
    const double soc = arithmetic::as_double(e.soc), sigma = arithmetic::as_double(e.soc_sigma);
    ASSERT_GE(soc, -ends + 1) << judged.cells << " " << k;
    ASSERT_LE(soc, ends) << judged.cells << " " << k;
    ASSERT_GE(sigma, 0) << judged.cells << " " << k;
    if ((e.flags & not_started) == 0) {
      for (const auto& variance : estimator.state().covariance.variances())
        ASSERT_GT(variance.mantissa(), 0) << judged.cells << " " << k;
    }
    ++judged.samples;
  }
  ++judged.cells;
}

TEST(FixedPointEstimator, StaysInRangeForAnyCellFileAndAnySample) {
  const char* wanted = std::getenv("BMS_HOSTILE_INPUTS");
  const std::size_t inputs = wanted != nullptr ? std::stoull(wanted) : 100'000;
  Random random(20261122);
  Judged judged;
  while (judged.samples < inputs && !HasFatalFailure()) {
    auto p = random_cell(random);
    if (model::first_fault(p).what != nullptr) continue;
    if (random() % 2 == 0) {
      live<SocEstimator<S>>(random, p, model::prepare<S, model::max_intervals>(p), judged);
    } else {
      p.noise.errors_are_states = true;
      live<SocEstimator<S, model::ExtendedRc<0, 0, true>::Of>>(random, p, model::prepare<S, model::max_intervals>(p),
                                                               judged);
    }
  }
  EXPECT_GE(judged.samples, inputs);
  EXPECT_GE(judged.cells, inputs / 500);
  if (wanted != nullptr) std::printf("%zu samples, %zu cell files\n", judged.samples, judged.cells);
}

}  // namespace
}  // namespace bms::estimator
