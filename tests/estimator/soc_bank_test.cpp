#include "estimator/soc_bank.hpp"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

namespace bms::estimator {
namespace {

template <class Scalar>
class SocBankOfEveryScalar : public ::testing::Test {};
using Scalars = ::testing::Types<float, double, arithmetic::FixedPoint>;
TYPED_TEST_SUITE(SocBankOfEveryScalar, Scalars);

/// A curve that is flat but for a knee: 3.2 V, from 0.6 to 0.7 up to 3.3 V.
double curve_v(double soc) { return 3.2 + 0.02 * soc + std::clamp(soc - 0.6, 0.0, 0.1); }

template <class S>
struct Asked {
  SocBank<S> bank;
  double soc = 0.5, variance = 1, off_v = 0;

  /// One sample of a cell that truly has that soc; all have moved by moved.
  void sample(double truth, double moved, double share, double sigma_v) {
    soc += moved;
    const auto seen = [&](const arithmetic::Soc<S>& there) -> typename SocBank<S>::Observation {
      const double at = arithmetic::as_double(there),
                   half_v = std::abs(curve_v(at + 0.5 / 64) - curve_v(at - 0.5 / 64)) / 2;
      return {arithmetic::Voltage<S>(curve_v(truth) + off_v - curve_v(at)), arithmetic::Voltage<S>(half_v),
              arithmetic::Variance<S>(sigma_v * sigma_v / 16), arithmetic::Variance<S>(0.0),
              arithmetic::Variance<S>(sigma_v * sigma_v)};
    };
    const auto bank_update = bank.step(arithmetic::Soc<S>(soc), arithmetic::Fraction<S>(share),
                                       arithmetic::Variance<S>(1e-6), arithmetic::Variance<S>(sigma_v * sigma_v), seen);
    if (!bank_update.ready) return;
    soc += arithmetic::as_double(bank_update.moved);
    variance = arithmetic::as_double(bank_update.variance);
  }
};

template <class S>
Asked<S> asked() {
  Asked<S> a;
  a.bank.open_at(arithmetic::Soc<S>(0.5), [](int) { return arithmetic::Exponent<S>(0); });
  return a;
}

TYPED_TEST(SocBankOfEveryScalar, IsUniformAtFirst) {
  auto a = asked<TypeParam>();
  for (int k = 0; k < 128; ++k) a.sample(0.3, 0, 0, 0.01);
  EXPECT_NEAR(a.soc, 0.5, 0.01);
  EXPECT_NEAR(a.variance, 1.0 / 12, 0.002);
}

TYPED_TEST(SocBankOfEveryScalar, SaysHowProbablyTheSocIsElsewhere) {
  using S = TypeParam;
  const auto elsewhere = [](double others, double moved) {
    SocBank<S> bank;
    bank.open_at(arithmetic::Soc<S>(0.5), [&](int k) {
      return arithmetic::Exponent<S>(std::abs(arithmetic::as_double(SocBank<S>::grid(k)) - 0.5) < 0.05 ? 0 : others);
    });
    bank.follow(arithmetic::Soc<S>(moved));
    double probability = -1;
    for (int k = 0; k < 128; ++k) {
      const auto update = bank.step(arithmetic::Soc<S>(0.5 + moved), arithmetic::Fraction<S>(1),
                                    arithmetic::Variance<S>(1e-6), arithmetic::Variance<S>(1e-4),
                                    [](const arithmetic::Soc<S>&) -> typename SocBank<S>::Observation { return {}; });
      if (update.ready) probability = arithmetic::as_double(update.elsewhere);
    }
    return probability;
  };
  EXPECT_NEAR(elsewhere(0, 0), 58.0 / 64, 0.01);
  EXPECT_NEAR(elsewhere(2, 0), 58 * std::exp(-2.0) / (6 + 58 * std::exp(-2.0)), 0.01);
  EXPECT_NEAR(elsewhere(20, 0), 0, 0.001);
  EXPECT_NEAR(elsewhere(20, 0.2), 1, 0.001) << "the filter has left the only place that fits";
}

TYPED_TEST(SocBankOfEveryScalar, OnAPlateauItIsAsWideAsThePlateau) {
  auto a = asked<TypeParam>();
  for (int k = 0; k < 128 * 40; ++k) a.sample(0.3, 0, 0.2, 0.01);
  EXPECT_NEAR(a.soc, 0.31, 0.05) << "0 to 0.6 and a little";
  EXPECT_NEAR(std::sqrt(a.variance), 0.6 / std::sqrt(12.0), 0.03);
}

TYPED_TEST(SocBankOfEveryScalar, CrossingAKneeDecidesBetweenTheHypotheses) {
  auto a = asked<TypeParam>();
  double truth = 0.85;
  for (int k = 0; k < 128 * 40; ++k, truth -= 0.3 / (128 * 40)) a.sample(truth, -0.3 / (128 * 40), 0.2, 0.01);
  EXPECT_NEAR(a.soc, truth, 0.015);
  EXPECT_LT(std::sqrt(a.variance), 0.015);
}

TYPED_TEST(SocBankOfEveryScalar, OneBadReadingDoesNotRuleTheTruthOut) {
  auto a = asked<TypeParam>();
  for (int k = 0; k < 128 * 40; ++k) {
    const bool at_the_truth = k == 128 * 3 + 45;  // 0.71
    a.off_v = at_the_truth ? 0.5 : 0;
    a.sample(0.72, 0, 0.2, 0.01);
  }
  EXPECT_NEAR(a.soc, 0.85, 0.08) << "above the knee, wherever";
  EXPECT_NEAR(std::sqrt(a.variance), 0.09, 0.02);
}

/// 1.5 standard deviations too much for 20 correlation times, on the lower plateau and over the knee: no certainty of
/// the upper one. As curve_v, and below 0.1 steep, where soc is no surer than elsewhere: nothing there is far off.
TYPED_TEST(SocBankOfEveryScalar, WhereAnythingCouldBeReadIsNotMoreLikelyForIt) {
  using S = TypeParam;
  auto a = asked<S>();
  const double truth = 0.4, off_v = 0.015;  // a lasting error of one and a half sigma
  double soc = 0.5;
  for (int k = 0; k < 128 * 200; ++k) {
    const auto bank_update = a.bank.step(
        arithmetic::Soc<S>(soc), arithmetic::Fraction<S>(0.2), arithmetic::Variance<S>(1e-6),
        arithmetic::Variance<S>(1e-4), [&](const arithmetic::Soc<S>& there) -> typename SocBank<S>::Observation {
          const double at = arithmetic::as_double(there), steep_v = at < 0.25 ? 0.2 : 0;
          return {arithmetic::Voltage<S>(curve_v(truth) + off_v - curve_v(at) + 0.1 * steep_v),
                  arithmetic::Voltage<S>(0.001), arithmetic::Variance<S>(1e-5),
                  arithmetic::Variance<S>(steep_v * steep_v / 4), arithmetic::Variance<S>(1e-4 + steep_v * steep_v)};
        });
    if (!bank_update.ready) continue;
    soc += arithmetic::as_double(bank_update.moved);
  }
  EXPECT_GT(soc, 0.3) << "the steep end must not draw the mean to it";
}

TYPED_TEST(SocBankOfEveryScalar, APersistentErrorCountsOnce) {
  auto a = asked<TypeParam>();
  a.off_v = 0.045;
  double truth = 0.5;
  for (int k = 0; k < 128 * 100; ++k, truth -= 0.3 / (128 * 100)) {
    a.sample(truth, -0.3 / (128 * 100), 0.2, 0.03);
    if (k < 256) continue;
    ASSERT_LT(std::abs(a.soc - truth), 2.1 * std::sqrt(a.variance)) << k;
  }
  EXPECT_GT(std::sqrt(a.variance), 0.1);
}

/// The truth moves over a steep part, where the axis of the table may be off by more than the model's noise, but is
/// not. The plateau next to it explains the voltages by a bias only.
TYPED_TEST(SocBankOfEveryScalar, TheTruthOnASteepPartIsNotRuledOutByItsOwnUncertainty) {
  using S = TypeParam;
  auto a = asked<S>();
  double truth = 0.68, soc = 0.5, variance = 1;
  for (int k = 0; k < 128 * 150; ++k) {
    const double moved = -0.06 / (128 * 150);
    truth += moved;
    soc += moved;
    const auto bank_update = a.bank.step(
        arithmetic::Soc<S>(soc), arithmetic::Fraction<S>(0.2), arithmetic::Variance<S>(1e-6),
        arithmetic::Variance<S>(1e-4), [&](const arithmetic::Soc<S>& there) -> typename SocBank<S>::Observation {
          const double at = arithmetic::as_double(there), axis_v = at > 0.6 && at < 0.7 ? 0.03 : 0;
          return {arithmetic::Voltage<S>(curve_v(truth) - curve_v(at)), arithmetic::Voltage<S>(0.001),
                  arithmetic::Variance<S>(1e-5), arithmetic::Variance<S>(axis_v * axis_v / 4),
                  arithmetic::Variance<S>(4e-4 + axis_v * axis_v)};
        });
    if (!bank_update.ready) continue;
    soc += arithmetic::as_double(bank_update.moved);
    variance = arithmetic::as_double(bank_update.variance);
  }
  EXPECT_LT(std::abs(soc - truth), 2 * std::sqrt(variance));
  EXPECT_LT(std::sqrt(variance), 0.2);
}

}  // namespace
}  // namespace bms::estimator
