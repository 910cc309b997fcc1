// One wrong reading of a cell against the pack's own measurement, and large cells.
#include <cmath>

#include <gtest/gtest.h>

#include "tests/cells.hpp"
#include "tests/firmware/protection/protection_bench.hpp"

namespace bms::protection {
namespace {

/// Time until the contactors are open [s]; -1: they stay closed for 20 s. pack_error_uv: pack minus sum of the cells.
double opens_after_s(const std::function<void(measurement::PackSample<16>&)>& change, std::int32_t pack_error_uv,
                     FaultSet& faults) {
  ProtectionBench b;
  b.drive_off();
  b.change = change;
  b.pack_error_uv = pack_error_uv;
  for (int k = 1; k <= 200; ++k) {
    faults |= b.step().faults;
    if (!b.protection.decision().outputs.any_closed()) return 0.1 * k;
  }
  return -1;
}

/// The cell has 4.1 V, which the pack's own measurement contains.
TEST(HiddenCell, AChannelThatReadsHalfAVoltLowHidesNoOverchargedCell) {
  FaultSet faults = 0;
  const double after_s =
      opens_after_s([](auto& s) { s.cell_uv[6] += 3'600'000 - 3'300'000; }, 4'100'000 - 3'600'000, faults);
  EXPECT_EQ(faults, bit(Fault::sum_mismatch));
  EXPECT_NEAR(after_s, 1 + 5 + 0.1, 0.21) << "a second, and the grace time";
}

TEST(HiddenCell, ASenseTapThatIsHalfAVoltLowShiftsTwoNeighbours) {
  FaultSet faults = 0;
  const double after_s = opens_after_s(
      [](auto& s) {
        s.cell_uv[6] -= 500'000;
        s.cell_uv[7] += 500'000;
      },
      0, faults);
  EXPECT_NE(faults & bit(Fault::open_wire), 0U);
  EXPECT_GE(after_s, 0);
  EXPECT_LE(after_s, 0.5 + 5 + 0.3);
}

/// All errors at their worst with the same sign: 5 mV per cell, 0.2 V of the pack. A load ramps between 0 and its
/// limit in a second, again and again; cells have a drop of 0.16 V then, and pack and cells are read 63 ms apart.
TEST(SumOfCells, WorstErrorsOfGoodReadingsAndLoadRampsAreNoFault) {
  const auto load = [](double t_s) { return std::abs(t_s - 2 * std::round(t_s / 2)); };  // 0 .. 1 .. 0 in 2 s
  const auto cell_v = [&](double t_s) { return 3.3 - 0.16 * load(t_s); };
  for (const double sign : {-1.0, 1.0}) {
    ProtectionBench b;
    b.drive_off();
    for (int k = 0; k < 600; ++k) {
      const double t_s = 0.1 * k, skew_v = 16 * (cell_v(t_s + 0.063) - cell_v(t_s));
      b.base_uv = static_cast<std::int32_t>(1e6 * (cell_v(t_s) + sign * 0.005));
      b.load_ua = static_cast<std::int32_t>(-6e6 * load(t_s));
      b.pack_error_uv = static_cast<std::int32_t>(1e6 * (skew_v - sign * (0.2 + 16 * 0.005)));
      ASSERT_EQ(b.step().faults, 0U) << t_s << " s, " << sign;
    }
  }
}

/// Cells in parallel, up to the largest current that a cell file may have.
constexpr PackDesign of_cells_with(double limit_a) {
  PackDesign d = forklift;
  d.capacity_ah = limit_a / 2;
  d.limits.charge_current_max_a = d.limits.discharge_current_max_a = limit_a;
  return d;
}
constexpr ProtectionPlan of_430_a = protection_plan(of_cells_with(430)),
                         of_1000_a = protection_plan(of_cells_with(1'000)),
                         of_2000_a = protection_plan(of_cells_with(2'000));

TEST(LargeCells, OfUpTo2000AmperesAreProtectedUpToTheEndOfAReading) {
  for (const ProtectionPlan* plan : {&of_430_a, &of_1000_a, &of_2000_a}) {
    const double limit_a = 1e-6 * plan->derating.discharge_max_ua;
    EXPECT_TRUE(consistent(plan->rules));
    EXPECT_TRUE(current_sensor_suffices(of_cells_with(limit_a)));
    EXPECT_NEAR(1e-6 * plan->rule(Fault::short_circuit).threshold, limit_a < 1'900 ? 0.9 * 2'147 : 2'100, 0.1);
    for (const int sign : {-1, 1}) {
      ProtectionBench b(0, *plan);
      b.drive_off();
      b.load_ua = sign * static_cast<std::int32_t>(1e6 * limit_a);
      b.run(300);
      EXPECT_EQ(b.protection.decision().faults & ~bit(Fault::allowed_current_exceeded), 0U) << limit_a;
      EXPECT_TRUE(b.protection.decision().outputs.any_closed()) << limit_a;
      EXPECT_NEAR(1e-6 * b.protection.decision().allowed.discharge_ua, limit_a, 0.001 * limit_a);
      b.load_ua = sign * 2'147'000'000;
      EXPECT_FALSE(b.step().outputs.any_closed()) << limit_a;
      EXPECT_NE(b.protection.decision().faults & bit(Fault::short_circuit), 0U);
    }
  }
}

TEST(LargeCells, OfMoreThan2000AmperesAreRefusedByTheCellFile) {
  EXPECT_GT(of_2000_a.rule(Fault::short_circuit).threshold, 0) << "saturated, not overflowed";
  EXPECT_GT(of_2000_a.derating.discharge_max_ua, 1'999'000'000);
  model::CellParameters<double> p = tests::table9;
  for (const double limit_a : {430.0, 1'000.0, 1'500.0, 2'000.0, 2'001.0}) {
    p.limits.charge_current_max_a = p.limits.discharge_current_max_a = limit_a;
    const model::CellFault fault = model::first_fault(p);
    if (limit_a <= 2'000) {
      EXPECT_EQ(fault.what, nullptr) << limit_a;
      EXPECT_TRUE(current_sensor_suffices(of_cells_with(limit_a))) << "what a cell file may contain can be protected";
    } else {
      EXPECT_STREQ(fault.key, "limits.charge_current_max_a");
      EXPECT_STREQ(fault.what, "0.001 to 2000 A, so that an overload is within a reading (2147 A)");
    }
  }
}

}  // namespace
}  // namespace bms::protection
