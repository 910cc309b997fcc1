// The chip's own protections and the driver: what they open is reported at least once, also if they recover between two
// samples, and an enable signal that returns has been reported before.
#include <functional>

#include "hal/second_line.hpp"
#include "tests/hal/bq76952_bench.hpp"

namespace bms {
namespace {

using enum measurement::SecondLineTrip;

class SecondLine : public Bq76952 {
 protected:
  /// Takes samples and returns all trips that they report.
  std::uint32_t trips_of_samples(int samples) {
    std::uint32_t all = 0;
    for (int k = 0; k < samples; ++k) {
      next();
      all |= front_end.trips();
    }
    return all;
  }
  void run() {
    start();
    ASSERT_EQ(trips_of_samples(20), 0U);
    ASSERT_TRUE(model.enables_contactors());
  }
};

struct Trip {
  const char* name;
  std::uint32_t bit;
  int within_ms;  ///< delay of the chip
  std::function<void(Bq76952Model&)> begin;
  bool opens_dsg, opens_chg;
};

class EveryProtectionOfTheChip : public SecondLine, public ::testing::WithParamInterface<Trip> {};

// Thresholds of board_under_test in the chip's steps: COV 3.8456 V, CUV 1.9734 V, OCC and OCD1 36 mV, OCD2 46 mV,
// SCD 60 mV. Delays 1 s, 0.42 s, 0.3 s, 0.45 ms.
TEST_P(EveryProtectionOfTheChip, OpensItsPinsAndIsReported) {
  run();
  GetParam().begin(model);
  const int samples = GetParam().within_ms / 100 + 2;
  EXPECT_EQ(trips_of_samples(samples), GetParam().bit);
  EXPECT_EQ(front_end.trips(), GetParam().bit) << "as long as it lasts";
  EXPECT_EQ(model.ddsg(), !GetParam().opens_dsg);
  EXPECT_EQ(model.dchg(), !GetParam().opens_chg);
  EXPECT_GT(front_end.counters().trips, 0U);
}

INSTANTIATE_TEST_SUITE_P(
    Of, EveryProtectionOfTheChip,
    ::testing::Values(
        Trip{"CellUndervoltage", cell_undervoltage, 1'000, [](auto& m) { m.cell_v[3] = 1.97; }, true, false},
        Trip{"CellOvervoltage", cell_overvoltage, 1'000, [](auto& m) { m.cell_v[6] = 3.85; }, false, true},
        Trip{"ChargeOvercurrent", charge_overcurrent, 420, [](auto& m) { m.current_a = 365; }, false, true},
        Trip{"DischargeOvercurrent", discharge_overcurrent, 420, [](auto& m) { m.current_a = -365; }, true, false},
        Trip{"HighDischargeOvercurrent", discharge_overcurrent, 300, [](auto& m) { m.current_a = -465; }, true, false},
        Trip{"SustainedDischarge", discharge_overcurrent, 20'300, [](auto& m) { m.current_a = -320; }, true, false},
        Trip{"HotForCharging", temperature, 20'300, [](auto& m) { m.temperature_c[1] = 51; }, false, true},
        Trip{"HotForDischarging", temperature, 20'300, [](auto& m) { m.temperature_c[2] = 66; }, true, true},
        Trip{"ColdForCharging", temperature, 20'300, [](auto& m) { m.temperature_c[3] = -6; }, false, true},
        Trip{"ABrokenThermistorReadsAsCold", temperature, 20'300, [](auto& m) { m.temperature_c[0] = -273; }, false,
             true},
        Trip{"ShortCircuit", short_circuit, 0, [](auto& m) { m.current_a = -605; }, true, true},
        Trip{"PermanentFailure", permanent_failure, 0,
             [](auto& m) {  // one that the driver does not enable
               m.set(bq::sov_delay, 0);
               m.set(bq::sov_threshold, 3'000);
               m.set(bq::enabled_pf_a, bq::pf_sov);
             },
             true, true}),
    [](const auto& p) { return std::string(p.param.name); });

TEST_F(SecondLine, JustBelowItsThresholdsNothingTrips) {
  run();
  model.cell_v[3] = 1.98;
  model.cell_v[6] = 3.84;
  model.current_a = -355;
  EXPECT_EQ(trips_of_samples(30), 0U);
  model.current_a = 355;
  EXPECT_EQ(trips_of_samples(30), 0U);
}

TEST_F(SecondLine, AShortCircuitBetweenTwoSamplesIsReportedAndLatchedUntilItIsCleared) {
  run();
  model.current_a = -700;
  model.advance(1'000);
  model.current_a = 0;
  next();
  EXPECT_EQ(front_end.trips(), short_circuit);
  EXPECT_LT(std::abs(sample.current_ua), 20'000'000) << "the mean of 100 ms does not show it";
  trips_of_samples(300);  // the chip's recovery time is 5 s
  EXPECT_EQ(front_end.trips(), 0U) << "reported; the latch is its consequence";
  EXPECT_FALSE(model.ddsg() || model.dchg());
  front_end.clear_latch();
  next();
  EXPECT_TRUE(model.enables_contactors());
  EXPECT_EQ(trips_of_samples(20), 0U);
}

TEST_F(SecondLine, ALatchedShortCircuitIsReportedAgainAfterARestartOfTheCore) {
  run();
  model.current_a = -700;
  model.advance(1'000);
  model.current_a = 0;
  trips_of_samples(100);
  hal::bq76952::FrontEnd again{configuration};
  measurement::PackSample<16> first;
  std::uint32_t trips = 0;
  for (int k = 0; k < 10; ++k) {
    model.advance(100'000);
    first.time_us = model.time_us;
    again.read(first);
    trips |= again.trips();
  }
  EXPECT_EQ(trips, short_circuit);
  EXPECT_FALSE(model.ddsg());
}

TEST_F(SecondLine, ATripThatRecoversBetweenTwoSamplesIsReported) {
  run();
  model.set(bq::recovery_time, 0);  // shorter than the driver allows, to make the trip as short as possible
  model.set(bq::cov_delay, 1);      // 9.9 ms
  model.cell_v[6] = 3.9;
  model.advance(12'000);
  ASSERT_FALSE(model.dchg());
  model.cell_v[6] = 3.3;
  model.advance(5'000);
  ASSERT_TRUE(model.dchg()) << "recovered before the sample";
  next();
  EXPECT_NE(front_end.trips() & cell_overvoltage, 0U);
  EXPECT_EQ(front_end.trips() & ~(cell_undervoltage | cell_overvoltage | charge_overcurrent | discharge_overcurrent),
            0U)
      << "which of those that recover cannot be known";
  EXPECT_EQ(trips_of_samples(20), 0U) << "once";
}

TEST_F(SecondLine, ATripIsReportedAlsoIfTheSampleThatFindsItFails) {
  run();
  model.set(bq::recovery_time, 0);
  model.set(bq::cov_delay, 1);
  model.cell_v[6] = 3.9;
  model.advance(12'000);
  model.cell_v[6] = 3.3;
  model.advance(5'000);
  model.torn_buffer = true;  // the current cannot be read
  std::uint32_t trips = trips_of_samples(1);
  model.torn_buffer = false;
  trips |= trips_of_samples(1);
  EXPECT_NE(trips & cell_overvoltage, 0U);
}

TEST_F(SecondLine, AnOvercurrentRecoversAtRestAfterItWasReported) {
  run();
  model.current_a = -365;
  EXPECT_EQ(trips_of_samples(7), discharge_overcurrent);
  model.current_a = 0;
  EXPECT_EQ(trips_of_samples(20), discharge_overcurrent);
  trips_of_samples(30);
  EXPECT_EQ(front_end.trips(), 0U);
  EXPECT_TRUE(model.enables_contactors());
  model.current_a = 365;
  EXPECT_EQ(trips_of_samples(7), charge_overcurrent);
  model.current_a = 0;
  trips_of_samples(50);
  EXPECT_TRUE(model.enables_contactors());
}

TEST_F(SecondLine, ASilentHostIsReportedWithTheFirstSample) {
  run();
  EXPECT_FALSE(front_end.silent());
  model.advance(3'100'000);
  EXPECT_FALSE(model.ddsg());
  EXPECT_TRUE(front_end.silent());
  next(3'200'000);
  EXPECT_EQ(front_end.trips(), host_silence);
  EXPECT_EQ(trips_of_samples(20), 0U);
  model.gone = true;  // the wires are broken for four seconds
  std::uint32_t trips = 0;
  for (int k = 0; k < 40; ++k) {
    next();
    trips |= front_end.trips();
  }
  EXPECT_EQ(trips, host_silence) << "while the chip is away, as its pins are low";
  model.gone = false;
  EXPECT_EQ(trips_of_samples(40) & ~host_silence, 0U);
  EXPECT_EQ(front_end.trips(), 0U);
}

TEST_F(SecondLine, AShortLossOfTheWiresIsNoTrip) {
  run();
  model.gone = true;
  for (int k = 0; k < 10; ++k) next();
  model.gone = false;
  EXPECT_EQ(trips_of_samples(30), 0U);
  EXPECT_TRUE(model.enables_contactors());
}

TEST_F(SecondLine, AResetOfTheChipIsReportedBeforeItsPinsRiseAgain) {
  for (const bool keeps_crc : {false, true}) {
    samples_until_complete();
    trips_of_samples(20);
    model.crc_from_otp = keeps_crc;
    model.reset();
    ASSERT_FALSE(model.ddsg());
    bool reported = false;
    for (int k = 0; k < 30; ++k) {
      next();
      reported = reported || front_end.trips() == host_silence;
      EXPECT_TRUE(reported || !model.ddsg()) << k;
    }
    EXPECT_TRUE(reported);
    EXPECT_TRUE(model.ddsg());
    EXPECT_EQ(front_end.trips(), 0U);
    accept_violations_of_a_reset_between_transfers();
  }
}

TEST_F(SecondLine, AfterPowerOnAndAfterALongRestartNothingIsReported) {
  EXPECT_EQ(trips_of_samples(60), 0U);
  model.advance(60'000'000);  // the core is without supply
  hal::bq76952::FrontEnd again{configuration};
  measurement::PackSample<16> first;
  for (int k = 0; k < 30; ++k) {
    model.advance(100'000);
    first.time_us = model.time_us;
    again.read(first);
    ASSERT_EQ(again.trips(), 0U) << k;
  }
}

TEST_F(SecondLine, PinsThatDoNotFollowAreReported) {
  run();
  model.set(bq::dsg_fet_protections_a, 0x80);  // undervoltage no longer opens main plus
  model.cell_v[3] = 1.9;
  std::uint32_t trips = trips_of_samples(14);
  EXPECT_EQ(trips & ~(pins_wrong | cell_undervoltage), 0U);
  trips_of_samples(5);
  EXPECT_EQ(front_end.trips(), pins_wrong | cell_undervoltage);
  ASSERT_TRUE(model.ddsg());
}

}  // namespace
}  // namespace bms
