#include "identification/ocv_pieces.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/inference/identification/plant.hpp"

namespace bms::identification {
namespace {

constexpr double gap_v = 0.025;

double hysteresis_v(double current_a) {
  if (current_a == 0) return 0;
  return current_a > 0 ? gap_v : -gap_v;
}

/// A slow run of the truth cell with `gap_v` of hysteresis added, rests at both ends.
SlowRun slow_run(bool charges, double noise_v = 0.0005) {
  constexpr double c_rate = 1.0 / 25;
  std::vector<experiments::ProfileRow> profile;
  const int moving = 25 * 360;
  const double current_a = (charges ? 6 : -6) * c_rate;
  for (int k = 0; k <= moving + 720; ++k) profile.push_back({10.0 * k, k > 360 && k <= 360 + moving ? current_a : 0.0});
  PlantRun run = run_plant(profile, charges ? 0.0 : 1.0);
  std::mt19937_64 random(charges ? 1 : 2);
  std::normal_distribution<double> normal;
  for (std::size_t k = 0; k < run.data.size(); ++k)
    run.data.voltage_v.edit()[k] += hysteresis_v(profile[k].current_a) + noise_v * normal(random);
  return {run.data, {}};
}

TEST(OcvCurve, IsTheMiddleOfChargeAndDischargeAndKeepsTheGap) {
  const OcvCurve curve = ocv_curve({slow_run(false), slow_run(true)});
  EXPECT_NEAR(curve.capacity_ah, 6, 0.001);
  EXPECT_NEAR(*curve.coulombic_efficiency, 1, 1e-6);
  const auto truth_v = plant::table9_ocv_v();
  for (std::size_t k = 20; k + 20 < curve.soc.size(); k += 7) {
    ASSERT_NEAR(curve.ocv_v[k], truth_v.at(curve.soc[k]), 0.0015) << curve.soc[k];
    ASSERT_NEAR(curve.half_gap_v[k], gap_v + 0.24 * 0.022, 0.005)
        << curve.soc[k];  // includes the overvoltage of C/25 over R0 + R1
  }
}

TEST(OcvCurve, OneRunAloneIsUsedUnchanged) {
  const OcvCurve curve = ocv_curve({slow_run(false)});
  EXPECT_FALSE(curve.coulombic_efficiency);
  EXPECT_EQ(curve.half_gap_v[500], 0);
  EXPECT_EQ(curve.branch, -1);
  EXPECT_EQ(ocv_curve({slow_run(true)}).branch, 1);
  EXPECT_EQ(ocv_curve({slow_run(false), slow_run(true)}).branch, 0);
  EXPECT_NEAR(curve.ocv_v[500], plant::table9_ocv_v().at(0.5) - gap_v - 0.005, 0.002);
}

TEST(OcvCurve, RejectsRunsThatAreNotSlowOrNotComplete) {
  const auto profile = *experiments::experiment("high_1m_low_30s");
  EXPECT_THROW(ocv_curve({{run_plant(profile, 0.5).data, {}}}), std::invalid_argument);
  EXPECT_THROW(ocv_curve({}), std::invalid_argument);
  SlowRun half = slow_run(false);
  half.soc = std::vector<double>(half.data.size(), 0.5);
  EXPECT_THROW(ocv_curve({half}), std::invalid_argument);
}

TEST(OcvPieces, AreFewRisingAndWithinTheError) {
  const OcvCurve curve = ocv_curve({slow_run(false), slow_run(true)});
  std::size_t before = 1000;
  for (const double error_v : {0.002, 0.004, 0.01}) {
    const auto pieces = fewest_pieces(curve, error_v);
    ASSERT_TRUE(pieces) << error_v;
    EXPECT_LE(pieces->largest_error_v, error_v);
    EXPECT_EQ(pieces->soc.front(), 0);
    EXPECT_EQ(pieces->soc.back(), 1);
    for (std::size_t k = 1; k < pieces->soc.size(); ++k) {
      EXPECT_GT(pieces->ocv_v[k], pieces->ocv_v[k - 1]);
      EXPECT_GE(pieces->soc[k] - pieces->soc[k - 1], 0.001 - 1e-12);
    }
    EXPECT_LE(pieces->soc.size(), before);
    before = pieces->soc.size();
  }
}

TEST(OcvPieces, HaveMoreCornersWhereTheHalfGapBends) {
  OcvCurve curve;
  for (int k = 0; k <= 1000; ++k) {
    const double s = k / 1000.0;
    curve.soc.push_back(s);
    curve.ocv_v.push_back(3.2 + 0.1 * s);
    curve.half_gap_v.push_back(
        0.02 + 0.01 * std::exp(-std::pow((s - 0.7) / 0.05, 2)));  // the knees of charge and discharge differ
  }
  auto pieces = *fewest_pieces(curve, 0.002);
  ASSERT_EQ(pieces.soc.size(), 2U);
  add_gap_corners(pieces, curve, 0.001, 64);
  EXPECT_GT(pieces.soc.size(), 5U);
  EXPECT_LT(pieces.soc.size(), 14U);
  for (std::size_t k = 0, piece = 0; k < curve.soc.size(); ++k) {
    while (piece + 2 < pieces.soc.size() && curve.soc[k] > pieces.soc[piece + 1]) ++piece;
    const double t = (curve.soc[k] - pieces.soc[piece]) / (pieces.soc[piece + 1] - pieces.soc[piece]);
    ASSERT_NEAR(pieces.half_gap_v[piece] + t * (pieces.half_gap_v[piece + 1] - pieces.half_gap_v[piece]),
                curve.half_gap_v[k], 0.00101)
        << curve.soc[k];
    ASSERT_NEAR(pieces.ocv_v[piece] + t * (pieces.ocv_v[piece + 1] - pieces.ocv_v[piece]), curve.ocv_v[k], 0.002)
        << curve.soc[k];
  }
  pieces = *fewest_pieces(curve, 0.002);
  add_gap_corners(pieces, curve, 0.001, 5);
  EXPECT_EQ(pieces.soc.size(), 5U);
}

TEST(OcvPieces, FollowASteepCurve) {
  OcvCurve curve;
  for (int k = 0; k <= 1000; ++k) {
    const double s = k / 1000.0;
    curve.soc.push_back(s);
    curve.ocv_v.push_back(3.2 + 0.1 * s - 1.2 * std::exp(-s / 0.006));  // a volt within the last percent
    curve.half_gap_v.push_back(0);
  }
  const auto pieces = fewest_pieces(curve, 0.002);
  ASSERT_TRUE(pieces);
  for (std::size_t k = 1; k < pieces->soc.size(); ++k) {
    EXPECT_GE(pieces->soc[k] - pieces->soc[k - 1], 0.002 - 1e-12) << "a cell file accepts no narrower pieces";
    EXPECT_LT((pieces->ocv_v[k] - pieces->ocv_v[k - 1]) / (pieces->soc[k] - pieces->soc[k - 1]), 60)
        << "nor steeper ones";
  }
  EXPECT_LE(pieces->largest_error_v, 0.002);
}

double three_lines_v(double soc) {
  if (soc < 0.2) return 3 + soc;
  return soc < 0.7 ? 3.2 + 0.02 * (soc - 0.2) : 3.21 + 0.5 * (soc - 0.7);
}

TEST(OcvPieces, FindTheCornersOfAPolyline) {
  OcvCurve curve;
  for (int k = 0; k <= 1000; ++k) {
    const double s = k / 1000.0;
    curve.soc.push_back(s);
    curve.ocv_v.push_back(three_lines_v(s));
    curve.half_gap_v.push_back(0);
  }
  const auto pieces = fewest_pieces(curve, 0.001);
  ASSERT_TRUE(pieces);
  ASSERT_EQ(pieces->soc.size(), 4U);
  EXPECT_NEAR(pieces->soc[1], 0.2, 0.004);
  EXPECT_NEAR(pieces->soc[2], 0.7, 0.004);
  EXPECT_LT(pieces->largest_error_v, 0.001);
}

}  // namespace
}  // namespace bms::identification
