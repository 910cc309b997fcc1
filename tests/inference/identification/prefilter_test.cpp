#include "identification/prefilter.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <complex>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <map>
#include <numbers>
#include <random>
#include <sstream>
#include <stdexcept>
#include <string>

#include "tests/inference/identification/scipy.hpp"

namespace bms::identification {
namespace {

void expect_near(const std::vector<double>& ours, const std::vector<double>& theirs, double tolerance,
                 const std::string& what) {
  ASSERT_EQ(ours.size(), theirs.size()) << what;
  ASSERT_FALSE(theirs.empty()) << what;
  for (std::size_t k = 0; k < ours.size(); ++k) ASSERT_NEAR(ours[k], theirs[k], tolerance) << what << ", value " << k;
}

std::vector<double> evenly(std::size_t n, double step_s) {
  std::vector<double> t;
  for (std::size_t k = 0; k < n; ++k) t.push_back(static_cast<double>(k) * step_s);
  return t;
}

double gain(const SecondOrderFilter& f, double cycles_per_sample) {
  const auto delay = std::polar(1.0, -2 * std::numbers::pi * cycles_per_sample);
  return std::abs((f.b[0] + f.b[1] * delay + f.b[2] * delay * delay) /
                  (f.a[0] + f.a[1] * delay + f.a[2] * delay * delay));
}

TEST(Butterworth, AgreesWithScipyInCoefficientsAndInBothPhases) {
  auto scipy = scipy_reference();
  if (scipy.empty()) GTEST_SKIP() << "no python3 with scipy: install python3-scipy to compare the filters with it";
  const struct {
    const char* name;
    double cutoff_hz, rate_hz;
  } cases[] = {{"low", 0.01, 1}, {"middle", 1, 10}, {"high", 0.49, 1}};
  for (const auto& [prefix, cutoff_hz, rate_hz] : cases) {
    const std::string name = prefix;
    const SecondOrderFilter filter = butterworth_low_pass(cutoff_hz, rate_hz);
    expect_near({filter.b.begin(), filter.b.end()}, scipy[name + "_b"], 1e-10, name + " b");
    expect_near({filter.a.begin(), filter.a.end()}, scipy[name + "_a"], 1e-10, name + " a");
    expect_near(filter_causal(filter, scipy["x"]), scipy[name + "_causal"], 1e-10, name + " causal");
    expect_near(filter_zero_phase(filter, scipy["x"]), scipy[name + "_zero_phase"], 1e-10, name + " zero phase");
  }
}

// At a quarter of the sampling rate the warped frequency is tan(pi/4) = 1: b = 1/(2 + sqrt 2) (1 2 1), a1 = 0.
TEST(Butterworth, AtAQuarterOfTheRateAgreesWithValuesComputedByHand) {
  const SecondOrderFilter f = butterworth_low_pass(25, 100);
  const double b0 = 1 / (2 + std::sqrt(2.0));
  EXPECT_NEAR(f.b[0], b0, 1e-15);
  EXPECT_NEAR(f.b[1], 2 * b0, 1e-15);
  EXPECT_NEAR(f.b[2], b0, 1e-15);
  EXPECT_NEAR(f.a[1], 0, 1e-15);
  EXPECT_NEAR(f.a[2], (2 - std::sqrt(2.0)) * b0, 1e-15);
}

TEST(Butterworth, HasGainOneAtZeroHalfThePowerAtTheCutoffAndNothingAtHalfTheRate) {
  for (const double cutoff : {0.001, 0.02, 0.1, 0.3, 0.45}) {
    const SecondOrderFilter f = butterworth_low_pass(cutoff, 1);
    EXPECT_NEAR(gain(f, 0), 1, 1e-9) << cutoff;
    EXPECT_NEAR(gain(f, cutoff), std::sqrt(0.5), 1e-9) << cutoff;
    EXPECT_NEAR(gain(f, 0.5), 0, 1e-9) << cutoff;
  }
}

TEST(Butterworth, RejectsACutoffOutsideZeroToHalfTheRate) {
  for (const double cutoff : {0.0, -1.0, 0.5, 0.7, std::nan("")})
    EXPECT_THROW(butterworth_low_pass(cutoff, 1), std::invalid_argument) << cutoff;
  EXPECT_NO_THROW(butterworth_low_pass(0.4999, 1));
}

TEST(Filters, DoNotChangeAConstant) {
  const SecondOrderFilter f = butterworth_low_pass(0.03, 1);
  const std::vector<double> constant(50, -2.5);
  for (const auto& filtered : {filter_causal(f, constant), filter_zero_phase(f, constant)})
    expect_near(filtered, constant, 1e-11, "constant");
}

TEST(Filters, HaveNoDelayForwardAndBackwardAndADelayInOneDirection) {
  std::vector<double> pulse(401, 0);
  for (std::size_t k = 190; k <= 210; ++k) pulse[k] = 1;
  const SecondOrderFilter f = butterworth_low_pass(0.02, 1);
  const auto centre = [](const std::vector<double>& v) {
    double sum = 0, moment = 0;
    for (std::size_t k = 0; k < v.size(); ++k) {
      sum += v[k];
      moment += static_cast<double>(k) * v[k];
    }
    return moment / sum;
  };
  EXPECT_NEAR(centre(filter_zero_phase(f, pulse)), 200, 1e-6);
  // group delay at frequency 0: sqrt(2) / (2 pi 0.02) samples, prewarped: sqrt(2) / (2 tan(0.02 pi))
  EXPECT_NEAR(centre(filter_causal(f, pulse)), 200 + std::sqrt(2.0) / (2 * std::tan(0.02 * std::numbers::pi)), 1e-3);
}

TEST(Filters, RejectTooFewValuesAndNan) {
  const SecondOrderFilter f = butterworth_low_pass(0.1, 1);
  EXPECT_THROW(filter_zero_phase(f, std::vector<double>(9, 1)), std::invalid_argument);
  EXPECT_NO_THROW(filter_zero_phase(f, std::vector<double>(10, 1)));
  EXPECT_TRUE(filter_causal(f, {}).empty());
  std::vector<double> hole(20, 1);
  hole[7] = std::nan("");
  EXPECT_THROW(filter_causal(f, hole), std::invalid_argument);
  EXPECT_THROW(filter_zero_phase(f, hole), std::invalid_argument);
}

TEST(EvenStep, AcceptsOnePercentOfJitter) {
  auto t = evenly(100, 0.5);
  EXPECT_EQ(even_step_s(t), 0.5);
  t[50] += 0.0045;
  EXPECT_EQ(even_step_s(t), 0.5);
  t[50] += 0.001;
  EXPECT_THROW(even_step_s(t), std::invalid_argument);
  t = evenly(100, 0.5);
  t.erase(t.begin() + 30);
  EXPECT_THROW(even_step_s(t), std::invalid_argument) << "a lost sample";
  t = evenly(100, 0.5);
  t[10] = t[9];
  EXPECT_THROW(even_step_s(t), std::invalid_argument) << "time that stands still";
  EXPECT_THROW(even_step_s({}), std::invalid_argument);
  EXPECT_THROW(even_step_s(std::vector{1.0}), std::invalid_argument);
}

/// 100 s rest, 100 s at -6 A, 100 s rest, with a sensor 40 mA off.
Data rest_load_rest(double offset_a, double noise_a) {
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0, 1);
  Data data{evenly(300, 1), {}, std::vector<double>(300, 3.3), 6};
  for (std::size_t k = 0; k < 300; ++k)
    data.current_a.edit().push_back((k >= 100 && k < 200 ? -6.0 : 0.0) + offset_a + noise_a * noise(random));
  return data;
}

TEST(Offset, IsTheMeanOverTheRestsWithItsStandardDeviation) {
  const Offset exact = offset_at_rest(rest_load_rest(0.04, 0));
  EXPECT_NEAR(exact.current_a, 0.04, 1e-15);
  EXPECT_EQ(exact.samples, 192U);  // two at each end of two rests left out
  const Offset noisy = offset_at_rest(rest_load_rest(0.04, 0.02));
  EXPECT_NEAR(noisy.current_a, 0.04, 3 * noisy.current_std_a);
  EXPECT_NEAR(noisy.current_std_a, 0.02 / std::sqrt(192.0), 0.0003);
}

TEST(Offset, IgnoresAShortPauseALoadAndASmallCurrentAboveTheThreshold) {
  Data data = rest_load_rest(0.04, 0);
  for (std::size_t k = 0; k < 300; ++k) {
    if (data.current_a[k] > 0) data.current_a.edit()[k] = k < 280 ? 0.2 : 0.04;  // C/30; then 20 s of pause
  }
  const Offset offset = offset_at_rest(data);
  EXPECT_EQ(offset.samples, 0U);
  EXPECT_EQ(offset.current_a, 0);
}

TEST(Offset, ToleratesASpikeWithinARest) {
  Data data = rest_load_rest(0.04, 0);
  data.current_a.edit()[50] = 0.5;
  EXPECT_EQ(offset_at_rest(data).samples, 192U);
  EXPECT_NEAR(offset_at_rest(data).current_a, 0.04, 0.46 / 192 + 1e-12);
  data.capacity_ah = 0;
  EXPECT_THROW(offset_at_rest(data), std::invalid_argument);
}

TEST(Prefilter, SubtractsTheOffsetAndReportsIt) {
  const Data data = rest_load_rest(0.04, 0);
  const Prefiltered out = prefilter(data, {.cutoff_hz = 0.1});
  EXPECT_NEAR(out.offset.current_a, 0.04, 1e-15);
  EXPECT_NEAR(out.data.current_a[50], 0, 1e-6);
  EXPECT_NEAR(out.data.current_a[150], -6, 1e-6);
  EXPECT_EQ(out.data.voltage_v, data.voltage_v);
  EXPECT_EQ(out.data.time_s, data.time_s);
  const Prefiltered kept = prefilter(data, {.cutoff_hz = 0.1, .remove_offset = false});
  EXPECT_NEAR(kept.data.current_a[50], 0.04, 1e-6);
  EXPECT_EQ(kept.offset.samples, 0U);
}

TEST(Prefilter, CausalDelaysVoltageAndCurrentAlike) {
  Data data = rest_load_rest(0, 0);
  for (std::size_t k = 0; k < 300; ++k) data.voltage_v.edit()[k] = 3.3 + 0.01 * data.current_a[k];
  const Prefiltered out = prefilter(data, {.cutoff_hz = 0.05, .phase = Phase::causal});
  for (std::size_t k = 0; k < 300; ++k)
    ASSERT_NEAR(out.data.voltage_v[k], 3.3 + 0.01 * out.data.current_a[k], 1e-12) << k;
  EXPECT_GT(out.data.current_a[100], -3) << "late";
  data.voltage_v.edit()[3] = std::nan("");
  EXPECT_THROW(prefilter(data, {.phase = Phase::causal}), std::invalid_argument);
  EXPECT_NO_THROW(prefilter(data, {.phase = Phase::zero}));
}

TEST(Prefilter, RejectsUnevenSampling) {
  Data data = rest_load_rest(0, 0);
  data.time_s.edit()[200] += 0.3;
  try {
    prefilter(data, {});
    FAIL();
  } catch (const std::invalid_argument& refusal) {
    EXPECT_THAT(refusal.what(), testing::HasSubstr("uneven"));
  }
}

}  // namespace
}  // namespace bms::identification
