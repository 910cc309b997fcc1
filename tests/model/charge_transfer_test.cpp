// The law of a non-linear charge transfer compared with the equation that it solves.
#include "model/mechanisms/charge_transfer.hpp"

#include <ceres/jet.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "arithmetic/dual_number.hpp"
#include "model/one_rc.hpp"

namespace bms::model {
namespace {

constexpr double cell_ah = 6;

TEST(ChargeTransfer, FlattensByTheInverseHyperbolicSine) {
  const ChargeTransfer::Law<double> law(std::array<double, 4>{1, 0.5, 2, 0.5}, cell_ah);
  const ChargeTransfer::Law<float> single(std::array<double, 4>{1, 0.5, 2, 0.5}, cell_ah);
  for (double a = -300; a <= 300; a += 0.37) {
    const double x = a / 4, exact = std::abs(x) < 1e-9 ? 1 : std::asinh(x) / x;
    TablePoint<double> at{};
    at.r0_ohm = at.r1_ohm = 1;
    law.tables(at, 0.5, {a, 1});
    ASSERT_NEAR(at.r0_ohm / exact, 1, 1e-7) << a;
    ASSERT_NEAR(at.r1_ohm, 0.5 + 0.5 * exact, 1e-7) << a;
    TablePoint<float> f{};
    f.r0_ohm = f.r1_ohm = 1;
    single.tables(f, 0.5F, {static_cast<float>(a), 1});
    ASSERT_NEAR(f.r0_ohm, exact, 1e-6) << a;
  }
}

TEST(ChargeTransfer, SolvesButlerVolmerForEachTransferCoefficient) {
  for (const double coefficient : {0.3, 0.42, 0.5, 0.6, 0.7}) {
    const std::array<double, 4> values{1, 0, 2, coefficient};
    const ChargeTransfer::Law<double> law(values, cell_ah);
    const ChargeTransfer::Law<float> single(values, cell_ah);
    for (double a = -300.1; a <= 300; a += 0.37) {
      TablePoint<double> at{};
      at.r0_ohm = 1;
      law.tables(at, 0.5, {a, 1});
      const double x = a / 4, y = at.r0_ohm * x;  // half of the overpotential over R T / F
      ASSERT_NEAR(2 * (std::exp(coefficient * 2 * y) - std::exp((coefficient - 1) * 2 * y)) / a, 1, 4e-6)
          << coefficient << " " << a;
      TablePoint<float> f{};
      f.r0_ohm = 1;
      single.tables(f, 0.5F, {static_cast<float>(a), 1});
      ASSERT_NEAR(f.r0_ohm, at.r0_ohm, 2e-6) << coefficient << " " << a;
    }
  }
}

TEST(ChargeTransfer, HasADerivativeByTheTransferCoefficientWhereBothDirectionsAreEqual) {
  using Jet = ceres::Jet<double, 1>;
  const auto voltage = [](double coefficient) {
    TablePoint<double> at{};
    at.r0_ohm = 1;
    ChargeTransfer::Law<double>(std::array<double, 4>{1, 0, 2, coefficient}, cell_ah).tables(at, 0.5, {30, 1});
    return at.r0_ohm;
  };
  TablePoint<Jet> at{};
  at.r0_ohm = Jet(1);
  const ChargeTransfer::Law<Jet> law(std::array<Jet, 4>{Jet(1), Jet(0), Jet(2), Jet(0.5, 0)}, cell_ah);
  StepInput<Jet> input{};
  input.current_a = Jet(30);
  law.tables(at, Jet(0.5), input);
  EXPECT_NEAR(at.r0_ohm.a, voltage(0.5), 1e-7);
  EXPECT_NEAR(at.r0_ohm.v[0], (voltage(0.5001) - voltage(0.4999)) / 2e-4, 1e-3 * std::abs(at.r0_ohm.v[0]));
  EXPECT_LT(at.r0_ohm.v[0], -0.1) << "a larger coefficient of charging makes charging cheaper";
}

}  // namespace
}  // namespace bms::model
