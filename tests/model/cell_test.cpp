#include "model/cell.hpp"

#include <ceres/jet.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "tests/cells.hpp"

namespace bms::model {
namespace {

template <class Scalar>
class CellOfEveryScalar : public ::testing::Test {};
using Scalars = ::testing::Types<float, double, FixedPoint>;
TYPED_TEST_SUITE(CellOfEveryScalar, Scalars);

// the eleven knots follow from the ten lines of Table 9 by hand: b0 + b1 soc
constexpr double knot_v[] = {2.871, 3.206, 3.245, 3.277, 3.285, 3.286, 3.290, 3.313, 3.322, 3.323, 3.456};

TYPED_TEST(CellOfEveryScalar, JoinsTheKnotsOfTable9ByStraightLinesWithin1mV) {
  const auto cell = tests::prepared<TypeParam>();
  for (std::size_t k = 0; k < 10; ++k) {
    for (const double t : {0.02, 0.5, 0.98}) {
      const auto at = look_up(cell, Soc<TypeParam>((static_cast<double>(k) + t) / 10));
      EXPECT_NEAR(as_double(at.ocv_v), knot_v[k] + t * (knot_v[k + 1] - knot_v[k]), 1e-3) << "interval " << k;
    }
  }
}

TYPED_TEST(CellOfEveryScalar, InterpolatesResistancesBetweenNodesAndHoldsThemBelowTheFirst) {
  const auto cell = tests::prepared<TypeParam>();
  const auto at = [&](double soc) { return look_up(cell, Soc<TypeParam>(soc)); };
  EXPECT_NEAR(as_double(at(0.35).r0_ohm), (0.0133872 + 0.0132749) / 2, 1e-8);
  EXPECT_NEAR(as_double(at(0.35).r1_ohm), (0.00998571 + 0.009014) / 2, 1e-8);
  EXPECT_NEAR(as_double(at(0.35).c1_f), (1109.31 + 1249.35) / 2, 1e-3);
  EXPECT_NEAR(as_double(at(0.02).r1_ohm), 0.027101, 1e-8);
  EXPECT_NEAR(as_double(at(-0.1).c1_f), 420.558, 1e-3);
  EXPECT_NEAR(as_double(at(1.1).r0_ohm), 0.0153566, 1e-8);
  EXPECT_EQ(as_double(at(0.05).r1_delta_ohm), 0);
}

TYPED_TEST(CellOfEveryScalar, GoesOnAlongTheEndLinesOutside) {
  const auto cell = tests::prepared<TypeParam>();
  EXPECT_NEAR(as_double(look_up(cell, Soc<TypeParam>(-0.2)).ocv_v), 2.871 - 0.2 * 3.35, 1e-6);
  EXPECT_NEAR(as_double(look_up(cell, Soc<TypeParam>(1.2)).ocv_v), 2.126 + 1.2 * 1.33, 1e-6);
  const auto above = look_up(cell, Soc<TypeParam>(1.2));
  EXPECT_NEAR(as_double(above.ocv_delta_v) * as_double(above.per_width), 1.33, 1e-5);
}

double slope_v(const auto& at) { return at.ocv_delta_v * at.per_width; }

TEST(Cell, AnEdgeBelongsToTheIntervalAboveItAndSoDoesItsSlope) {
  const auto cell = tests::prepared<double>();
  const double b1_v[] = {3.35, 0.39, 0.32, 0.08, 0.01, 0.04, 0.23, 0.09, 0.01, 1.33};
  for (std::size_t k = 0; k < 10; ++k) {
    EXPECT_NEAR(slope_v(look_up(cell, static_cast<double>(k) / 10)), b1_v[k], 1e-9) << k;
    EXPECT_NEAR(slope_v(look_up(cell, std::nextafter(static_cast<double>(k + 1) / 10, 0.0))), b1_v[k], 1e-9) << k;
  }
}

TEST(Cell, SlopesAreTheDerivatives) {
  using Jet = ceres::Jet<double, 1>;
  const auto jets = tests::prepared<Jet>();
  const auto cell = tests::prepared<double>();
  for (double soc = -0.2; soc < 1.2; soc += 0.0123) {
    const auto at = look_up(cell, soc);
    const auto jet = look_up(jets, Jet(soc, 0));
    EXPECT_NEAR(jet.ocv_v.v[0], at.ocv_delta_v * at.per_width, 1e-12);
    EXPECT_NEAR(jet.r0_ohm.v[0], at.r0_delta_ohm * at.per_width, 1e-12);
    EXPECT_NEAR(jet.r1_ohm.v[0], at.r1_delta_ohm * at.per_width, 1e-12);
    EXPECT_NEAR(jet.c1_f.v[0], at.c1_delta_f * at.per_width, 1e-9);
  }
}

TEST(Cell, FindsTheSameIntervalFromAnywhere) {
  const auto cell = tests::prepared<float>(tests::a123_26650);
  for (float soc = -0.3F; soc < 1.3F; soc += 0.0007F) {
    const std::size_t expected = interval_of(cell, soc, 0);
    for (std::size_t from = 0; from < cell.size; ++from)
      ASSERT_EQ(interval_of(cell, soc, from), expected) << soc << " from " << from;
  }
}

TEST(Cell, UnevenEdgesAndNodesShareOneRow) {
  CellParameters<> p = tests::table9;
  p.ocv.soc[1] = 0.07;  // an OCV edge of its own
  p.ocv.b0_v[1] = p.ocv.b0_v[0] + (p.ocv.b1_v[0] - p.ocv.b1_v[1]) * 0.07;
  p.ocv.b0_v[2] = p.ocv.b0_v[1] + (p.ocv.b1_v[1] - p.ocv.b1_v[2]) * 0.2;
  const auto cell = prepare<double, max_intervals>(p);
  EXPECT_EQ(cell.size, interval_count(p));
  EXPECT_EQ(cell.size, 13U);  // 0, 0.07, 0.1 ... 1.0 and the two outside
  EXPECT_NEAR(slope_v(look_up(cell, 0.08)), 0.39, 1e-9);
  EXPECT_NEAR(slope_v(look_up(cell, 0.06)), 3.35, 1e-9);
  EXPECT_NEAR(look_up(cell, 0.15).r1_ohm, (0.027101 + 0.012339) / 2, 1e-12);
}

TEST(Cell, CountsOfChargeFitIn32BitsFromACoinCellToAThousandAmpereHours) {
  for (const double capacity_ah : {0.01, 2.5, 6.0, 280.0, 1'000.0}) {
    CellParameters<> p = tests::table9;
    p.capacity_ah = capacity_ah;
    const auto cell = prepare<float, max_intervals>(p);
    EXPECT_GE(cell.charge.capacity_uaus >> cell.charge.shift, 1 << 28) << capacity_ah;
    EXPECT_LE(cell.charge.highest_uaus >> cell.charge.shift, 2'147'483'647) << capacity_ah;
    EXPECT_LT(static_cast<double>(cell.charge.highest_uaus) + 2.147e9 * 2e9, 9.22e18) << capacity_ah;
  }
}

}  // namespace
}  // namespace bms::model
