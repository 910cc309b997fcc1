#include "estimator/cell_differences.hpp"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "estimator/soc_estimator.hpp"
#include "plant/random.hpp"
#include "plant/truth_cell.hpp"
#include "tests/cells.hpp"
#include "tests/starting_point.hpp"

namespace bms::estimator {
namespace {

constexpr std::size_t cells = 16;

/// Sixteen cells of the plant in series, each with its own soc, capacity and resistance, and their estimators.
template <class S>
struct Pack {
  explicit Pack(double weak_by = 0) {
    for (std::size_t k = 0; k < cells; ++k) {
      const double off = k == 5 ? -weak_by : 0.01 * random.normal();
      truth.emplace_back(plant::CellParameters{.capacity_ah = 6 * (1 + 0.005 * random.normal())},
                         plant::CellState{.soc = 0.88 + off, .v_rc_v = 0, .temperature_c = 25});
      more_ohm.push_back(0.0013 * random.normal());
    }
  }

  void second(double current_a, std::size_t missing = cells) {
    typename CellDifferences<S, cells>::Observation observation;
    double sum = 0;
    for (std::size_t k = 0; k < cells; ++k) {
      truth[k].run(current_a, 25, 1);
      const double v = truth[k].voltage_v() + more_ohm[k] * current_a + 0.001 * random.normal();
      sum += v;
      observation.voltage_v[k] = arithmetic::Voltage<S>(v);
      observation.usable[k] = k != missing;
    }
    time_us += 1'000'000;
    const double read_a = current_a + 0.01 * random.normal();
    const auto e = mean.step(tables, {time_us, static_cast<std::int32_t>(1e6 * read_a),
                                      static_cast<std::int32_t>(1e6 * sum / cells), 2'500});
    differences.step(tables, e.soc, e.soc_sigma, arithmetic::Current<S>(read_a), arithmetic::Soc<S>(read_a / 21'600),
                     arithmetic::Count<S>(60), observation);
  }
  double mean_soc() const {
    double sum = 0;
    for (const auto& c : truth) sum += c.soc();
    return sum / cells;
  }
  double error(std::size_t k) const {
    return arithmetic::as_double(differences[k].soc()) - (truth[k].soc() - mean_soc());
  }
  static double load(int k) {
    if (k % 100 < 50) return -6;
    return k % 100 < 60 ? 4 : 0;
  }
  void hours(double h) {
    for (int k = 0; k < static_cast<int>(h * 3'600); ++k) second(load(k));
  }

  plant::Random random{3};
  std::vector<plant::Cell> truth;
  std::vector<double> more_ohm;
  model::Cell<S, model::max_intervals> tables = tests::prepared<S>();
  SocEstimator<S> mean{starting_at(0.88, 0.01)};
  CellDifferences<S, cells> differences;
  std::uint64_t time_us = 0;
};

TEST(CellDifferences, TakeTwentyBytesACell) { EXPECT_LE(sizeof(CellDifference<float>), 24U); }

template <class Scalar>
class CellDifferencesOfEveryScalar : public ::testing::Test {};
using Scalars = ::testing::Types<float, double, arithmetic::FixedPoint>;
TYPED_TEST_SUITE(CellDifferencesOfEveryScalar, Scalars);

TYPED_TEST(CellDifferencesOfEveryScalar, AreFoundWhereTheCurveIsSteepAndHonestWhereItIsNot) {
  Pack<TypeParam> pack;
  for (int part = 0; part < 8; ++part) {
    pack.hours(0.18);
    for (std::size_t k = 0; k < cells; ++k) {
      ASSERT_LE(std::abs(pack.error(k)), 3 * arithmetic::as_double(pack.differences[k].soc_sigma()))
          << "cell " << k << " at " << pack.mean_soc();
    }
  }
  for (std::size_t k = 0; k < cells; ++k) {
    EXPECT_LE(std::abs(pack.error(k)), 0.01) << k << " at " << pack.mean_soc();
    EXPECT_NEAR(arithmetic::as_double(pack.differences[k].resistance()), pack.more_ohm[k] / 0.0215, 0.03) << k;
  }
}

TYPED_TEST(CellDifferencesOfEveryScalar, FindTheWeakestCell) {
  Pack<TypeParam> pack(0.08);
  pack.hours(1.2);
  std::size_t weakest = 0;
  for (std::size_t k = 0; k < cells; ++k) {
    if (pack.differences[k].soc() < pack.differences[weakest].soc()) weakest = k;
  }
  EXPECT_EQ(weakest, 5U);
  EXPECT_NEAR(arithmetic::as_double(pack.differences[5].soc()), pack.truth[5].soc() - pack.mean_soc(), 0.015);
}

TEST(CellDifferences, ACellWithoutReadingsBecomesUncertain) {
  Pack<double> pack;
  pack.hours(0.5);
  const double before = pack.differences[3].soc_sigma();
  for (int k = 0; k < 1'800; ++k) pack.second(-3, 3);
  EXPECT_GT(pack.differences[3].soc_sigma(), before);
  EXPECT_LE(std::abs(pack.error(3)), 3 * pack.differences[3].soc_sigma());
}

}  // namespace
}  // namespace bms::estimator
