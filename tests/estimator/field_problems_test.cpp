// Problems that users of battery monitors report, each as a test named after the report. The cell is the plant's.
#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <vector>

#include <gtest/gtest.h>

#include "estimator/restart.hpp"
#include "estimator/soc_estimator.hpp"
#include "plant/random.hpp"
#include "plant/truth_cell.hpp"
#include "tests/cells.hpp"
#include "tests/starting_point.hpp"

namespace bms::estimator {
namespace {

std::int32_t micro(double x) { return static_cast<std::int32_t>(std::lround(1e6 * x)); }

StoredEstimate stored(double soc, double sigma) {
  const measurement::StartingPoint known = starting_at(soc, sigma);
  return {known.soc_ppb, known.soc_sigma_ppb};
}

/// A cell at work with its estimator.
struct Truck {
  explicit Truck(double soc, std::optional<measurement::StartingPoint> start = {})
      : cell({}, {.soc = soc, .v_rc_v = 0, .temperature_c = 25}),
        estimator(start ? SocEstimator<float>(*start) : SocEstimator<float>()) {}

  /// One second; spoil: what becomes of the sample on its way.
  void second(double current_a, const std::function<void(measurement::Sample&)>& spoil = {}) {
    cell.run(current_a, 25, 1);
    time_us += 1'000'000;
    measurement::Sample s{time_us, micro(current_a + 0.01 * random.normal()),
                          micro(cell.voltage_v() + 0.001 * random.normal()), 2'500};
    if (spoil) spoil(s);
    estimate = estimator.step(tables, s);
  }
  /// An hour of lifting and driving, with 0.3C of mean load.
  /// 40 s of driving, 20 s of charging, a minute of rest.
  double load(int k) {
    if (k % 120 < 40) return -6 * (0.5 + random.uniform());
    return k % 120 < 60 ? 3 : 0;
  }
  void hour(const std::function<void(measurement::Sample&)>& spoil = {}) {
    for (int k = 0; k < 3'600; ++k) second(load(k), spoil);
  }
  double error() const { return estimate.soc - cell.soc(); }

  plant::Cell cell;
  model::Cell<float, model::max_intervals> tables = tests::prepared<float>();
  SocEstimator<float> estimator;
  Estimate<float> estimate;
  plant::Random random{7};
  std::uint64_t time_us = 0;
};

TEST(Complaint, SmallCurrentsOverDaysAreNotCounted) {
  Truck truck(0.6, starting_at(0.6, 0.01));
  for (int k = 0; k < 4 * 86'400; ++k)
    truck.second(-0.012);  // a display that is left on: 19 % of the charge in four days
  EXPECT_NEAR(truck.cell.soc(), 0.408, 0.001);
  EXPECT_NEAR(truck.error(), 0, 0.02);
}

TEST(Complaint, AfterARebootInTheMiddleOfACharge) {
  Truck before(0.3, starting_at(0.3, 0.01));
  for (int k = 0; k < 3'600; ++k) before.second(1.8);
  const StoredEstimate last{static_cast<std::int32_t>(1e9F * before.estimate.soc),
                            static_cast<std::int32_t>(1e9F * before.estimate.soc_sigma)};
  Truck after(before.cell.soc(), starting_point_after_off_time(last, 30));
  after.second(1.8);  // under current from the first sample on
  EXPECT_NEAR(after.error(), 0, 0.01) << "not read from a voltage that the charger lifts";
  for (int k = 0; k < 600; ++k) after.second(1.8);
  EXPECT_NEAR(after.error(), 0, 0.01);
}

TEST(Complaint, AfterANightWithoutAClockALotIsMissing) {
  const measurement::StartingPoint morning = starting_point_after_off_time(stored(0.5, 0.005), std::nullopt);
  EXPECT_NEAR(1e-9 * morning.soc_ppb, 0.5, 0.02);
  EXPECT_LT(1e-9 * morning.soc_sigma_ppb, 0.08);
  EXPECT_GE(2e-9 * morning.soc_sigma_ppb,
            0.5 - 1e-9 * starting_point_after_off_time(stored(0.5, 0.005), 60U * 86'400).soc_ppb)
      << "two months without power stay within two sigma";
}

TEST(Complaint, AfterAWinterInStorageItIsAsSureAsBefore) {
  const measurement::StartingPoint spring = starting_point_after_off_time(stored(0.5, 0.005), 120U * 86'400);
  Truck truck(0.3, spring);  // more was lost than thought
  truck.second(0);
  EXPECT_LE(std::abs(truck.error()), 2 * truck.estimate.soc_sigma);
  EXPECT_GT(truck.estimate.soc_sigma, 0.03);
}

TEST(Complaint, TheSocIsNoLongerUpdatedAndNothingReportsIt) {
  Truck truck(0.7, starting_at(0.7, 0.005));
  truck.hour();
  truck.time_us += 3'600'000'000;  // the task hung for an hour
  truck.cell.run(-3, 25, 3'600);
  truck.second(-3, [](measurement::Sample& s) { s.voltage_uv = measurement::no_reading; });
  EXPECT_NE(truck.estimate.flags & time_gap, 0U);
  EXPECT_LE(std::abs(truck.error()), 2 * truck.estimate.soc_sigma);
}

TEST(Complaint, ASensorsOffsetOfHalfAPercentOf1C) {
  for (const double offset_a : {-0.03, 0.03}) {
    Truck truck(0.95, starting_at(0.95, 0.01));
    for (int h = 0; h < 3; ++h) truck.hour([&](measurement::Sample& s) { s.current_ua += micro(offset_a); });
    EXPECT_NEAR(truck.error(), 0, 0.02) << offset_a;
    EXPECT_LE(std::abs(truck.error()), 2 * truck.estimate.soc_sigma) << offset_a;
  }
}

TEST(Complaint, ASensorsGainOfOnePercent) {
  for (const double gain : {0.99, 1.01}) {
    Truck truck(0.95, starting_at(0.95, 0.01));
    for (int h = 0; h < 3; ++h)
      truck.hour([&](measurement::Sample& s) { s.current_ua = static_cast<std::int32_t>(gain * s.current_ua); });
    EXPECT_NEAR(truck.error(), 0, 0.02) << gain;
  }
}

TEST(Complaint, AWrongStartIsNeverCorrected) {
  for (const double wrong : {0.25, -0.25}) {
    Truck truck(0.65, starting_at(0.65 + wrong, 0.25));
    for (int k = 0; k < 3'600 * 2; ++k) {
      truck.second(truck.load(k));
      ASSERT_LE(std::abs(truck.error()), 2 * truck.estimate.soc_sigma) << "second " << k;
    }
    EXPECT_NEAR(truck.error(), 0, 0.02) << "the SOC has crossed two knees";
  }
}

TEST(Complaint, TheTemperatureSensorIsLost) {
  Truck truck(0.8, starting_at(0.8, 0.01));
  truck.hour([](measurement::Sample& s) { s.temperature_cdegc = measurement::no_temperature; });
  EXPECT_NEAR(truck.error(), 0, 0.01);
}

TEST(Complaint, TheSignOfTheCurrentIsLost) {
  Truck truck(0.8, starting_at(0.8, 0.01));
  double worst = 0;
  std::uint32_t flags = 0;
  for (int h = 0; h < 3; ++h) {
    truck.hour([](measurement::Sample& s) { s.current_ua = -s.current_ua; });
    worst = std::max(worst, std::abs(truck.error()));
    flags |= truck.estimate.flags;
  }
  EXPECT_NE(flags & (voltage_rejected | soc_ambiguous), 0U) << "the voltage contradicts, and it is said";
}

/// A log with a row every row_s seconds.
struct Log {
  Log(double capacity_ah, double soc, double row, bool last)
      : cell({.capacity_ah = capacity_ah}, {.soc = soc, .v_rc_v = 0, .temperature_c = 25}),
        row_s(row),
        last_value(last),
        estimator(starting_at(soc, 0.01)) {}

  /// One row. load_a(): the current of the next second. last_value: the row has the last current instead of the mean.
  template <class Load>
  void row(Load&& load_a) {
    double sum_as = 0, current_a = 0;
    for (int k = 0; k < static_cast<int>(row_s); ++k) {
      current_a = load_a();
      cell.run(current_a, 25, 1);
      sum_as += current_a;
    }
    time_us += static_cast<std::uint64_t>(1e6 * row_s);
    estimate = estimator.step(
        tables, {time_us, micro(last_value ? current_a : sum_as / row_s), micro(cell.voltage_v()), 2'500});
  }
  double error() const { return estimate.soc - cell.soc(); }

  plant::Cell cell;
  double row_s;
  bool last_value;
  model::Cell<float, model::max_intervals> tables = tests::prepared<float>();
  SocEstimator<float> estimator;
  Estimate<float> estimate;
  std::uint64_t time_us = 0;
};

TEST(Complaint, AnEmptyCellReadsAQuarterFullInALogOfFewRows) {
  for (const double row_s : {1.0, 5.0, 10.0, 30.0, 60.0}) {
    for (const bool last_value : {false, true}) {
      Log log(0.72 * 6, 1, row_s, last_value);  // 28 % less than its file
      while (log.cell.soc() > 0.02) log.row([] { return -3.0; });
      for (double rested_s = 0; rested_s < 900; rested_s += row_s) log.row([] { return 0.0; });
      EXPECT_LT(log.estimate.soc, 0.05) << row_s << ", last " << last_value;
    }
  }
}

TEST(Complaint, ALogOfEveryTenthCurrentIsCountedAsIfItWereAll) {
  int inside = 0, rows = 0;
  for (const std::uint64_t seed : {1U, 2U, 3U, 4U, 5U, 6U, 7U, 8U}) {
    plant::Random random{seed};
    Log log(6, 0.6, 10, true);
    for (; log.time_us < 7'200'000'000; ++rows) {
      log.row([&] { return random.uniform() < 0.5 ? -6.0 : 6.0; });
      inside += std::abs(log.error()) <= 2 * log.estimate.soc_sigma ? 1 : 0;
    }
  }
  EXPECT_GT(inside, 0.9 * rows);
}

TEST(Complaint, AConstantLoadHidesNothingBetweenRareRows) {
  double sigma[2];
  for (const int rare : {0, 1}) {
    Log log(6, 0.6, rare != 0 ? 60 : 1, true);
    while (log.time_us < 3'600'000'000) log.row([] { return -1.0; });
    sigma[rare] = log.estimate.soc_sigma;
  }
  EXPECT_NEAR(sigma[1], sigma[0], 0.2 * sigma[0]);
}

}  // namespace
}  // namespace bms::estimator
