// Conditions that must not last without a limit: a current without a request, a current above the allowed one, no
// temperature; and a pack that is too empty to drive, but not to be charged.
#include <gtest/gtest.h>

#include "tests/firmware/protection/protection_bench.hpp"

namespace bms::protection {
namespace {

TEST(CurrentWithoutRequest, OpensAfterAMinuteAndFiveSecondsOfGrace) {
  ProtectionBench b;
  b.drive_off();
  b.inputs.request = Request::none;  // also what the firmware reports if CAN is lost
  double raised_s = -1, opened_s = -1;
  for (int k = 1; k <= 800 && opened_s < 0; ++k) {
    const Decision& d = b.step();
    if (raised_s < 0 && (d.faults & bit(Fault::current_unrequested)) != 0) raised_s = 0.1 * k;
    if (!d.outputs.any_closed()) opened_s = 0.1 * k;
  }
  EXPECT_NEAR(raised_s, 60.2, 0.11);
  EXPECT_NEAR(opened_s, 65.2, 0.21);
  EXPECT_EQ(b.protection.decision().first.fault, static_cast<std::uint8_t>(Fault::current_unrequested));
  b.load_ua = 0;
  b.inputs.request = Request::drive;
  b.run(200);
  EXPECT_FALSE(b.protection.decision().outputs.any_closed()) << "the key was turned before the fault had ended";
  b.inputs.request = Request::none;
  b.run(2);
  EXPECT_EQ(b.protection.decision().faults, 0U);
  b.drive_off();
}

TEST(CurrentWithoutRequest, ALoadThatIsLoweredWithinAMinuteOpensWithoutAFault) {
  ProtectionBench b;
  b.drive_off();
  b.inputs.request = Request::none;
  b.run(590);
  EXPECT_TRUE(b.protection.decision().outputs.any_closed());
  b.load_ua = 0;
  b.run(2);
  EXPECT_FALSE(b.protection.decision().outputs.any_closed());
  EXPECT_EQ(b.protection.decision().faults & ~bit(Fault::allowed_current_exceeded), 0U);
}

/// Half of 6 A is allowed with a fault that derates: 1.1 times 3 A and 0.12 A of rest current are 3.42 A.
TEST(DeratedCurrent, IsReportedTenSecondsAfterItIsExceededAndDoesNotOpen) {
  for (const std::int32_t load_ua : {-3'400'000, -3'500'000}) {
    ProtectionBench b;
    b.drive_off();
    b.change = [](auto& s) { s.temperature_cdegc[2] = measurement::no_temperature; };
    b.run(100);
    ASSERT_EQ(b.protection.decision().faults, bit(Fault::temperature_lost));
    ASSERT_NEAR(b.protection.decision().allowed.discharge_ua, 3e6, 1e4);
    b.load_ua = load_ua;
    b.run(99);
    EXPECT_EQ(b.protection.decision().faults, bit(Fault::temperature_lost));
    b.run(100);
    EXPECT_EQ((b.protection.decision().faults & bit(Fault::allowed_current_exceeded)) != 0, load_ua == -3'500'000);
    EXPECT_EQ(b.protection.decision().state, ContactorState::drive);
    EXPECT_EQ(b.protection.decision().first.fault, static_cast<std::uint8_t>(Fault::temperature_lost))
        << "the first of two warnings";
  }
}

TEST(AllTemperaturesLost, OpensAfterAMinuteInsteadOfDischargingWithoutLimit) {
  ProtectionBench b;
  b.drive_off();
  b.load_ua = -1'000'000;
  b.change = [](auto& s) { s.temperature_cdegc.fill(measurement::no_temperature); };
  double opened_s = -1;
  for (int k = 1; k <= 800 && opened_s < 0; ++k) {
    if (!b.step().outputs.any_closed()) opened_s = 0.1 * k;
    if (k == 580) {
      EXPECT_EQ(b.protection.decision().state, ContactorState::drive);
    }
  }
  EXPECT_NEAR(opened_s, 65.1, 0.2);
  EXPECT_NE(b.protection.decision().faults & bit(Fault::temperature_unknown), 0U);
  EXPECT_EQ(b.protection.decision().first.fault, static_cast<std::uint8_t>(Fault::temperature_unknown));
}

TEST(AllTemperaturesLost, AllowDrivingIfOneSensorReturnsWithinAMinute) {
  ProtectionBench b;
  b.drive_off();
  b.load_ua = -1'000'000;
  for (int k = 0; k < 2'400; ++k) {
    const bool lost = k % 1'200 < 590;
    b.change = [lost](auto& s) {
      s.temperature_cdegc.fill(measurement::no_temperature);
      if (!lost) s.temperature_cdegc[1] = 2'500;
    };
    b.step();
  }
  EXPECT_EQ(b.protection.decision().state, ContactorState::drive);
}

// ---- recovery charge: between 1.5 V (deep discharge) and 1.802 V (severe undervoltage) of a cell ----

constexpr PackDesign of_40_ah() {
  PackDesign d = forklift;
  d.capacity_ah = d.limits.charge_current_max_a = d.limits.discharge_current_max_a = 40;
  return d;
}
constexpr ProtectionPlan plan_of_40_ah = protection_plan(of_40_ah());

/// A pack of 40 Ah whose charger delivers what the test sets.
struct EmptyPack : ProtectionBench {
  explicit EmptyPack(std::int32_t lowest_uv) : ProtectionBench(0, plan_of_40_ah) {
    change = [this](auto& s) { s.cell_uv[3] = lowest + static_cast<std::int32_t>(count % 3); };
    lowest = lowest_uv;
    base_uv = 2'900'000;
    run(200);
  }
  void clear() {
    inputs = {.clear = Clear::user};
    step();
    inputs = {};
    run(10);
  }
  bool charges() {
    inputs.request = Request::charge;
    run(100);
    return protection.decision().state == ContactorState::charge;
  }

  std::int32_t lowest;
};

TEST(RecoveryCharge, NeedsAClearCommandAndARequestToCharge) {
  EmptyPack p(1'700'000);
  EXPECT_TRUE(p.protection.decision().faults & bit(Fault::cell_undervoltage_severe));
  EXPECT_FALSE(p.charges()) << "no clear command";
  p.clear();
  p.inputs.request = Request::drive;
  p.run(100);
  EXPECT_FALSE(p.protection.decision().outputs.any_closed()) << "never to drive";
  p.inputs = {};
  p.run(10);
  EXPECT_FALSE(p.charges()) << "the request to drive has ended it";
  p.clear();
  EXPECT_TRUE(p.charges());
  EXPECT_TRUE(p.protection.decision().outputs.charge_enable);
}

TEST(RecoveryCharge, AllowsATwentiethOfTheCapacityAndNoDischarge) {
  EmptyPack p(1'700'000);
  p.clear();
  ASSERT_TRUE(p.charges());
  p.load_ua = 2'000'000;
  for (int k = 0; k < 1'200; ++k) {
    const Decision& d = p.step();
    ASSERT_EQ(d.state, ContactorState::charge);
    ASSERT_LE(d.allowed.charge_ua, 2'000'000) << "C/20 of 40 Ah";
    ASSERT_EQ(d.allowed.discharge_ua, 0);
    ASSERT_NE(d.faults & bit(Fault::cell_undervoltage_severe), 0U) << "still published";
  }
  EXPECT_NEAR(p.protection.decision().allowed.charge_ua, 2e6, 1);
  p.lowest = 2'100'000;  // the cell has recovered
  p.run(120);
  p.inputs.clear = Clear::user;
  p.step();
  p.inputs.clear = Clear::none;
  EXPECT_EQ(p.protection.decision().faults & bit(Fault::cell_undervoltage_severe), 0U);
  p.run(100);
  EXPECT_GT(p.protection.decision().allowed.charge_ua, 10'000'000) << "back to the normal charge current";
}

TEST(RecoveryCharge, OpensAtOnceUnderALargerCurrentAndAfterTheGraceTimeUnderADischarge) {
  EmptyPack charged(1'700'000);
  charged.clear();
  ASSERT_TRUE(charged.charges());
  charged.load_ua = 4'100'000;  // C/10
  charged.step();
  EXPECT_FALSE(charged.protection.decision().outputs.any_closed());
  charged.load_ua = 0;
  charged.run(100);
  charged.inputs = {};
  charged.run(100);
  EXPECT_FALSE(charged.charges()) << "another clear command is needed";

  EmptyPack discharged(1'700'000);
  discharged.clear();
  ASSERT_TRUE(discharged.charges());
  discharged.load_ua = -1'000'000;
  discharged.run(48);
  EXPECT_TRUE(discharged.protection.decision().outputs.any_closed());
  discharged.run(4);
  EXPECT_FALSE(discharged.protection.decision().outputs.any_closed());
}

TEST(RecoveryCharge, OfADeeplyDischargedCellIsRefused) {
  EmptyPack p(1'450'000);
  EXPECT_TRUE(p.protection.decision().latched & bit(Fault::deep_discharge));
  p.clear();
  EXPECT_FALSE(p.charges());
  EmptyPack sinks(1'700'000);
  sinks.clear();
  ASSERT_TRUE(sinks.charges());
  sinks.lowest = 1'450'000;  // shorted inside
  sinks.run(105);
  EXPECT_FALSE(sinks.protection.decision().outputs.any_closed());
}

TEST(RecoveryCharge, IsNotAllowedAgainstAnyOtherFaultThatOpensOrForbidsCharging) {
  EmptyPack cold(1'700'000);
  cold.clear();
  cold.change = [&cold](auto& s) {
    s.cell_uv[3] = 1'700'000 + static_cast<std::int32_t>(cold.count % 3);
    s.temperature_cdegc[0] = -500;
  };
  cold.run(100);
  EXPECT_FALSE(cold.charges());
  EmptyPack tripped(1'700'000);
  tripped.clear();
  tripped.inputs.second_line = 1;  // undervoltage of the front end: its driver is disabled
  tripped.step();
  EXPECT_FALSE(tripped.charges());
}

}  // namespace
}  // namespace bms::protection
