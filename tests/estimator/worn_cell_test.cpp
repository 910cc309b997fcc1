#include "tests/estimator/worn_cell.hpp"

#include <array>
#include <optional>

#include <gtest/gtest.h>

#include "model/extended.hpp"
#include "tests/estimator/duty.hpp"

namespace bms::estimator {
namespace {

constexpr int weeks = 4;
using Month = std::array<WeekFigures, weeks>;

/// Runs the month. capacity: how often and to what the estimator's capacity changed. switch_off: at the end of the
/// third week; the next estimator begins with what the firmware stores. stored: by the firmware before the month.
template <class Estimator>
struct WornCell {
  Month month{};
  Estimator estimator{starting_at(0.95, 0.02)};
  int changes = 0;

  template <class Cell>
  WornCell(const Cell& cell, double left, std::uint64_t seed, bool switch_off = false,
           const std::optional<measurement::StartingCapacity>& stored = std::nullopt) {
    constexpr int week_s = 7 * 86'400;
    if (stored) estimator.restore_capacity(*stored);
    OpportunityCharging world(left, seed);
    std::int32_t counted_ppm = 1'000'000;
    for (int k = 0; k < weeks * week_s; ++k) {
      if (switch_off && k == 3 * week_s) restart();
      const auto e = estimator.step(cell, world.sample(k));
      soc_ = arithmetic::as_double(e.soc);
      sigma_ = arithmetic::as_double(e.soc_sigma);
      const double error = soc_ - world.soc();
      WeekFigures& week = month[static_cast<std::size_t>(k / week_s)];
      week.rmse += error * error / week_s;
      week.largest = std::max(week.largest, std::abs(error));
      week.inside += (std::abs(error) <= 2 * sigma_ ? 1.0 : 0.0) / week_s;
      if (estimator.counted_capacity_ppm() != counted_ppm) ++changes;
      counted_ppm = estimator.counted_capacity_ppm();
    }
    for (WeekFigures& week : month) week.rmse = std::sqrt(week.rmse);
  }

  double capacity() const { return arithmetic::as_double(estimator.capacity().health().ratio); }
  double capacity_sigma() const { return arithmetic::as_double(estimator.capacity().health().sigma); }

 private:
  void restart() {
    const Health<typename Estimator::Scalar> found = estimator.capacity().health();
    estimator = Estimator(starting_at(soc_, sigma_));
    estimator.restore_capacity({arithmetic::to_micro(found.ratio), arithmetic::to_micro(found.sigma)});
  }

  double soc_ = 0, sigma_ = 0;
};

template <class S>
WornCell<SocEstimator<S>> worn_cell(double left, std::uint64_t seed, bool switch_off = false,
                                    const std::optional<measurement::StartingCapacity>& stored = std::nullopt) {
  return {tests::prepared<S>(cell_of_280_ah()), left, seed, switch_off, stored};
}

/// Without the estimate of the capacity: 3.9 % in every week, 57 % of the seconds inside two sigma.
template <class Worn>
void expect_good_after_a_week(const Worn& worn, double left) {
  EXPECT_NEAR(worn.capacity(), left, 3 * worn.capacity_sigma());
  EXPECT_LT(worn.capacity_sigma(), 0.02);
  for (std::size_t week = 1; week < weeks; ++week) {
    EXPECT_LT(worn.month[week].rmse, 0.01) << week;
    EXPECT_LT(worn.month[week].largest, 0.05) << week;
    EXPECT_GT(worn.month[week].inside, 0.88) << week;
  }
}

TEST(WornCell, IsCountedWithTheCapacityThatIsLeft) {
  for (const double left : {0.65, 0.78, 0.9}) {
    SCOPED_TRACE(left);
    for (const std::uint64_t seed : {1U, 2U}) expect_good_after_a_week(worn_cell<float>(left, seed), left);
  }
}

TEST(WornCell, IsCountedWithTheCapacityThatIsLeftInIntegers) {
  expect_good_after_a_week(worn_cell<arithmetic::FixedPoint>(0.78, 1), 0.78);
}

TEST(WornCell, IsWornAfterASwitchOff) {
  expect_good_after_a_week(worn_cell<float>(0.78, 1, true), 0.78);
  expect_good_after_a_week(worn_cell<arithmetic::FixedPoint>(0.78, 2, true), 0.78);
}

/// If no measurement that contradicts the estimate opened it: 1.3 to 3.4 %, 56 to 75 % inside two sigma.
template <class Worn>
void expect_another_capacity(const Worn& worn, double left) {
  EXPECT_NEAR(worn.capacity(), left, 0.03);
  for (std::size_t week = 2; week < weeks; ++week) {
    EXPECT_LT(worn.month[week].rmse, 0.01) << week;
    EXPECT_GT(worn.month[week].inside, 0.85) << week;
  }
}

TEST(WornCell, OfAReplacedBatteryIsFoundInTwoWeeks) {
  const measurement::StartingCapacity of_the_old_one{780'000, 6'000};
  for (const double left : {0.65, 1.0}) {
    SCOPED_TRACE(left);
    expect_another_capacity(worn_cell<float>(left, 1, false, of_the_old_one), left);
    expect_another_capacity(worn_cell<arithmetic::FixedPoint>(left, 2, false, of_the_old_one), left);
  }
}

TEST(WornCell, HealthyItKeepsTheCapacityOfTheFile) {
  for (const std::uint64_t seed : {1U, 2U, 3U, 4U, 5U, 6U}) {
    const auto healthy = worn_cell<float>(1, seed);
    EXPECT_EQ(healthy.changes, 0) << "no estimate differs from those without a capacity, seed " << seed;
    EXPECT_NEAR(healthy.capacity(), 1, 0.02) << seed;
  }
}

/// An offset that lasts for hours makes each measurement of the capacity less certain: it takes weeks.
TEST(WornCell, WithErrorsAsStatesItsErrorShrinksByHalf) {
  using Laws = model::ChosenLaws<float>;
  model::CellParameters<> parameters = cell_of_280_ah();
  parameters.noise.current_offset_a *= 3;
  parameters.noise.current_offset_correlation_s = 36'000;
  parameters.noise.model_correlation_s = 3'000;
  const model::ExtendedCell<float, model::max_intervals, Laws> cell{tests::prepared<float>(parameters), {}};
  for (const std::uint64_t seed : {1U, 2U}) {
    const WornCell<WithErrors<Laws>> worn(cell, 0.78, seed);
    EXPECT_LT(worn.month[3].rmse, 0.5 * worn.month[0].rmse) << seed;
    EXPECT_GT(worn.month[3].inside, 0.93) << seed;
  }
}

}  // namespace
}  // namespace bms::estimator
