// Protection without samples, without readings, and with a clock that stops or jumps.
#include "protection/protection.hpp"

#include <functional>
#include <set>
#include <tuple>
#include <vector>

#include <gtest/gtest.h>

#include "tests/firmware/protection/protection_bench.hpp"

namespace bms::protection {
namespace {

TEST(Protection, WithoutSamplesOpensAfterFivePeriodsAndNeedsANewRequestToClose) {
  ProtectionBench b;
  b.drive_off();
  const std::uint64_t last = b.time_us;
  std::uint64_t opened = 0;
  for (std::uint64_t now = last; now < last + 2'000'000 && opened == 0; now += 10'000) {
    if (!b.protection.without_sample(now).outputs.any_closed()) opened = now - last;
  }
  EXPECT_GT(opened, 500'000U);
  EXPECT_LE(opened, 520'000U);
  EXPECT_EQ(b.protection.decision().allowed.discharge_ua, 0);
  EXPECT_NE(b.protection.decision().faults & bit(Fault::samples_missing), 0U);
  b.time_us = last + 2'000'000;
  b.load_ua = 0;
  b.run(300);
  EXPECT_EQ(b.protection.decision().faults, 0U) << "samples have returned";
  EXPECT_EQ(b.protection.decision().state, ContactorState::safe);
  b.inputs.request = Request::none;
  b.step();
  b.inputs.request = Request::drive;
  b.run(60);
  EXPECT_EQ(b.protection.decision().state, ContactorState::drive);
}

TEST(Protection, WithoutSamplesOpensFromEveryState) {
  std::set<ContactorState> tried;
  for (int steps = 1; steps < 60; ++steps) {
    for (const Request r : {Request::drive, Request::charge}) {
      ProtectionBench b;
      b.inputs.request = r;
      b.run(steps);
      if (steps > 50) {  // also while it waits for a load to cease
        b.load_ua = -3'000'000;
        b.step();
        b.inputs.request = Request::none;
        b.run(2);
      }
      tried.insert(b.protection.decision().state);
      for (std::uint64_t after_us = 10'000; after_us <= 520'000; after_us += 10'000)
        b.protection.without_sample(b.time_us + after_us);
      ASSERT_FALSE(b.protection.decision().outputs.any_closed()) << steps;
      ASSERT_EQ(b.protection.decision().allowed.discharge_ua, 0);
      ASSERT_EQ(b.protection.decision().allowed.charge_ua, 0);
    }
  }
  EXPECT_TRUE(tried.contains(ContactorState::self_test) && tried.contains(ContactorState::precharge) &&
              tried.contains(ContactorState::drive) && tried.contains(ContactorState::charge) &&
              tried.contains(ContactorState::unloading));
}

/// Of four thermistors at four cells: that of the hot or cold cell is lost, the other cells are at 25 degrees C.
TEST(Protection, AFaultOfACellThatIsTooHotOrTooColdDoesNotEndWithTheLossOfItsThermistor) {
  struct Case {
    Fault fault;
    int celsius;
  };
  constexpr Case cases[] = {{Fault::overtemperature_warning, 56},
                            {Fault::overtemperature, 63},
                            {Fault::charge_overtemperature, 47},
                            {Fault::undertemperature, -23},
                            {Fault::charge_undertemperature, -3}};
  for (const std::int16_t lost : {measurement::no_temperature, measurement::shorted_thermistor}) {
    for (const Case& c : cases) {
      ProtectionBench b;
      const auto reads = [&](auto with) { b.change = [&b, with](auto& s) { s.temperature_cdegc[2] = with(b.count); }; };
      reads([&](auto count) { return static_cast<std::int16_t>(100 * c.celsius + static_cast<int>(count % 3)); });
      b.run(100);
      ASSERT_TRUE(has(b.protection.decision().faults, c.fault)) << c.celsius;
      reads([&](auto) { return lost; });
      b.run(10 * 600);
      EXPECT_TRUE(has(b.protection.decision().faults, c.fault)) << c.celsius << " ends while nobody knows";
      EXPECT_TRUE(has(b.protection.decision().faults, Fault::temperature_lost));
      reads([](auto count) { return static_cast<std::int16_t>(2'500 + static_cast<int>(count % 3)); });
      b.run(10 * 130);
      EXPECT_EQ(b.protection.decision().faults, 0U) << c.celsius << ": it has cooled down, and is known to have";
    }
  }
}

/// The others still raise.
TEST(Protection, WithALostThermistorAnotherCellThatBecomesTooHotIsAFault) {
  ProtectionBench b;
  b.change = [&b](auto& s) {
    s.temperature_cdegc[2] = measurement::no_temperature;
    if (b.count > 100) s.temperature_cdegc[0] = static_cast<std::int16_t>(6'300 + b.count % 3);
  };
  b.run(100);
  EXPECT_FALSE(has(b.protection.decision().faults, Fault::overtemperature));
  b.run(60);
  EXPECT_TRUE(has(b.protection.decision().faults, Fault::overtemperature));
}

TEST(Protection, CountsSamplesWithAStoppedOrReversedClockAsMissing) {
  for (const std::int64_t jump : {std::int64_t{0}, std::int64_t{-5'000'000}}) {
    ProtectionBench b;
    b.drive_off();
    for (int k = 1; k <= 5; ++k) {
      b.time_us = static_cast<std::uint64_t>(static_cast<std::int64_t>(b.time_us) + jump) - b.period;
      b.step();
      EXPECT_EQ(b.protection.decision().outputs.any_closed(), k < 5) << k;
    }
  }
}

TEST(Protection, AllowsARepeatedSampleNowAndThen) {
  ProtectionBench b;
  b.drive_off();
  for (int k = 0; k < 40; ++k) {
    for (int again = 0; again < 4; ++again) b.protection.update(b.sample, b.estimate, b.inputs);
    EXPECT_EQ(b.step().faults, 0U) << k;
    EXPECT_EQ(b.protection.decision().state, ContactorState::drive);
  }
}

/// A silent front end or node: samples arrive without readings.
TEST(Protection, CountsSamplesWithoutReadingsAsMissing) {
  ProtectionBench b;
  b.drive_off();
  const std::uint64_t last = b.time_us;
  measurement::PackSample<16> empty;
  empty.temperature_cdegc[2] = measurement::shorted_thermistor;  // no reading either
  for (empty.time_us = last + 100'000; empty.time_us <= last + 600'000; empty.time_us += 100'000) {
    b.protection.update(empty, b.estimate, b.inputs);
    EXPECT_EQ(b.protection.decision().outputs.any_closed(), empty.time_us - last <= 500'000) << empty.time_us - last;
  }
  EXPECT_EQ(b.protection.decision().faults, bit(Fault::samples_missing));
  for (const auto one : {0, 1, 2, 3}) {  // a single reading makes it a sample
    measurement::PackSample<16> s;
    s.time_us = empty.time_us += 100'000;
    if (one == 0) s.current_ua = 0;
    if (one == 1) s.pack_uv = 52'000'000;
    if (one == 2) s.cell_uv[15] = 3'300'000;
    if (one == 3) s.temperature_cdegc[3] = 2'000;
    Protection<16> p(forklift_plan);
    for (int k = 0; k < 10; ++k) {
      p.update(s, b.estimate, b.inputs);
      s.time_us += 100'000;
    }
    EXPECT_EQ(p.decision().faults & bit(Fault::samples_missing), 0U) << one;
    EXPECT_NE(p.decision().faults & bit(Fault::voltage_missing), 0U) << one;
  }
}

TEST(Protection, AWatchdogResetIsAFaultEvenIfNothingIsMeasured) {
  Protection<16> p(forklift_plan);
  measurement::PackSample<16> empty;
  ExternalInputs inputs{.board_fault = true};
  empty.time_us = 100'000;
  p.update(empty, {}, inputs);
  EXPECT_EQ(p.decision().faults, bit(Fault::internal_fault));
}

TEST(Protection, WithoutASampleAfterTheStartTimeReportsAFault) {
  Protection<16> p(forklift_plan);
  for (std::uint64_t now = 0; now <= 3'000'000; now += 10'000)
    EXPECT_EQ(p.without_sample(now).faults, 0U) << "the start time of the front end";
  EXPECT_NE(p.without_sample(3'000'001).faults & bit(Fault::samples_missing), 0U);
  EXPECT_FALSE(p.decision().outputs.any_closed());
}

TEST(Protection, AfterTheFirstSampleWaitsOnlyForTheTimeInTheTable) {
  ProtectionBench b;
  for (int k = 0; k < 7; ++k) b.protection.without_sample(b.time_us += b.period);
  b.step();
  EXPECT_EQ(b.protection.without_sample(b.time_us + 500'000).faults, 0U);
  EXPECT_EQ(b.protection.without_sample(b.time_us + 500'001).faults, bit(Fault::samples_missing));
}

TEST(Protection, FollowsARequestMadeBeforeTheFirstSample) {
  ProtectionBench b;
  b.inputs.request = Request::drive;
  const measurement::PackSample<16> empty;
  for (int k = 0; k < 15; ++k) {
    measurement::PackSample<16> s = empty;
    s.time_us = b.time_us += b.period;
    EXPECT_EQ(b.protection.update(s, {}, b.inputs).state, ContactorState::off);
  }
  for (int k = 0; k < 40; ++k) b.step();
  EXPECT_EQ(b.protection.decision().state, ContactorState::drive);
  EXPECT_EQ(b.protection.decision().faults, 0U);
}

/// A run that begins shortly before the clock wraps gives the same decisions as a run that begins at 0.
TEST(Protection, DecidesTheSameAcrossAWrapOfTheClock) {
  const auto run = [](std::uint64_t start_us) {
    ProtectionBench b(start_us);
    std::vector<std::tuple<FaultSet, int, bool, std::int32_t, std::uint64_t>> all;
    b.inputs.request = Request::drive;
    for (int k = 0; k < 900; ++k) {
      if (k == 60) b.load_ua = -3'000'000;
      b.change = k > 100 && k < 180
                     ? std::function<void(measurement::PackSample<16>&)>([](auto& s) { s.cell_uv[2] = 3'720'000; })
                     : nullptr;
      if (k >= 300 && k < 309) {
        b.time_us += b.period;
        b.protection.without_sample(b.time_us);
      } else {
        b.step();
      }
      const Decision& d = b.protection.decision();
      all.emplace_back(d.faults, static_cast<int>(d.state), d.outputs.any_closed(), d.allowed.charge_ua,
                       d.first.fault == no_fault ? 0 : d.first.time_us - start_us);
    }
    return all;
  };
  const auto from_zero = run(0);
  EXPECT_NE(std::get<0>(from_zero[175]), 0U);
  EXPECT_NE(std::get<0>(from_zero[310]) & bit(Fault::samples_missing), 0U);
  for (const std::uint64_t wrap :
       {std::uint64_t{1} << 32, std::uint64_t{0}, std::uint64_t{1} << 63, std::uint64_t{1} << 31}) {
    for (const std::uint64_t before_us : {14'000'000U, 30'500'000U})
      EXPECT_EQ(run(wrap - before_us), from_zero) << wrap << ' ' << before_us;
  }
}

TEST(Protection, WithoutSamplesBleedsNothing) {
  ProtectionBench b;
  b.estimate.soc_ppb = 960'000'000;
  b.estimate.cell_soc_ppb.fill(0);
  b.estimate.cell_soc_ppb[4] = 50'000'000;
  b.estimate.cell_sigma_ppb.fill(1'000'000);
  while (b.step().bleed == 0 && b.count < 300) {
  }
  ASSERT_NE(b.protection.decision().bleed, 0U);
  EXPECT_EQ(b.protection.without_sample(b.time_us + 600'000).bleed, 0U);
  const std::uint32_t left_s = b.protection.decision().bleed_left_s;
  b.time_us += 50'000'000;
  b.step();
  EXPECT_NEAR(b.protection.decision().bleed_left_s, left_s, 2) << "not counted as bled";
}

TEST(Protection, AHeldKeyCountsOnceOverAGapOfTheSamples) {
  ProtectionBench b;
  b.inputs.clear = Clear::user;
  b.inputs.storage_fault = true;
  b.run(3);
  b.inputs.storage_fault = false;
  for (int k = 0; k < 10; ++k) b.protection.without_sample(b.time_us += b.period);
  b.step();
  EXPECT_NE(b.protection.decision().faults & bit(Fault::storage_fault), 0U) << "no new command";
}

TEST(Protection, IsClearedEvenWhileNothingIsMeasured) {
  Protection<16> p(forklift_plan);
  measurement::PackSample<16> empty;
  for (int k = 1; k <= 60; ++k) {
    empty.time_us = 100'000U * static_cast<unsigned>(k);
    p.update(empty, {}, {.clear = k == 50 ? Clear::user : Clear::none, .board_fault = k == 1});
    if (k == 49) {
      ASSERT_EQ(p.decision().faults, bit(Fault::internal_fault) | bit(Fault::samples_missing));
    }
  }
  EXPECT_EQ(p.decision().faults, bit(Fault::samples_missing));
}

TEST(Protection, CountsAGapAsAtMostAMinute) {
  ProtectionBench b;
  b.drive_off();
  b.load_ua = -7'200'000;  // the overload integral grows by 0.31 s per second: 18 s in a minute, limit 30 s
  b.run(2);
  ASSERT_EQ(b.protection.decision().faults, 0U);
  b.time_us += 600'000'000;
  b.step();
  EXPECT_EQ(b.protection.decision().faults, bit(Fault::samples_missing) | bit(Fault::allowed_current_exceeded))
      << "and no overcurrent";
  ProtectionBench cold;  // recovers after a minute, which a single step may last
  cold.change = [](auto& s) { s.temperature_cdegc.fill(-100); };
  cold.run(60);
  ASSERT_EQ(cold.protection.decision().faults, bit(Fault::charge_undertemperature));
  cold.change = nullptr;
  cold.step();
  cold.time_us += 60'000'000 - cold.period;
  EXPECT_EQ(cold.step().faults & bit(Fault::charge_undertemperature), 0U);
}

/// To the microsecond: without readings, opening takes five seconds.
TEST(Protection, CountsNoTimeWithAStoppedClock) {
  ProtectionBench b;
  b.drive_off();
  const std::uint64_t open_us = b.time_us + 500'001;
  EXPECT_EQ(b.protection.without_sample(open_us).state, ContactorState::opening);
  for (int k = 1; k < 50; ++k) b.protection.without_sample(open_us + 100'000U * static_cast<unsigned>(k));
  for (int k = 0; k < 100; ++k)
    EXPECT_EQ(b.protection.without_sample(open_us + 4'999'999).state, ContactorState::opening);
  EXPECT_EQ(b.protection.without_sample(open_us + 5'000'000).state, ContactorState::safe);
}

}  // namespace
}  // namespace bms::protection
