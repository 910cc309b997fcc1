// Protection as the firmware sees it: samples in, decisions out.
#include "protection/protection.hpp"

#include <cmath>
#include <cstring>
#include <functional>
#include <set>
#include <tuple>
#include <vector>

#include <gtest/gtest.h>

#include "files/recording.hpp"
#include "plant/random.hpp"
#include "tests/protection/expected_rows.hpp"
#include "tests/protection/scenario.hpp"

namespace bms::protection {
namespace {

constexpr ProtectionPlan pack = protection_plan(forklift);

/// A pack on the bench in a state that can be asked for; readings always move a little.
struct Bench {
  explicit Bench(std::uint64_t start_us = 0, const ProtectionPlan& plan = pack, std::uint32_t period_us = 100'000)
      : protection(plan), time_us(start_us), period(period_us) {
    estimate.soc_ppb = 600'000'000;
  }
  const Decision& step() {
    sample.time_us = time_us += period;
    ++count;
    const Outputs out = protection.decision().outputs;
    closed = out.main_plus && out.main_minus;
    for (std::size_t k = 0; k < 16; ++k)
      sample.cell_uv[k] = base_uv + static_cast<std::int32_t>(500 * ((count + k) % 3));
    for (std::size_t k = 0; k < 4; ++k)
      sample.temperature_cdegc[k] = static_cast<std::int16_t>(2'500 + (count + k) % 5);
    sample.current_ua = closed ? load_ua : 0;
    if (change) change(sample);
    std::int64_t sum = 0;
    for (const std::int32_t uv : sample.cell_uv) sum += uv;
    sample.pack_uv = static_cast<std::int32_t>(sum);
    if (closed)
      dc_link_uv = static_cast<double>(sample.pack_uv);
    else if (out.precharge && out.main_minus)
      dc_link_uv += (static_cast<double>(sample.pack_uv) - dc_link_uv) * 0.18;
    else
      dc_link_uv *= 0.97;
    inputs.dc_link_uv = static_cast<std::int32_t>(dc_link_uv);
    return protection.update(sample, estimate, inputs);
  }
  void run(int steps) {
    for (int k = 0; k < steps; ++k) step();
  }
  void drive_off() {
    inputs.request = Request::drive;
    for (int k = 0; k < 100 && protection.decision().state != ContactorState::drive; ++k) step();
    load_ua = -3'000'000;
    run(60);
    ASSERT_EQ(protection.decision().state, ContactorState::drive);
    ASSERT_EQ(protection.decision().faults, 0U);
  }

  Protection<16> protection;
  measurement::PackSample<16> sample;
  PackEstimate<16> estimate;
  ExternalInputs inputs;
  std::uint64_t time_us;
  std::uint32_t period, count = 0;
  std::int32_t base_uv = 3'300'000, load_ua = 0;
  double dc_link_uv = 0;
  bool closed = false;
  std::function<void(measurement::PackSample<16>&)> change;
};

TEST(Protection, OpensTheContactorsWithin300msOfASevereOvervoltage) {
  Bench b;
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

TEST(Protection, OpensOnTheFirstSampleOfAShortCircuitAndKeepsItForTheWorkshop) {
  Bench b;
  b.drive_off();
  b.load_ua = -60'000'000;
  EXPECT_FALSE(b.step().outputs.any_closed());
  EXPECT_EQ(b.protection.decision().latched, bit(Fault::short_circuit));
}

TEST(Protection, TellsTheTruckToStopBeforeItOpensAndOpensWhenTheTruckDoesNot) {
  for (const bool obeys : {true, false}) {
    Bench b;
    b.drive_off();
    b.base_uv = 1'950'000;
    double told_s = -1, opened_s = -1;
    for (int k = 1; k < 400 && opened_s < 0; ++k) {
      const Decision& d = b.step();
      if (told_s < 0 && d.allowed.discharge_ua == 0) told_s = k / 10.0;
      if (obeys && told_s >= 0) b.load_ua = 0;
      if (!d.outputs.any_closed()) opened_s = k / 10.0;
    }
    EXPECT_GT(told_s, 0.5) << "ramped, not cut";
    EXPECT_LE(told_s, 2.2);
    if (obeys) {
      EXPECT_EQ(opened_s, -1);
    } else {
      EXPECT_NEAR(opened_s, 2.1 + 5.0, 0.2) << "two seconds of delay, five of grace";
    }
  }
}

TEST(Protection, WithoutSamplesOpensAfterFivePeriodsAndTakesAnewRequestToClose) {
  Bench b;
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
  EXPECT_EQ(b.protection.decision().faults, 0U) << "samples are back";
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
      Bench b;
      b.inputs.request = r;
      b.run(steps);
      if (steps > 50) {  // and while it waits for a load to cease
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

TEST(Protection, WithThePlanOfAnotherPackClosesNothing) {
  PackDesign other = forklift;
  other.cells = 15;
  const ProtectionPlan plan_of_15 = protection_plan(other);
  Bench b(0, plan_of_15);
  b.inputs.request = Request::drive;
  b.run(100);
  EXPECT_NE(b.protection.decision().faults & bit(Fault::internal_fault), 0U);
  EXPECT_FALSE(b.protection.decision().outputs.any_closed());
}

TEST(Protection, CountsSamplesOfAClockThatStandsOrGoesBackAsNone) {
  for (const std::int64_t jump : {std::int64_t{0}, std::int64_t{-5'000'000}}) {
    Bench b;
    b.drive_off();
    for (int k = 1; k <= 5; ++k) {
      b.time_us = static_cast<std::uint64_t>(static_cast<std::int64_t>(b.time_us) + jump) - b.period;
      b.step();
      EXPECT_EQ(b.protection.decision().outputs.any_closed(), k < 5) << k;
    }
  }
}

TEST(Protection, ASampleThatComesTwiceNowAndThenIsNoClockThatStands) {
  Bench b;
  b.drive_off();
  for (int k = 0; k < 40; ++k) {
    for (int again = 0; again < 4; ++again) b.protection.update(b.sample, b.estimate, b.inputs);
    EXPECT_EQ(b.step().faults, 0U) << k;
    EXPECT_EQ(b.protection.decision().state, ContactorState::drive);
  }
}

/// A front end that does not answer, a node that is silent: samples come, and nothing was read.
TEST(Protection, CountsSamplesOfWhichNothingWasReadAsNone) {
  Bench b;
  b.drive_off();
  const std::uint64_t last = b.time_us;
  measurement::PackSample<16> nothing;
  for (nothing.time_us = last + 100'000; nothing.time_us <= last + 600'000; nothing.time_us += 100'000) {
    b.protection.update(nothing, b.estimate, b.inputs);
    EXPECT_EQ(b.protection.decision().outputs.any_closed(), nothing.time_us - last <= 500'000)
        << nothing.time_us - last;
  }
  EXPECT_EQ(b.protection.decision().faults, bit(Fault::samples_missing));
  for (const auto one : {0, 1, 2, 3}) {  // what has a single reading is a sample
    measurement::PackSample<16> s;
    s.time_us = nothing.time_us += 100'000;
    if (one == 0) s.current_ua = 0;
    if (one == 1) s.pack_uv = 52'000'000;
    if (one == 2) s.cell_uv[15] = 3'300'000;
    if (one == 3) s.temperature_cdegc[3] = 2'000;
    Protection<16> p(pack);
    for (int k = 0; k < 10; ++k) {
      p.update(s, b.estimate, b.inputs);
      s.time_us += 100'000;
    }
    EXPECT_EQ(p.decision().faults & bit(Fault::samples_missing), 0U) << one;
    EXPECT_NE(p.decision().faults & bit(Fault::voltage_missing), 0U) << one;
  }
}

TEST(Protection, AResetByTheWatchdogIsAFaultAlsoWhenNothingIsMeasured) {
  Protection<16> p(pack);
  measurement::PackSample<16> nothing;
  ExternalInputs inputs{.board_fault = true};
  nothing.time_us = 100'000;
  p.update(nothing, {}, inputs);
  EXPECT_EQ(p.decision().faults, bit(Fault::internal_fault));
}

TEST(Protection, SaysOnceThatAFaultCame) {
  Bench b;
  b.drive_off();
  b.change = [](auto& s) { s.cell_uv[9] = 3'900'000; };
  while ((b.protection.decision().faults & bit(Fault::cell_overvoltage_severe)) == 0) b.step();
  ASSERT_NE(b.protection.decision().raised, 0U);
  b.time_us -= b.period;  // the next is no later
  EXPECT_EQ(b.step().raised, 0U);
  EXPECT_EQ(b.protection.without_sample(b.time_us + 10'000).raised, 0U);
}

TEST(Protection, WithoutASampleFromTheStartSaysSo) {
  Protection<16> p(pack);
  for (std::uint64_t now = 0; now <= 3'000'000; now += 10'000)
    EXPECT_EQ(p.without_sample(now).faults, 0U) << "a front end is not asked sooner";
  EXPECT_NE(p.without_sample(3'000'001).faults & bit(Fault::samples_missing), 0U);
  EXPECT_FALSE(p.decision().outputs.any_closed());
}

TEST(Protection, ThatHadASampleWaitsNoLongerThanTheTableSays) {
  Bench b;
  for (int k = 0; k < 7; ++k) b.protection.without_sample(b.time_us += b.period);
  b.step();
  EXPECT_EQ(b.protection.without_sample(b.time_us + 500'000).faults, 0U);
  EXPECT_EQ(b.protection.without_sample(b.time_us + 500'001).faults, bit(Fault::samples_missing));
}

TEST(Protection, ATruckThatAskedBeforeTheFirstSampleGetsItsPower) {
  Bench b;
  b.inputs.request = Request::drive;
  const measurement::PackSample<16> nothing;
  for (int k = 0; k < 15; ++k) {
    measurement::PackSample<16> s = nothing;
    s.time_us = b.time_us += b.period;
    EXPECT_EQ(b.protection.update(s, {}, b.inputs).state, ContactorState::off);
  }
  for (int k = 0; k < 40; ++k) b.step();
  EXPECT_EQ(b.protection.decision().state, ContactorState::drive);
  EXPECT_EQ(b.protection.decision().faults, 0U);
}

/// The same run, begun shortly before the clock wraps, gives the same decisions as one begun at 0.
TEST(Protection, DecidesTheSameAcrossAWrapOfTheClock) {
  const auto run = [](std::uint64_t start_us) {
    Bench b(start_us);
    std::vector<std::tuple<std::uint32_t, int, bool, std::int32_t, std::uint64_t>> all;
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

TEST(Protection, EndsInSafeWithAnInternalFaultAfterEveryOneAndEveryTwoFlippedBitsOfTheStoredState) {
  Bench closed;
  closed.drive_off();
  // where the state lies: the three words that hold drive, inverted, and against the pattern
  std::array<std::uint32_t, sizeof(Contactors) / 4> words{};
  std::memcpy(words.data(), static_cast<void*>(&closed.protection.contactors()), sizeof(Contactors));
  std::size_t at = 0;
  while (at + 2 < words.size() && !(words[at] == 3 && words[at + 1] == ~3U)) ++at;
  ASSERT_LT(at + 2, words.size());
  std::size_t tried = 0;
  for (std::size_t a = 0; a < 96; ++a) {
    for (std::size_t b = a; b < 96; ++b) {
      Bench copy = closed;
      auto flipped = words;
      flipped[at + a / 32] ^= 1U << (a % 32);
      if (a != b) flipped[at + b / 32] ^= 1U << (b % 32);
      std::memcpy(static_cast<void*>(&copy.protection.contactors()), flipped.data(), sizeof(Contactors));
      const Decision& d = copy.step();
      ASSERT_EQ(d.state, ContactorState::safe) << a << ' ' << b;
      ASSERT_FALSE(d.outputs.any_closed());
      ASSERT_NE(d.faults & bit(Fault::internal_fault), 0U);
      ASSERT_EQ(d.allowed.discharge_ua, 0);
      ++tried;
    }
  }
  EXPECT_EQ(tried, 96U * 97 / 2);
}

TEST(Protection, EndsInSafeWithAnInternalFaultAfterAnyFlippedBitOfTheSetOfFaults) {
  Bench closed;
  closed.drive_off();
  using Words = std::array<std::uint32_t, sizeof(Protection<16>) / 4>;
  Words words{};
  std::memcpy(words.data(), static_cast<void*>(&closed.protection), sizeof words);
  std::size_t at = 0;  // no fault, inverted, and against the pattern
  while (at + 2 < words.size() && !(words[at] == 0 && words[at + 1] == ~0U && words[at + 2] == 0x5A3C'96A5)) ++at;
  ASSERT_LT(at + 2, words.size());
  for (std::size_t a = 0; a < 96; ++a) {
    Bench copy = closed;
    Words flipped = words;
    flipped[at + a / 32] ^= 1U << (a % 32);
    std::memcpy(static_cast<void*>(&copy.protection), flipped.data(), sizeof flipped);
    const Decision& d = copy.step();
    EXPECT_EQ(d.state, ContactorState::opening) << a;
    EXPECT_FALSE(d.outputs.any_closed());
    EXPECT_NE(d.faults & bit(Fault::internal_fault), 0U);
    copy.load_ua = 0;
    copy.run(60);
    EXPECT_EQ(copy.protection.decision().state, ContactorState::safe);
    EXPECT_NE(copy.protection.decision().faults & bit(Fault::internal_fault), 0U) << "until it is cleared";
  }
}

TEST(Protection, ForgetsNoFaultByAFlippedBitOfIt) {
  Bench b;
  b.drive_off();
  b.inputs.storage_fault = true;
  b.step();
  b.inputs.storage_fault = false;  // it stays until it is cleared
  b.step();
  constexpr std::uint32_t there = bit(Fault::storage_fault);
  std::array<std::uint32_t, sizeof(Protection<16>) / 4> words{};
  std::memcpy(words.data(), static_cast<void*>(&b.protection), sizeof words);
  std::size_t at = 0;
  while (at + 2 < words.size() &&
         !(words[at] == there && words[at + 1] == ~there && words[at + 2] == (there ^ 0x5A3C'96A5)))
    ++at;
  ASSERT_LT(at + 2, words.size());
  for (std::size_t copy = 0; copy < 3; ++copy) {
    Bench flipped = b;
    auto with_flip = words;
    with_flip[at + copy] ^= there;
    std::memcpy(static_cast<void*>(&flipped.protection), with_flip.data(), sizeof with_flip);
    EXPECT_EQ(flipped.step().faults, there | bit(Fault::internal_fault)) << copy;
  }
}

/// Any bit of all that protection keeps, not only of what is guarded: contactors open, or nothing that a later step
/// does not mend.
TEST(Protection, NeverClosesAgainstASevereFaultWhateverBitFlips) {
  Bench b;
  b.drive_off();
  b.change = [](auto& s) { s.cell_uv[0] = 4'000'000; };
  plant::Random random(11);
  for (int trial = 0; trial < 4'000; ++trial) {
    Bench copy = b;
    auto* byte = reinterpret_cast<unsigned char*>(&copy.protection.contactors());
    const std::size_t place =
        sizeof(void*) +
        static_cast<std::size_t>(random.uniform() *
                                 (sizeof(Contactors) - sizeof(void*)));  // all but the pointer to the plan
    byte[place] = static_cast<unsigned char>(byte[place] ^ (1U << (random.bits() % 8)));
    for (int k = 0; k < 4; ++k) copy.step();
    ASSERT_FALSE(copy.protection.decision().outputs.any_closed()) << place;
  }
}

TEST(Protection, AResetByTheWatchdogIsAFaultUntilItIsCleared) {
  Bench b;
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
  Bench failed;
  failed.inputs.request = Request::drive;
  for (int k = 0; k < 60; ++k) {
    failed.dc_link_uv = 0;
    failed.step();
  }
  EXPECT_NE(failed.protection.decision().faults & bit(Fault::precharge_failed), 0U);
  EXPECT_EQ(failed.protection.decision().state, ContactorState::safe);

  Bench welded;
  welded.drive_off();
  welded.load_ua = 0;
  welded.inputs.request = Request::none;
  for (int k = 0; k < 80; ++k) {
    welded.step();
    welded.dc_link_uv = 52.8e6;
  }
  EXPECT_EQ(welded.protection.decision().latched, bit(Fault::contactor_welded));

  Bench apart;
  apart.drive_off();
  std::uint64_t from = apart.time_us;
  for (int k = 0; k < 10 && apart.protection.decision().outputs.any_closed(); ++k) {
    apart.step();
    apart.inputs.dc_link_uv = 40'000'000;
    apart.sample.time_us = apart.time_us += apart.period;
    apart.protection.update(apart.sample, apart.estimate, apart.inputs);
  }
  EXPECT_TRUE((apart.protection.decision().faults & bit(Fault::contactor_not_closed)) == 0)
      << "a reading now and then is no contactor";
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
  Bench b;
  b.drive_off();
  b.change = [](auto& s) { s.temperature_cdegc.fill(measurement::no_temperature); };
  b.run(60);
  EXPECT_EQ(b.protection.decision().allowed.charge_ua, 0);
  EXPECT_NEAR(b.protection.decision().allowed.discharge_ua, 1'500'000, 20'000)
      << "half for not knowing, half for the fault";
}

TEST(Protection, AllowsNoCurrentUnlessTheContactorsAreClosedForIt) {
  Bench b;
  b.run(100);
  EXPECT_EQ(b.protection.decision().allowed.discharge_ua, 0);
  b.drive_off();
  EXPECT_GT(b.protection.decision().allowed.discharge_ua, 5'900'000);
  Bench closing;
  closing.inputs.request = Request::drive;
  while (closing.protection.decision().state != ContactorState::drive && closing.count < 100) closing.step();
  for (int k = 1; k < 20; ++k)
    EXPECT_LE(closing.step().allowed.discharge_ua, 120'000 * k) << "all of it in five seconds from the closing on";
  b.inputs.request = Request::none;
  EXPECT_EQ(b.step().allowed.discharge_ua, 0) << "in the same step";
}

TEST(Protection, BleedsWhileChargingAtTheTopAndNotWithAFaultThatOpens) {
  Bench b;
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
    Bench b;
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

TEST(Protection, WithoutSamplesBleedsNothing) {
  Bench b;
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
  EXPECT_NEAR(b.protection.decision().bleed_left_s, left_s, 2) << "nor counts it as bled";
}

TEST(Protection, AStoreThatFailsIsTheWarningThatItIsAndOthersBelieveTheirs) {
  Bench b;
  b.drive_off();
  b.inputs.storage_fault = true;
  EXPECT_EQ(b.step().faults, bit(Fault::storage_fault));
  EXPECT_EQ(b.protection.decision().first.fault, static_cast<std::uint8_t>(Fault::storage_fault));
  b.run(50);
  EXPECT_EQ(b.protection.decision().state, ContactorState::drive);
  EXPECT_GT(b.protection.decision().allowed.discharge_ua, 5'900'000) << "told, nothing else";
  b.inputs.storage_fault = false;
  b.run(10);
  EXPECT_EQ(b.protection.decision().faults, bit(Fault::storage_fault)) << "until somebody has seen it";
  b.inputs.clear = Clear::user;
  EXPECT_EQ(b.step().faults, 0U);
  b.estimate.voltage_rejected = true;
  b.run(625);
  EXPECT_EQ(b.protection.decision().faults, bit(Fault::current_implausible));
  EXPECT_NEAR(b.protection.decision().allowed.discharge_ua, 3'000'000, 20'000);
}

TEST(Protection, SaysWhatWasKeptBeforeTheFirstSampleAndNothingElse) {
  const Protection<16> fresh(pack);
  EXPECT_EQ(fresh.decision().faults, 0U);
  EXPECT_EQ(fresh.decision().first.time_us, 0U);
  const Protection<16> p(pack, bit(Fault::short_circuit) | bit(Fault::cell_overvoltage));
  const Decision& d = p.decision();
  EXPECT_EQ(d.faults, bit(Fault::short_circuit)) << "what only a workshop ends";
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

TEST(Protection, EndsAFaultOfTheWorkshopThatWasKeptAndNoneThatCameAfterItHadClosed) {
  Bench b;
  b.protection = Protection<16>(pack, bit(Fault::short_circuit));
  b.inputs.request = Request::drive;
  b.run(110);
  EXPECT_EQ(b.protection.decision().state, ContactorState::safe) << "kept is kept";
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
  EXPECT_EQ(b.step().faults, bit(Fault::short_circuit)) << "first a power cycle";
}

TEST(Protection, HoldsAKeyForOnePressOverAGapOfTheSamples) {
  Bench b;
  b.inputs.clear = Clear::user;
  b.inputs.storage_fault = true;
  b.run(3);
  b.inputs.storage_fault = false;
  for (int k = 0; k < 10; ++k) b.protection.without_sample(b.time_us += b.period);
  b.step();
  EXPECT_NE(b.protection.decision().faults & bit(Fault::storage_fault), 0U) << "nobody has pressed it anew";
}

TEST(Protection, IsClearedAlsoWhileNothingIsMeasured) {
  Protection<16> p(pack);
  measurement::PackSample<16> nothing;
  for (int k = 1; k <= 60; ++k) {
    nothing.time_us = 100'000U * static_cast<unsigned>(k);
    p.update(nothing, {}, {.clear = k == 50 ? Clear::user : Clear::none, .board_fault = k == 1});
    if (k == 49) {
      ASSERT_EQ(p.decision().faults, bit(Fault::internal_fault) | bit(Fault::samples_missing));
    }
  }
  EXPECT_EQ(p.decision().faults, bit(Fault::samples_missing));
}

TEST(Protection, GoesByTheSumOfTheCellsWhereThePackIsNotReadForOnce) {
  Bench b;
  b.inputs.request = Request::drive;
  while (b.protection.decision().state != ContactorState::precharge && b.count < 100) b.step();
  b.sample.time_us += b.period;
  b.sample.pack_uv = measurement::no_reading;
  std::int32_t sum_uv = 0;
  for (const std::int32_t uv : b.sample.cell_uv) sum_uv += uv;
  b.inputs.dc_link_uv = sum_uv / 16 * 15 - 16;
  EXPECT_EQ(b.protection.update(b.sample, b.estimate, b.inputs).state, ContactorState::precharge);
  b.sample.time_us += b.period;
  b.inputs.dc_link_uv = sum_uv / 16 * 15 + 16;
  EXPECT_EQ(b.protection.update(b.sample, b.estimate, b.inputs).state, ContactorState::drive);
}

TEST(Protection, CountsAGapAsAMinuteAtMost) {
  Bench b;
  b.drive_off();
  b.load_ua = -7'200'000;  // 0.31 s of heat a second: 18 s in a minute, and 30 s are too much
  b.run(2);
  ASSERT_EQ(b.protection.decision().faults, 0U);
  b.time_us += 600'000'000;
  b.step();
  EXPECT_EQ(b.protection.decision().faults, bit(Fault::samples_missing));
  Bench cold;  // recovers after a minute, which a step of a minute is
  cold.change = [](auto& s) { s.temperature_cdegc.fill(-100); };
  cold.run(60);
  ASSERT_EQ(cold.protection.decision().faults, bit(Fault::charge_undertemperature));
  cold.change = nullptr;
  cold.step();
  cold.time_us += 60'000'000 - cold.period;
  EXPECT_EQ(cold.step().faults & bit(Fault::charge_undertemperature), 0U);
}

/// To the microsecond: the opening of contactors that nobody can watch takes five seconds.
TEST(Protection, LetsNoTimePassByAClockThatStands) {
  Bench b;
  b.drive_off();
  const std::uint64_t open_us = b.time_us + 500'001;
  EXPECT_EQ(b.protection.without_sample(open_us).state, ContactorState::opening);
  for (int k = 1; k < 50; ++k) b.protection.without_sample(open_us + 100'000U * static_cast<unsigned>(k));
  for (int k = 0; k < 100; ++k)
    EXPECT_EQ(b.protection.without_sample(open_us + 4'999'999).state, ContactorState::opening);
  EXPECT_EQ(b.protection.without_sample(open_us + 5'000'000).state, ContactorState::safe);
}

TEST(Protection, OfOneCellOpensForItToo) {
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
    dc_link_uv = out.main_plus                     ? s.pack_uv
                 : out.precharge && out.main_minus ? dc_link_uv + (s.pack_uv - dc_link_uv) * 0.18
                                                   : dc_link_uv * 0.9;
    inputs.dc_link_uv = static_cast<std::int32_t>(dc_link_uv);
    p.update(s, e, inputs);
    if (k == 79) {
      ASSERT_EQ(p.decision().state, ContactorState::drive);
    }
  }
  EXPECT_FALSE(p.decision().outputs.any_closed());
  EXPECT_NE(p.decision().faults & bit(Fault::cell_undervoltage_severe), 0U);
}

/// Sixteen cells made of the shipped shift's one: each with an offset of charge (by the slope where it is), a
/// resistance of its own and noise. The shift is sampled once a second; protection of such a pack knows that.
TEST(Protection, IsSilentOverTheShippedShiftWithThreeSigmaNoise) {
  const measurement::Recording shift = files::read_recording(BMS_SOURCE_DIR "/recordings/forklift_shift.csv");
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
  for (std::size_t row = 0; row < shift.rows(); ++row) {
    measurement::PackSample<16> s;
    const Outputs out = p.decision().outputs;
    const bool closed = out.main_plus && out.main_minus;
    s.time_us = static_cast<std::uint64_t>(1e6 * shift.time_s[row]);
    s.current_ua = static_cast<std::int32_t>(1e6 * ((closed ? shift.current_a[row] : 0) + noise(0.01)));
    double sum_v = 0;
    for (std::size_t k = 0; k < 16; ++k) {
      const double off_v = 0.004 * (static_cast<double>(k % 7) - 3),
                   more_ohm = 0.001 * (static_cast<double>(k % 5) - 2);
      const double v = shift.voltage_v[row] + off_v + more_ohm * shift.current_a[row];
      sum_v += v;
      s.cell_uv[k] = static_cast<std::int32_t>(1e6 * (std::round((v + noise(0.001)) * 1e3) / 1e3));
    }
    s.pack_uv = static_cast<std::int32_t>(1e6 * (sum_v + noise(0.02)));
    for (std::size_t k = 0; k < 4; ++k)
      s.temperature_cdegc[k] =
          static_cast<std::int16_t>(100 * shift.temperature_c[row] + 30 * static_cast<double>(k) + noise(5));
    dc_link_v = closed                            ? sum_v
                : out.precharge && out.main_minus ? dc_link_v + (sum_v - dc_link_v) * 0.39
                                                  : dc_link_v * 0.9;
    inputs.dc_link_uv = static_cast<std::int32_t>(1e6 * dc_link_v);
    const Decision& d = p.update(s, PackEstimate<16>{}, inputs);
    ASSERT_EQ(d.faults, 0U) << "row " << row;
    driven += d.state == ContactorState::drive ? 1U : 0U;
  }
  EXPECT_GT(driven, shift.rows() - 60);
}

TEST(Protection, DecidesOnTheHostWhatItDecidesOnTheBoard) { EXPECT_EQ(scenario_hash(1'000), expected_scenario_hash); }

}  // namespace
}  // namespace bms::protection
