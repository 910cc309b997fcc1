// What the measuring chip reports of its own protections, and a second current sensor.
#include <gtest/gtest.h>

#include "tests/firmware/protection/protection_bench.hpp"

namespace bms::protection {
namespace {

/// A pack of 100 Ah with a shunt up to 2,000 A and a Hall sensor up to 1,000 A.
constexpr PackDesign large() {
  PackDesign d = forklift;
  d.capacity_ah = d.limits.charge_current_max_a = d.limits.discharge_current_max_a = 100;
  d.current_range_a = 2'000;
  return d;
}
constexpr ProtectionPlan large_plan = protection_plan(large());

// Bits of hal/second_line.hpp.
constexpr std::uint32_t cell_undervoltage = 1, cell_overvoltage = 2, charge_overcurrent = 4, discharge_overcurrent = 8,
                        short_circuit = 16, temperature = 32, host_silence = 64, permanent_failure = 128,
                        pins_wrong = 256;

TEST(SecondLine, AnyTripOpensWithItsSampleUntilItIsClearedTenSecondsAfterItsEnd) {
  for (const std::uint32_t trip :
       {cell_undervoltage, cell_overvoltage, charge_overcurrent, discharge_overcurrent, host_silence}) {
    ProtectionBench b;
    b.drive_off();
    b.inputs.second_line = trip;
    EXPECT_FALSE(b.step().outputs.any_closed()) << trip;
    EXPECT_EQ(b.protection.decision().faults, bit(Fault::second_line_tripped)) << trip;
    EXPECT_EQ(b.protection.decision().first.fault, static_cast<std::uint8_t>(Fault::second_line_tripped));
    EXPECT_EQ(b.protection.decision().latched, 0U);
    b.load_ua = 0;
    b.run(300);
    b.inputs.clear = Clear::user;
    b.step();
    EXPECT_NE(b.protection.decision().faults, 0U) << "the trip is still reported";
    b.inputs = {};
    b.run(90);
    b.inputs.clear = Clear::user;
    b.step();
    EXPECT_NE(b.protection.decision().faults, 0U) << "nine seconds";
    b.inputs = {};
    b.run(20);
    b.inputs.clear = Clear::user;
    b.step();
    EXPECT_EQ(b.protection.decision().faults, 0U);
  }
}

/// The front end keeps its pins low as long as the pack is too cold or too hot. That ends by itself.
TEST(SecondLine, ATemperatureIsAStateAndNoTrip) {
  ProtectionBench b;
  b.drive_off();
  b.inputs.second_line = temperature;
  b.run(300);
  EXPECT_TRUE(b.protection.decision().outputs.main_plus);
  EXPECT_EQ(b.protection.decision().faults, 0U);
}

/// The comparator opens within a millisecond, so that the mean current of the sample may be a few amperes.
TEST(SecondLine, AShortCircuitThatTheChipInterruptedIsLatchedForService) {
  ProtectionBench b;
  b.drive_off();
  b.inputs.second_line = short_circuit;
  EXPECT_FALSE(b.step().outputs.any_closed());
  EXPECT_EQ(b.protection.decision().faults, bit(Fault::short_circuit));
  EXPECT_EQ(b.protection.decision().latched, bit(Fault::short_circuit));
  EXPECT_EQ(b.protection.decision().first.fault, static_cast<std::uint8_t>(Fault::short_circuit));
  b.inputs = {};
  b.load_ua = 0;
  b.run(300);
  b.inputs.clear = Clear::user;
  b.step();
  b.inputs = {.request = Request::drive};
  b.run(100);
  EXPECT_FALSE(b.protection.decision().outputs.any_closed()) << "a driver cannot drive into it again";
  EXPECT_EQ(b.protection.decision().faults, bit(Fault::short_circuit));
}

TEST(SecondLine, ATripWithASampleThatIsIgnoredOrEmptyIsNotLost) {
  ProtectionBench late;
  late.drive_off();
  late.inputs.second_line = short_circuit;
  late.time_us -= late.period;  // the sample is not later than the one before
  late.step();
  late.inputs.second_line = 0;
  EXPECT_FALSE(late.step().outputs.any_closed());
  EXPECT_EQ(late.protection.decision().latched, bit(Fault::short_circuit));

  ProtectionBench empty;  // the chip does not answer any more
  empty.drive_off();
  empty.inputs.second_line = short_circuit;
  measurement::PackSample<16> nothing;
  nothing.time_us = empty.time_us += empty.period;
  empty.protection.update(nothing, empty.estimate, empty.inputs);
  empty.protection.without_sample(empty.time_us + 600'000);
  EXPECT_FALSE(empty.protection.decision().outputs.any_closed());
  EXPECT_EQ(empty.protection.decision().latched, bit(Fault::short_circuit));
}

TEST(SecondLine, ThatFailedIsLatchedOverAPowerCycleUntilService) {
  for (const std::uint32_t failure : {permanent_failure, pins_wrong}) {
    ProtectionBench b;
    b.drive_off();
    b.inputs.second_line = failure;
    b.step();
    b.inputs.second_line = 0;
    b.run(10);
    EXPECT_EQ(b.protection.decision().faults, 0U) << "a single wrong reading";
    b.inputs.second_line = failure;
    b.run(3);
    EXPECT_FALSE(b.protection.decision().outputs.any_closed());
    EXPECT_EQ(b.protection.decision().faults, bit(Fault::second_line_failed));
    ASSERT_EQ(b.protection.decision().latched, FaultSet{1} << 33);
    ProtectionBench next;
    next.protection = Protection<16>(forklift_plan, b.protection.decision().latched);
    next.inputs.request = Request::drive;
    next.run(150);
    EXPECT_EQ(next.protection.decision().state, ContactorState::safe);
    next.inputs = {.clear = Clear::user};
    EXPECT_NE(next.step().faults, 0U);
    next.inputs = {};
    next.step();
    next.inputs = {.clear = Clear::service};
    EXPECT_EQ(next.step().faults, 0U);
  }
}

/// Time until the contactors open with these readings [s]; -1: they stay closed for 20 s.
double opens_after_s(double first_a, double second_a) {
  ProtectionBench b(0, large_plan);
  b.drive_off();
  b.load_ua = static_cast<std::int32_t>(1e6 * first_a);
  b.inputs.second_current_ua = static_cast<std::int32_t>(1e6 * second_a);
  for (int k = 1; k <= 200; ++k) {
    if (b.step().outputs.any_closed()) continue;
    EXPECT_NE(b.protection.decision().faults & bit(Fault::current_sensors_differ), 0U);
    EXPECT_EQ(b.protection.decision().first.fault, static_cast<std::uint8_t>(Fault::current_sensors_differ));
    return 0.1 * k;
  }
  return -1;
}

/// Hall sensor: 2 % of gain and 10 A of offset; front end without calibration: 6 %.
TEST(SecondCurrentSensor, AStuckOrWrongSensorOpensAndTheErrorsOfGoodOnesDoNot) {
  EXPECT_NEAR(opens_after_s(-3, -90), 7.1, 0.11) << "stuck: two seconds, and five of grace";
  EXPECT_NEAR(opens_after_s(-90, 0), 7.1, 0.11);
  EXPECT_NEAR(opens_after_s(-90, 90), 7.1, 0.11) << "a wrong sign";
  EXPECT_EQ(opens_after_s(-100, -100 * 1.06 * 1.02 - 10), -1);
  EXPECT_EQ(opens_after_s(100 * 1.06, 100 * 0.98 - 10), -1);
  EXPECT_EQ(opens_after_s(-3, 12), -1);
}

TEST(SecondCurrentSensor, IsComparedOnlyInTheRangeOfBoth) {
  const PackLimits limits = pack_limits(large());
  const auto difference_a = [&](double a, double b) {
    return 1e-6 * current_difference_ua(limits, static_cast<std::int32_t>(1e6 * a), static_cast<std::int32_t>(1e6 * b));
  };
  EXPECT_LE(difference_a(-1'900, -1'000), 0) << "the second sensor ends at 1,000 A";
  EXPECT_NEAR(difference_a(-2'000, 1'000), 2'000 - 100, 5);
  EXPECT_NEAR(difference_a(-200, -100), 100 - 20, 1);
  EXPECT_EQ(current_difference_ua(limits, measurement::no_reading, 5), measurement::no_reading);
  EXPECT_EQ(current_difference_ua(limits, 5, measurement::no_reading), measurement::no_reading);
}

TEST(SecondCurrentSensor, ALoadStepThatOneSensorSeesEarlierIsNoFault) {
  ProtectionBench b(0, large_plan);
  b.drive_off();
  for (int k = 0; k < 600; ++k) {  // a lift every second; the second sensor lags a sample
    b.inputs.second_current_ua = b.load_ua;
    b.load_ua = k % 10 < 5 ? -95'000'000 : -5'000'000;
    ASSERT_EQ(b.step().faults, 0U) << k;
  }
}

}  // namespace
}  // namespace bms::protection
