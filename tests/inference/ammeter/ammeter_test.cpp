// The current sensor from a log: shifts of the plant (which shares nothing with the model) with errors added to the
// current that its instruments read.
#include "ammeter/ammeter.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "experiments/experiment.hpp"
#include "tests/truth/forklift_shift.hpp"

namespace bms::ammeter {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

struct SensorErrors {
  double offset_a = 0, gain = 0, dead_band_a = 0, largest_a = 1e9;

  double reading(double current_a) const {
    const double a = std::abs(current_a) < dead_band_a ? 0 : (1 + gain) * current_a + offset_a;
    return std::clamp(a, -largest_a, largest_a);
  }
};

/// Eight hours. The instruments have their own drift (15 mA) and gain error (0.2 %).
measurement::Recording shift(const SensorErrors& errors, std::uint64_t seed, double capacity_ah = 6,
                             double step_s = 10) {
  plant::Cell cell({.capacity_ah = capacity_ah}, {.soc = 0.97, .v_rc_v = 0, .temperature_c = 20});
  plant::Instruments instruments({}, seed);
  const auto profile =
      experiments::experiment("forklift_shift", {.capacity_ah = 6, .seed = seed, .step_s = step_s}).value();
  measurement::Recording r;
  for (const plant::RecordedRow& row : plant::record(profile, cell, instruments, {.start_c = 20, .end_c = 20})) {
    r.time_s.edit().push_back(row.time_s);
    r.current_a.edit().push_back(errors.reading(row.current_a));
    r.voltage_v.edit().push_back(row.voltage_v);
    r.temperature_c.edit().push_back(row.temperature_c);
  }
  return r;
}

const files::CellFile& table9() {
  static const files::CellFile cell = files::read_cell("table9");
  return cell;
}

TEST(Ammeter, TheOffsetIsFoundWithinItsUncertainty) {
  double squares = 0;
  int count = 0;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    for (const double offset_a : {-0.25, 0.0, 0.08}) {
      const Ammeter a = examine_ammeter(shift({.offset_a = offset_a}, seed), table9(), {});
      ASSERT_TRUE(a.balance_a.value) << a.balance_a.why;
      const double error_a = a.balance_a.value->value - offset_a, std_a = a.balance_a.value->std;
      EXPECT_LT(std_a, 0.04) << "of use: less than one hundredth of 1C";
      EXPECT_LT(std::abs(error_a), 3 * std::hypot(std_a, 0.015)) << offset_a << ", seed " << seed;
      squares += error_a * error_a / (std_a * std_a);
      ++count;
    }
  }
  EXPECT_LT(std::sqrt(squares / count), 1.5) << "the standard deviations hold";
}

TEST(Ammeter, TheGainNeedsAnIndependentCapacity) {
  const auto log = shift({.gain = 0.03}, 1);
  const Ammeter without = examine_ammeter(log, table9(), {});
  EXPECT_FALSE(without.gain.value);
  EXPECT_THAT(without.gain.why, HasSubstr("not visible here"));
  const Ammeter with = examine_ammeter(log, table9(), 0.005);
  ASSERT_TRUE(with.gain.value) << with.gain.why;
  EXPECT_NEAR(with.gain.value->value, 0.03, 2.5 * with.gain.value->std);
  EXPECT_LT(with.gain.value->std, 0.02);
  // a cell of 3 % more capacity looks the same
  const Ammeter larger = examine_ammeter(shift({}, 1, 6 / 1.03), table9(), {});
  EXPECT_FALSE(larger.gain.value);
}

TEST(Ammeter, AnotherCellIsNotAnOffset) {
  auto log = shift({}, 1);
  for (double& v : log.voltage_v.edit()) v += 0.06;
  const Ammeter a = examine_ammeter(log, table9(), {});
  EXPECT_FALSE(a.balance_a.value) << a.residual_v.value_or(0);
  EXPECT_THAT(a.balance_a.why, HasSubstr("does not describe this log"));
}

TEST(Ammeter, ClippingIsFoundByTheVoltage) {
  const auto clean = shift({}, 2, 6, 1);
  const double largest_a = std::abs(*std::min_element(clean.current_a.begin(), clean.current_a.end()));
  const Ammeter clipped = examine_ammeter(shift({.largest_a = 0.6 * largest_a}, 2, 6, 1), table9(), {});
  ASSERT_TRUE(clipped.clipping_a.value) << clipped.clipping_a.why;
  EXPECT_NEAR(clipped.clipping_a.value->value, -0.6 * largest_a, 0.01 * largest_a);
  EXPECT_LT(clipped.missed_a, 0) << "more discharge than read";
  EXPECT_FALSE(clipped.balance_a.value) << "the charge beyond is missing";
  EXPECT_FALSE(examine_ammeter(clean, table9(), {}).clipping_a.value);
}

TEST(Ammeter, ConstantPulsesOfACellWithAnotherResistanceAreNotClipped) {
  auto log = shift({}, 2, 6, 1);
  for (std::size_t k = 0; k < log.rows(); ++k) {
    if (k % 600 >= 60) continue;
    log.voltage_v.edit()[k] -= 0.03 * (8 + log.current_a[k]);
    log.current_a.edit()[k] = -8;
  }
  const Ammeter a = examine_ammeter(log, table9(), {});
  EXPECT_FALSE(a.clipping_a.value) << a.clipping_a.why;
}

TEST(Ammeter, ASlowConstantDischargeIsNotAnOffset) {
  measurement::Recording r;
  for (int k = 0; k < 3'000; ++k) {
    r.time_s.edit().push_back(10.0 * k);
    r.current_a.edit().push_back(-0.3 + 0.002 * (k % 3 - 1));
    r.voltage_v.edit().push_back(3.0 + 0.2 * (k / 300 % 2));  // no cell file describes it
  }
  const Ammeter a = examine_ammeter(r, table9(), {});
  EXPECT_FALSE(a.offset_a.value);
  EXPECT_THAT(a.offset_a.why, HasSubstr("no reading is a load, so a small constant current looks like an offset"));
}

/// Three rests of ten minutes between loads; rest_a: what is read then.
measurement::Recording with_rests(const std::vector<double>& rest_a) {
  measurement::Recording r;
  for (std::size_t rest = 0; rest < rest_a.size(); ++rest) {
    for (int k = 0; k < 1'200; ++k) {
      r.time_s.edit().push_back(static_cast<double>(r.rows()));
      r.current_a.edit().push_back(k < 600 ? rest_a[rest] + 0.002 * (k % 3 - 1) : -2.0 - 0.01 * (k % 50));
      r.voltage_v.edit().push_back(3.0 + 0.01 * (k % 7));  // no cell file describes it
    }
  }
  return r;
}

TEST(Ammeter, TheReadingAtRestIsTheOffsetIfNoCurrentFlowsThen) {
  const Ammeter a = examine_ammeter(with_rests({-0.10, -0.11, -0.09}), table9(), {});
  ASSERT_TRUE(a.offset_a.value) << a.offset_a.why;
  EXPECT_NEAR(a.offset_a.value->value, -0.1, 2 * a.offset_a.value->std);
  EXPECT_GE(a.offset_a.value->std, 0.01) << "it drifts between the rests";
  EXPECT_THAT(a.offset_a.why, HasSubstr("if no current flows during the 30 minutes of rest"));
}

TEST(Ammeter, RestsThatDifferAreLoadsAndExactZerosProveNothing) {
  const Ammeter loads = examine_ammeter(with_rests({-0.02, -0.3, -0.02}), table9(), {});
  EXPECT_FALSE(loads.offset_a.value);
  EXPECT_THAT(loads.offset_a.why, HasSubstr("a load is connected at some rests"));
  auto zeros = with_rests({0, 0, 0});
  for (double& a : zeros.current_a.edit()) a = std::abs(a) < 0.01 ? 0 : a;
  const Ammeter zero = examine_ammeter(zeros, table9(), {});
  EXPECT_FALSE(zero.offset_a.value);
  EXPECT_THAT(zero.offset_a.why, HasSubstr("exactly 0"));
}

/// Of a cell that loses leak_a: what the sensor reads, and the voltage of the cell at the current less the leakage.
measurement::Recording leaking_shift(double leak_a) {
  plant::Cell cell({.capacity_ah = 6}, {.soc = 0.97, .v_rc_v = 0, .temperature_c = 20});
  plant::Instruments instruments({}, 3);
  auto profile = experiments::experiment("forklift_shift", {.capacity_ah = 6, .seed = 3, .step_s = 10}).value();
  for (experiments::ProfileRow& row : profile) row.current_a -= leak_a;
  measurement::Recording r;
  for (const plant::RecordedRow& row : plant::record(profile, cell, instruments, {.start_c = 20, .end_c = 20})) {
    r.time_s.edit().push_back(row.time_s);
    r.current_a.edit().push_back(row.current_a + leak_a);
    r.voltage_v.edit().push_back(row.voltage_v);
    r.temperature_c.edit().push_back(row.temperature_c);
  }
  return r;
}

/// Ten minutes of a sensor while no current flows.
measurement::Recording open_contactors(double offset_a) {
  measurement::Recording r;
  for (int k = 0; k < 600; ++k) {
    r.time_s.edit().push_back(k);
    r.current_a.edit().push_back(offset_a + 0.002 * (k % 3 - 1));
  }
  return r;
}

TEST(Ammeter, ALeakageOfTheCellIsNotCorrectedAtTheSensor) {
  const auto log = leaking_shift(0.3);
  const Ammeter alone = examine_ammeter(log, table9(), {});
  ASSERT_TRUE(alone.balance_a.value) << alone.balance_a.why;
  EXPECT_NEAR(alone.balance_a.value->value, 0.3, 3 * std::hypot(alone.balance_a.value->std, 0.015));
  EXPECT_NE(balance_of(alone), Balance::by_sensor);
  EXPECT_TRUE(correction_of(alone).empty()) << "it would hide the leakage";
  const auto open = open_contactors(0.01);
  const Ammeter with_open = examine_ammeter(log, table9(), {}, &open);
  EXPECT_EQ(balance_of(with_open), Balance::by_cell);
  EXPECT_NEAR(correction_of(with_open).offset_a, -0.01, 1e-3) << "its own offset only";
}

TEST(Ammeter, AnOffsetIsCorrectedOnceTheSensorIsReadWithoutCurrent) {
  const auto open = open_contactors(0.3);
  const Ammeter a = examine_ammeter(shift({.offset_a = 0.3}, 3), table9(), {}, &open);
  EXPECT_EQ(balance_of(a), Balance::by_sensor) << a.balance_a.why;
  EXPECT_NEAR(correction_of(a).offset_a, -0.3, 1e-3);
  EXPECT_TRUE(a.open_contactors);
  const auto zeros = open_contactors(0);
  auto exact = zeros;
  for (double& reading : exact.current_a.edit()) reading = 0;
  const Ammeter written = examine_ammeter(shift({.offset_a = 0.3}, 3), table9(), {}, &exact);
  EXPECT_EQ(balance_of(written), Balance::undecided) << "a device may write zeros by itself";
  EXPECT_TRUE(correction_of(written).empty());
}

TEST(Ammeter, ABalanceAloneCorrectsNothing) {
  Ammeter a;
  for (const double balance_a : {0.3, -0.3}) {
    a.balance_a.value = Uncertain{balance_a, 0.05};
    a.offset_a.value.reset();
    EXPECT_EQ(balance_of(a), Balance::undecided);
    EXPECT_TRUE(correction_of(a).empty());
    a.offset_a.value = Uncertain{balance_a, 0.01};
    EXPECT_EQ(balance_of(a), Balance::by_sensor);
    EXPECT_NEAR(correction_of(a).offset_a, -balance_a, 1e-12);
    a.offset_a.value = Uncertain{0.001, 0.01};
    EXPECT_EQ(balance_of(a), Balance::by_cell);
    EXPECT_TRUE(correction_of(a).empty());
    a.offset_a.value = Uncertain{-balance_a, 0.01};
    EXPECT_EQ(balance_of(a), Balance::undecided) << "a load is connected at rest, or both have errors";
    EXPECT_TRUE(correction_of(a).empty());
  }
  a.balance_a.value = Uncertain{0.05, 0.05};
  EXPECT_EQ(balance_of(a), Balance::balanced);
}

/// Ten minutes of slow triangles from -20 to 20 A with a trusted meter.
measurement::Recording meter_check(const SensorErrors& errors) {
  measurement::Recording r;
  for (int k = 0; k < 6'000; ++k) {
    const double a = 40 * std::abs(std::fmod(k / 1'500.0, 2) - 1) - 20 + 1e-4 * (k % 7);
    r.time_s.edit().push_back(0.1 * k);
    r.current_ref_a.edit().push_back(a);
    r.current_a.edit().push_back(errors.reading(a));
    r.voltage_v.edit().push_back(3.3);
  }
  return r;
}

TEST(Ammeter, AMeterShowsOffsetAndGain) {
  const Ammeter a = examine_ammeter(meter_check({.offset_a = -0.3, .gain = 0.02}), table9(), {});
  EXPECT_TRUE(a.by_reference);
  EXPECT_NEAR(a.offset_a.value->value, -0.3, 1e-3);
  EXPECT_NEAR(a.gain.value->value, 0.02, 1e-4);
  EXPECT_FALSE(a.clipping_a.value);
  const AmmeterCorrection c = correction_of(a);
  EXPECT_NEAR(c.of(SensorErrors{.offset_a = -0.3, .gain = 0.02}.reading(12)), 12, 1e-2);
}

TEST(Ammeter, AMeterShowsDeadBandAndClipping) {
  const Ammeter a = examine_ammeter(meter_check({.dead_band_a = 0.5, .largest_a = 15}), table9(), {});
  ASSERT_TRUE(a.dead_band_a.value) << a.dead_band_a.why;
  EXPECT_NEAR(a.dead_band_a.value->value, 0.5, 4 * a.dead_band_a.value->std + 0.01);
  ASSERT_TRUE(a.clipping_a.value) << a.clipping_a.why;
  EXPECT_NEAR(std::abs(a.clipping_a.value->value), 15, 0.01);
  EXPECT_NEAR(a.gain.value->value, 0, 2e-3) << "clipped readings do not count";
  EXPECT_FALSE(examine_ammeter(meter_check({}), table9(), {}).dead_band_a.value);
}

TEST(Ammeter, ClippingThatTheScatterHidesIsNotDenied) {
  auto log = meter_check({.largest_a = 15});
  for (std::size_t k = 0; k < log.rows(); ++k) log.current_ref_a.edit()[k] += k % 2 == 0 ? 3 : -3;
  const Ammeter a = examine_ammeter(log, table9(), {});
  EXPECT_FALSE(a.clipping_a.value);
  EXPECT_THAT(a.clipping_a.why, HasSubstr("not visible here: up to 6"));
  EXPECT_THAT(a.clipping_a.why, HasSubstr("A beyond 15 A would not show"));
}

TEST(Ammeter, ReadingsThatStayAtTheLargestWithoutMoreCurrentAreNotClipped) {
  auto log = meter_check({});
  for (std::size_t k = 0; k < log.rows(); ++k)
    log.current_ref_a.edit()[k] = log.current_a.edit()[k] = std::clamp(log.current_ref_a[k], -15.0, 15.0);
  EXPECT_THAT(examine_ammeter(log, table9(), {}).clipping_a.why, StartsWith("none: "));
}

TEST(Ammeter, ADeadBandBelowTheUncertaintyLeavesTheOffset) {
  auto fine = shift({}, 2, 6, 1);  // readings in fine steps, so that a narrow dead band shows
  for (std::size_t k = 0; k < fine.rows(); ++k) {
    const double a = fine.current_a[k] + 0.0025 * std::sin(static_cast<double>(k * k));
    fine.current_a.edit()[k] = std::abs(a) < 0.012 ? 0 : a;
  }
  const Ammeter a = examine_ammeter(fine, table9(), {});
  ASSERT_TRUE(a.dead_band_a.value) << a.dead_band_a.why;
  ASSERT_TRUE(a.balance_a.value) << a.balance_a.why;
  EXPECT_GT(a.balance_a.value->std, a.dead_band_a.value->value);
  EXPECT_NEAR(a.balance_a.value->value, 0, 3 * std::hypot(a.balance_a.value->std, 0.015));
  const Ammeter wide = examine_ammeter(shift({.dead_band_a = 0.5}, 2, 6, 1), table9(), {});
  ASSERT_TRUE(wide.dead_band_a.value) << wide.dead_band_a.why;
  EXPECT_FALSE(wide.balance_a.value);
  EXPECT_THAT(wide.balance_a.why, HasSubstr("the charge of currents in the dead band may be missing in the count"));
}

}  // namespace
}  // namespace bms::ammeter
