// Protection as the firmware sees it: samples in, decisions out.
#include "protection/protection.hpp"

#include <cmath>

#include <gtest/gtest.h>

#include "plant/random.hpp"
#include "tests/firmware/protection/protection_bench.hpp"
#include "tests/firmware/protection/scenario.hpp"
#include "tests/forklift_shift.hpp"

namespace bms::protection {
namespace {

TEST(Protection, OpensTheContactorsWithin300msOfASevereOvervoltage) {
  ProtectionBench b;
  b.drive_off();
  b.change = [](auto& s) { s.cell_uv[9] = 3'900'000; };
  const std::uint64_t from = b.time_us;
  while (b.protection.decision().outputs.any_closed() && b.time_us - from < 2'000'000) b.step();
  EXPECT_LE(b.time_us - from, 300'000U);
  EXPECT_EQ(b.protection.decision().first.fault, static_cast<std::uint8_t>(Fault::cell_overvoltage_severe));
  EXPECT_EQ(b.protection.decision().first.time_us, b.time_us);
  EXPECT_EQ(b.protection.decision().allowed.discharge_ua, 0);
  b.run(100);
  EXPECT_EQ(b.protection.decision().state, ContactorState::safe);
}

TEST(Protection, OpensOnTheFirstSampleOfAShortCircuitAndLatchesIt) {
  ProtectionBench b;
  b.drive_off();
  b.load_ua = -60'000'000;
  EXPECT_FALSE(b.step().outputs.any_closed());
  EXPECT_EQ(b.protection.decision().latched, bit(Fault::short_circuit));
}

TEST(Protection, AllowsNoCurrentBeforeItOpensAndOpensIfTheTruckDoesNotStop) {
  for (const bool obeys : {true, false}) {
    ProtectionBench b;
    b.drive_off();
    b.base_uv = 1'950'000;
    double forbidden_s = -1, opened_s = -1;
    for (int k = 1; k < 400 && opened_s < 0; ++k) {
      const Decision& d = b.step();
      if (forbidden_s < 0 && d.allowed.discharge_ua == 0) forbidden_s = k / 10.0;
      if (obeys && forbidden_s >= 0) b.load_ua = 0;
      if (!d.outputs.any_closed()) opened_s = k / 10.0;
    }
    EXPECT_GT(forbidden_s, 0.5) << "ramped down";
    EXPECT_LE(forbidden_s, 2.2);
    if (obeys) {
      EXPECT_EQ(opened_s, -1);
    } else {
      EXPECT_NEAR(opened_s, 2.1 + 5.0, 0.2) << "two seconds of delay, five of grace time";
    }
  }
}

TEST(Protection, ReportsARaisedFaultOnce) {
  ProtectionBench b;
  b.drive_off();
  b.change = [](auto& s) { s.cell_uv[9] = 3'900'000; };
  while ((b.protection.decision().faults & bit(Fault::cell_overvoltage_severe)) == 0) b.step();
  ASSERT_NE(b.protection.decision().raised, 0U);
  b.time_us -= b.period;  // the next sample is not later
  EXPECT_EQ(b.step().raised, 0U);
  EXPECT_EQ(b.protection.without_sample(b.time_us + 10'000).raised, 0U);
}

TEST(Protection, AWatchdogResetIsAFaultUntilItIsCleared) {
  ProtectionBench b;
  b.inputs.board_fault = true;
  b.step();
  b.inputs.board_fault = false;
  b.inputs.request = Request::drive;
  b.run(50);
  EXPECT_EQ(b.protection.decision().faults, bit(Fault::internal_fault));
  EXPECT_FALSE(b.protection.decision().outputs.any_closed());
  b.inputs.request = Request::none;
  b.inputs.clear = Clear::user;
  b.step();
  EXPECT_EQ(b.protection.decision().faults, 0U);
}

TEST(Protection, AFailedPrechargeAndAWeldedContactorReachTheTable) {
  ProtectionBench failed;
  failed.inputs.request = Request::drive;
  for (int k = 0; k < 60; ++k) {
    failed.dc_link_uv = 0;  // a short circuit
    failed.step();
  }
  EXPECT_NE(failed.protection.decision().faults & bit(Fault::precharge_failed), 0U);
  EXPECT_EQ(failed.protection.decision().state, ContactorState::safe);

  ProtectionBench welded;
  welded.drive_off();
  welded.load_ua = 0;
  welded.inputs.request = Request::none;
  welded.plus_welded = true;
  welded.run(20);
  welded.inputs.request = Request::drive;  // nothing discharges the DC link, so the next start finds the weld
  welded.run(20);
  EXPECT_EQ(welded.protection.decision().latched, bit(Fault::contactor_welded));
  EXPECT_EQ(welded.protection.decision().welded_pole, Pole::plus);

  ProtectionBench apart;
  apart.drive_off();
  std::uint64_t from = apart.time_us;
  for (int k = 0; k < 10 && apart.protection.decision().outputs.any_closed(); ++k) {
    apart.step();
    apart.inputs.link_plus_uv = 45'000'000;
    apart.sample.time_us = apart.time_us += apart.period;
    apart.protection.update(apart.sample, apart.estimate, apart.inputs);
  }
  EXPECT_TRUE((apart.protection.decision().faults & bit(Fault::contactor_not_closed)) == 0)
      << "a single reading is not a contactor fault";
  from = apart.time_us;
  while (apart.protection.decision().outputs.any_closed() && apart.time_us - from < 2'000'000) {
    apart.sample.time_us = apart.time_us += apart.period;
    apart.sample.cell_uv[3] += 1;
    apart.sample.pack_uv += 1;
    apart.protection.update(apart.sample, apart.estimate, apart.inputs);
  }
  EXPECT_NE(apart.protection.decision().faults & bit(Fault::contactor_not_closed), 0U);
  EXPECT_LE(apart.time_us - from, 600'000U);
}

TEST(Protection, WithoutAnyTemperatureForbidsChargingAndHalvesDriving) {
  ProtectionBench b;
  b.drive_off();
  b.change = [](auto& s) { s.temperature_cdegc.fill(measurement::no_temperature); };
  b.run(60);
  EXPECT_EQ(b.protection.decision().allowed.charge_ua, 0);
  EXPECT_NEAR(b.protection.decision().allowed.discharge_ua, 1'500'000, 20'000)
      << "half for the missing temperature, half for the fault";
}

TEST(Protection, AllowsNoCurrentUnlessTheContactorsAreClosedForIt) {
  ProtectionBench b;
  b.run(100);
  EXPECT_EQ(b.protection.decision().allowed.discharge_ua, 0);
  b.drive_off();
  EXPECT_GT(b.protection.decision().allowed.discharge_ua, 5'900'000);
  ProtectionBench closing;
  closing.inputs.request = Request::drive;
  while (closing.protection.decision().state != ContactorState::drive && closing.count < 100) closing.step();
  for (int k = 1; k < 20; ++k)
    EXPECT_LE(closing.step().allowed.discharge_ua, 120'000 * k) << "full current five seconds after closing";
  b.inputs.request = Request::none;
  EXPECT_EQ(b.step().allowed.discharge_ua, 0) << "in the same step";
}

TEST(Protection, BleedsWhileChargingAtTheTopAndNotWithAFaultThatOpens) {
  ProtectionBench b;
  b.inputs.request = Request::charge;
  b.estimate.soc_ppb = 960'000'000;
  b.estimate.cell_soc_ppb.fill(0);
  b.estimate.cell_soc_ppb[4] = 50'000'000;
  b.estimate.cell_sigma_ppb.fill(1'000'000);
  b.base_uv = 3'380'000;
  b.run(60);
  b.load_ua = 1'000'000;
  std::uint32_t all = 0;
  for (int k = 0; k < 200; ++k) all |= b.step().bleed;
  EXPECT_EQ(all, 1U << 4);
  EXPECT_GT(b.protection.decision().bleed_left_s, 3'600U);
  b.change = [](auto& s) { s.cell_uv[4] = measurement::no_reading; };
  b.run(20);
  EXPECT_EQ(b.protection.decision().bleed, 0U);
}

TEST(Protection, BleedsWithAWarningAndNotWithAFaultThatOpensAtOnce) {
  for (const bool severe : {false, true}) {
    ProtectionBench b;
    b.estimate.soc_ppb = 960'000'000;
    b.estimate.cell_soc_ppb.fill(0);
    b.estimate.cell_soc_ppb[4] = 50'000'000;
    b.estimate.cell_sigma_ppb.fill(1'000'000);
    b.change = [severe](auto& s) { s.cell_uv[9] = severe ? 3'900'000 : 3'660'000; };
    b.run(60);
    std::uint32_t all = 0;
    for (int k = 0; k < 200; ++k) all |= b.step().bleed;
    EXPECT_NE(b.protection.decision().faults, 0U);
    EXPECT_EQ(all, severe ? 0 : 1U << 4);
  }
}

TEST(Protection, AnIncompleteGroupIsAWarning) {
  ProtectionBench b;
  b.drive_off();
  b.inputs.group_incomplete = true;
  b.run(12);
  EXPECT_EQ(b.protection.decision().faults, bit(Fault::group_incomplete));
  EXPECT_EQ(b.protection.decision().state, ContactorState::drive);
  b.inputs.group_incomplete = false;
  b.run(60);
  EXPECT_EQ(b.protection.decision().faults, 0U);
}

TEST(Protection, AStorageFailureIsAWarningAndARejectedVoltageDerates) {
  ProtectionBench b;
  b.drive_off();
  b.inputs.storage_fault = true;
  EXPECT_EQ(b.step().faults, bit(Fault::storage_fault));
  EXPECT_EQ(b.protection.decision().first.fault, static_cast<std::uint8_t>(Fault::storage_fault));
  b.run(50);
  EXPECT_EQ(b.protection.decision().state, ContactorState::drive);
  EXPECT_GT(b.protection.decision().allowed.discharge_ua, 5'900'000) << "a warning has no other effect";
  b.inputs.storage_fault = false;
  b.run(10);
  EXPECT_EQ(b.protection.decision().faults, bit(Fault::storage_fault)) << "until it is cleared";
  b.inputs.clear = Clear::user;
  EXPECT_EQ(b.step().faults, 0U);
  b.estimate.voltage_rejected = true;
  b.run(625);
  EXPECT_EQ(b.protection.decision().faults, bit(Fault::current_implausible));
  EXPECT_NEAR(b.protection.decision().allowed.discharge_ua, 3'000'000, 20'000);
}

TEST(Protection, ReportsOnlyTheLatchedFaultsBeforeTheFirstSample) {
  const Protection<16> fresh(forklift_plan);
  EXPECT_EQ(fresh.decision().faults, 0U);
  EXPECT_EQ(fresh.decision().first.time_us, 0U);
  const Protection<16> p(forklift_plan, bit(Fault::short_circuit) | bit(Fault::cell_overvoltage));
  const Decision& d = p.decision();
  EXPECT_EQ(d.faults, bit(Fault::short_circuit)) << "only service ends it";
  EXPECT_EQ(d.latched, bit(Fault::short_circuit));
  EXPECT_EQ(d.raised, 0U);
  EXPECT_EQ(d.first.fault, no_fault);
  EXPECT_EQ(d.state, ContactorState::off);
  EXPECT_EQ(d.outputs, Outputs{});
  EXPECT_EQ(d.allowed.charge_ua, 0);
  EXPECT_EQ(d.allowed.discharge_ua, 0);
  EXPECT_EQ(d.bleed, 0U);
  EXPECT_EQ(d.bleed_left_s, 0U);
}

TEST(Protection, ServiceEndsAFaultLatchedBeforeTheStartAndNoLaterOne) {
  ProtectionBench b;
  b.protection = Protection<16>(forklift_plan, bit(Fault::short_circuit));
  b.inputs.request = Request::drive;
  b.run(110);
  EXPECT_EQ(b.protection.decision().state, ContactorState::safe) << "latched faults stay";
  b.inputs = {.clear = Clear::service};
  EXPECT_EQ(b.step().faults, 0U);
  EXPECT_EQ(b.protection.decision().latched, 0U);
  b.inputs = {};
  b.step();
  b.drive_off();
  b.load_ua = -60'000'000;
  b.step();
  b.load_ua = 0;
  b.run(150);
  b.inputs = {.clear = Clear::service};
  EXPECT_EQ(b.step().faults, bit(Fault::short_circuit)) << "only after a power cycle";
}

TEST(Protection, UsesTheSumOfTheCellsIfThePackReadingIsMissing) {
  ProtectionBench b;
  b.inputs.request = Request::drive;
  while (b.dc_link_uv < 45e6 && b.count < 100) b.step();
  ASSERT_EQ(b.protection.decision().state, ContactorState::precharge);
  b.sample.time_us += b.period;
  b.sample.pack_uv = measurement::no_reading;
  std::int32_t sum_uv = 0;
  for (const std::int32_t uv : b.sample.cell_uv) sum_uv += uv;
  b.inputs.link_plus_uv = sum_uv / 50 * 49 - 50;
  EXPECT_EQ(b.protection.update(b.sample, b.estimate, b.inputs).state, ContactorState::precharge);
  b.sample.time_us += b.period;
  b.inputs.link_plus_uv = sum_uv / 50 * 49 + 50;
  EXPECT_EQ(b.protection.update(b.sample, b.estimate, b.inputs).state, ContactorState::drive);
}

TEST(Protection, OpensForAPackOfOneCell) {
  PackDesign one = forklift;
  one.cells = 1;
  one.temperatures = 1;
  const ProtectionPlan plan = protection_plan(one);
  Protection<1> p(plan);
  measurement::PackSample<1> s;
  PackEstimate<1> e;
  ExternalInputs inputs{.request = Request::drive};
  double dc_link_uv = 0;
  for (int k = 1; k < 120; ++k) {
    s.time_us = 100'000U * static_cast<unsigned>(k);
    s.current_ua = 0;
    s.cell_uv[0] = s.pack_uv = k < 80 ? 3'300'000 + k : 1'700'000;
    s.temperature_cdegc[0] = 2'500;
    const Outputs out = p.decision().outputs;
    if (out.main_plus)
      dc_link_uv = s.pack_uv;
    else
      dc_link_uv = out.precharge && out.main_minus ? dc_link_uv + (s.pack_uv - dc_link_uv) * 0.18 : dc_link_uv * 0.9;
    set_poles(inputs, out, s.pack_uv, dc_link_uv);
    p.update(s, e, inputs);
    if (k == 79) {
      ASSERT_EQ(p.decision().state, ContactorState::drive);
    }
  }
  EXPECT_FALSE(p.decision().outputs.any_closed());
  EXPECT_NE(p.decision().faults & bit(Fault::cell_undervoltage_severe), 0U);
}

/// Sixteen cells made from the cell of the shipped shift, each with its own offset, resistance and noise. The shift is
/// sampled once a second, which the design of the pack states.
TEST(Protection, IsSilentOverTheShippedShiftWithThreeSigmaNoise) {
  const std::vector<tests::ShiftRow> shift = tests::forklift_shift(BMS_SOURCE_DIR);
  PackDesign design = forklift;
  design.sample_period_s = 1;
  design.precharge_time_constant_s = 2;
  const ProtectionPlan plan = protection_plan(design);
  Protection<16> p(plan);
  plant::Random random(1);
  const auto noise = [&](double sigma) { return 3 * sigma * std::clamp(random.normal() / 3, -1.0, 1.0); };
  ExternalInputs inputs{.request = Request::drive};
  double dc_link_v = 0;
  std::size_t driven = 0;
  for (const tests::ShiftRow& row : shift) {
    measurement::PackSample<16> s;
    const Outputs out = p.decision().outputs;
    const bool closed = out.main_plus && out.main_minus;
    s.time_us = static_cast<std::uint64_t>(1e6 * row.time_s);
    s.current_ua = static_cast<std::int32_t>(1e6 * ((closed ? row.current_a : 0) + noise(0.01)));
    double sum_v = 0;
    for (std::size_t k = 0; k < 16; ++k) {
      const double off_v = 0.004 * (static_cast<double>(k % 7) - 3),
                   more_ohm = 0.001 * (static_cast<double>(k % 5) - 2);
      const double v = row.voltage_v + off_v + more_ohm * row.current_a;
      sum_v += v;
      s.cell_uv[k] = static_cast<std::int32_t>(1e6 * (std::round((v + noise(0.001)) * 1e3) / 1e3));
    }
    s.pack_uv = static_cast<std::int32_t>(1e6 * (sum_v + noise(0.02)));
    for (std::size_t k = 0; k < 4; ++k)
      s.temperature_cdegc[k] =
          static_cast<std::int16_t>(100 * row.temperature_c + 30 * static_cast<double>(k) + noise(5));
    if (closed)
      dc_link_v = sum_v;
    else
      dc_link_v = out.precharge && out.main_minus ? dc_link_v + (sum_v - dc_link_v) * 0.39 : dc_link_v * 0.9;
    set_poles(inputs, out, 1e6 * sum_v, 1e6 * dc_link_v);
    const Decision& d = p.update(s, PackEstimate<16>{}, inputs);
    ASSERT_EQ(d.faults, 0U) << row.time_s << " s";
    driven += d.state == ContactorState::drive ? 1U : 0U;
  }
  EXPECT_GT(driven, shift.size() - 60);
}

TEST(Protection, DecidesTheSameOnHostAndBoard) { EXPECT_EQ(scenario_hash(1'000), expected_scenario_hash); }

}  // namespace
}  // namespace bms::protection
