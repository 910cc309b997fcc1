// The inputs and outputs of a truck, with the real application on this machine: what each does, that no coil supply is
// a state, and that an input that is not fitted does nothing.
#include <cmath>
#include <string>

#include <gtest/gtest.h>

#include "firmware/current_referee.hpp"
#include "firmware/insulation_monitor.hpp"
#include "hal/insulation_pwm.hpp"
#include "plant/random.hpp"
#include "tests/firmware/truck_day.hpp"

namespace bms::firmware {
namespace {

using host_hal::last;
using Inputs = can::TruckInputs;

constexpr std::uint32_t all_inputs = 31;

std::uint32_t bit_of(hal::TruckInput input) { return static_cast<std::uint32_t>(input); }

TEST(CoilSupply, ByAnEmergencyStopOfAnyLengthIsAStateAndNoFault) {
  for (const bool auxiliary : {true, false}) {
    for (const double load_a : {0.0, 8.0, 150.0}) {
      for (const double pressed_s : {0.1, 0.5, 3.0, 60.0}) {
        TruckDay t(auxiliary, std::nullopt, bit_of(hal::TruckInput::coil_supply));
        ASSERT_TRUE(t.key_on());
        t.run(5);
        t.load_a = load_a;
        t.run(3);
        t.emergency_stop = true;
        t.run(pressed_s);
        EXPECT_FALSE(t.any_closed());
        EXPECT_EQ(last<Inputs>()->coil_supply, Inputs::coil_supply_off);
        t.emergency_stop = false;
        for (int k = 0; k < 100; ++k) {
          t.step();
          ASSERT_FALSE(t.any_closed()) << "never by itself while the key is on";
        }
        EXPECT_EQ(last<Inputs>()->coil_supply, Inputs::coil_supply_on);
        EXPECT_EQ(t.last_stored(), "none") << load_a << " A for " << pressed_s << " s";
        EXPECT_EQ(t.faults(), 0U);
        t.key = false;
        t.load_a = 0;
        t.run(1.2);
        EXPECT_TRUE(t.key_on()) << "at once, without ten seconds of a fault's recovery";
      }
    }
  }
}

TEST(CoilSupply, PressedAtKeyOnClosesNothingAndIsNoFault) {
  TruckDay t(true, std::nullopt, bit_of(hal::TruckInput::coil_supply));
  t.emergency_stop = true;
  EXPECT_FALSE(t.key_on(20));
  EXPECT_EQ(t.state(), can::ContactorState::state_off);
  t.emergency_stop = false;
  t.run(20);
  EXPECT_FALSE(t.any_closed()) << "the release of the stop does not start the truck";
  EXPECT_EQ(t.stored(), 0U);
  EXPECT_TRUE(t.next_key_on_drives());
}

TEST(CoilSupply, DipsAtAnyMomentNeverCloseByThemselvesAndAreNoFault) {
  for (double at_s = 0; at_s < 8; at_s += 0.1) {
    TruckDay t(false, std::nullopt, bit_of(hal::TruckInput::coil_supply));
    t.key = true;
    t.run(at_s);
    const bool closed = t.any_closed();
    t.emergency_stop = true;
    t.run(0.1);
    t.emergency_stop = false;
    if (closed) {
      for (int k = 0; k < 30; ++k) {
        t.step();
        ASSERT_FALSE(t.any_closed()) << at_s;
      }
    }
    EXPECT_EQ(t.last_stored(), "none") << at_s;
    EXPECT_TRUE(t.next_key_on_drives()) << at_s;
  }
}

TEST(Interlock, ThatPartsOpensUnderLoadWithinThreeSamplesAndTheNextKeyOnDrives) {
  TruckDay t(true, std::nullopt, all_inputs);
  ASSERT_TRUE(t.key_on());
  t.load_a = 100;
  t.run(3);
  t.interlock = false;
  t.run(0.1);
  t.interlock = true;
  t.run(1);
  EXPECT_TRUE(t.drives()) << "a loop that vibrates for one sample";
  t.interlock = false;
  t.run(0.4);
  EXPECT_FALSE(t.any_closed());
  EXPECT_EQ(t.last_stored(), "interlock open");
  EXPECT_EQ(last<Inputs>()->interlock, Inputs::interlock_off);
  EXPECT_FALSE(t.next_key_on_drives()) << "while it is open";
  t.interlock = true;
  EXPECT_TRUE(t.next_key_on_drives());
  EXPECT_EQ(t.faults(), 0U);
}

TEST(Crash, OpensWithTheFirstSampleAndOnlyAWorkshopClearsIt) {
  TruckDay t(true, std::nullopt, all_inputs);
  ASSERT_TRUE(t.key_on());
  t.run(3);
  t.crashed = true;
  t.step();
  t.step();  // the contacts of the simulation follow with the next sample
  EXPECT_FALSE(t.any_closed());
  EXPECT_EQ(t.last_stored(), "crash");
  t.crashed = false;
  EXPECT_FALSE(t.next_key_on_drives());
  can::Command clear;
  clear.code = can::Command::code_clear_faults;
  t.send(clear.frame(13));
  EXPECT_FALSE(t.next_key_on_drives()) << "a clear command without service";
  EXPECT_NE(t.faults() & protection::bit(protection::Fault::crash), 0U);
}

TEST(ChargerPlug, KeepsATruckFromDriving) {
  TruckDay t(true, std::nullopt, all_inputs);
  t.seen_plug = true;
  EXPECT_FALSE(t.key_on());
  EXPECT_EQ(t.stored(), 0U);
  t.seen_plug = false;
  EXPECT_TRUE(t.key_on());
  t.seen_plug = true;
  t.run(2);
  EXPECT_FALSE(t.any_closed());
}

TEST(KeyInput, ClosesOnlyInABuildThatSaysSoAndAStopEndsIt) {
  TruckDay t(true, std::nullopt, all_inputs);
  static_assert(!hal::closes_by_inputs, "not without a word in the board's file");
  t.talks = false;
  t.key_input = t.seen_plug = true;
  t.run(20);
  EXPECT_EQ(last<Inputs>()->key, Inputs::key_on);
  EXPECT_FALSE(t.any_closed());
  // what the application gives to the arbitration in a build that says so
  PowerRequests requests;
  const ChargerState none;
  EXPECT_EQ(requests.active(none, 1, true), protection::Request::drive);
  requests.stop(2);
  EXPECT_EQ(requests.active(none, 3, true), protection::Request::none);
  EXPECT_EQ(requests.active(none, 90'000'000, true), protection::Request::none) << "until the key is turned";
  EXPECT_EQ(requests.active(none, 91'000'000, false), protection::Request::none);
  EXPECT_EQ(requests.active(none, 92'000'000, true), protection::Request::drive);
  EXPECT_EQ(requests.active({.present = true, .asks = true}, 93'000'000, true), protection::Request::none)
      << "a truck does not drive at a charger";
}

TEST(TruckInputs, ThatAreNotFittedDoNothingAndAreNotKnown) {
  TruckDay t(true, std::nullopt, bit_of(hal::TruckInput::coil_supply));
  t.interlock = false;
  t.crashed = true;
  t.seen_plug = true;
  EXPECT_TRUE(t.key_on());
  t.run(5);
  EXPECT_EQ(t.faults(), 0U);
  ASSERT_TRUE(last<Inputs>());
  for (const std::uint32_t state :
       {last<Inputs>()->key, last<Inputs>()->charger_plug, last<Inputs>()->interlock, last<Inputs>()->crash_sensor})
    EXPECT_EQ(state, Inputs::key_not_known);
  EXPECT_EQ(last<Inputs>()->coil_supply, Inputs::coil_supply_on);
}

TEST(TruckInputs, SayTheStateOfTheChargersOwnBus) {
  const Inputs none = messages::truck_inputs({}, {}, 0, Inputs::wrong_current_sensor_none);
  EXPECT_EQ(none.charger_bus, Inputs::charger_bus_none);
  const Inputs off = messages::with_charger_bus(none, {.state = hal::CanState::bus_off, .bus_offs = 0x102});
  EXPECT_EQ(off.charger_bus, Inputs::charger_bus_bus_off);
  EXPECT_EQ(off.charger_bus_offs, 2U);
  const Inputs received = Inputs::of(off.frame(3));
  EXPECT_EQ(received.charger_bus, off.charger_bus);
  EXPECT_EQ(received.charger_bus_offs, off.charger_bus_offs);
  EXPECT_EQ(received.crash_sensor, Inputs::crash_sensor_not_known);
}

TEST(Insulation, BelowAHundredOhmPerVoltForbidsChargingAndAMissingMonitorWarns) {
  TruckDay t(true, std::nullopt, all_inputs);
  host_hal::insulation = {true, 7'000};  // 16 cells of 3.65 V: 5,840 ohm
  ASSERT_TRUE(t.key_on());
  t.run(30);
  EXPECT_EQ(t.faults(), 0U);
  EXPECT_NEAR(last<Inputs>()->insulation, 7.0, 0.05);
  EXPECT_GT(last<can::AllowedCurrent>()->charge, 100);
  host_hal::insulation.ohm = 5'800;
  t.run(12);
  EXPECT_EQ(t.last_stored(), "insulation low");
  EXPECT_EQ(last<can::AllowedCurrent>()->charge, 0);
  EXPECT_GT(last<can::AllowedCurrent>()->discharge, 100) << "a first fault does not stop a truck";
  EXPECT_TRUE(t.drives());
  host_hal::insulation.ohm = measurement::no_reading;
  t.run(70);
  EXPECT_EQ(t.last_stored(), "insulation unknown");
  EXPECT_TRUE(t.drives());
}

/// Shares of the data sheet's formula, computed from the resistance.
TEST(Insulation, OfAPwmMonitorIsReadByFrequencyAndShare) {
  using hal::insulation_pwm::ohm_of;
  for (const double kohm : {0.0, 5.0, 50.0, 100.0, 1'200.0, 10'000.0}) {
    const double share = 0.05 + 0.9 * 1'200 / (kohm + 1'200);
    for (const double hz : {10.0, 20.0, 9.7, 10.3}) {
      const double period = 100'000 / hz;
      EXPECT_NEAR(1e-3 * ohm_of(static_cast<std::uint32_t>(period), static_cast<std::uint32_t>(share * period)), kohm,
                  0.5 + 0.02 * kohm)
          << hz << " Hz";
    }
  }
  EXPECT_EQ(ohm_of(3'333, 250), hal::insulation_pwm::most_ohm) << "30 Hz, good";
  EXPECT_EQ(ohm_of(3'333, 3'080), 0) << "30 Hz, bad";
  EXPECT_EQ(ohm_of(2'500, 1'250), measurement::no_reading) << "40 Hz, device error";
  EXPECT_EQ(ohm_of(2'000, 1'000), measurement::no_reading) << "50 Hz, earth connection";
  EXPECT_EQ(ohm_of(0, 0), measurement::no_reading);
  EXPECT_EQ(ohm_of(10'000, 10'000), measurement::no_reading);
}

TEST(Insulation, OfACanMonitorIsReadUntilItIsSilent) {
  InsulationMonitor<hal::InsulationMonitor::iso175> monitor;
  EXPECT_FALSE(monitor.receive({0x18FF50E5, 8, {}, true}, 1));
  EXPECT_EQ(monitor.now(1).ohm, measurement::no_reading);
  EXPECT_TRUE(monitor.now(1).fitted);
  EXPECT_TRUE(monitor.receive({0x18FF01F4, 8, {0x2C, 0x01}, true}, 1'000'000));
  EXPECT_EQ(monitor.now(2'000'000).ohm, 300'000);
  EXPECT_EQ(monitor.now(6'000'000).ohm, measurement::no_reading);
  EXPECT_TRUE(monitor.receive({0x18FF01F4, 8, {0xFF, 0xFF}, true}, 6'000'000));
  EXPECT_EQ(monitor.now(6'000'001).ohm, measurement::no_reading);
  EXPECT_TRUE(monitor.receive({0x18FF01F4, 1, {0x2C}, true}, 7'000'000)) << "too short";
  EXPECT_EQ(monitor.now(7'000'001).ohm, measurement::no_reading);
}

TEST(Thermistor, ThatIsShortedStopsInAnOrderlyWayBeforeTheFrontEndOpensUnderLoad) {
  TruckDay t(true, std::nullopt, all_inputs);
  ASSERT_TRUE(t.key_on());
  t.load_a = 100;
  t.run(3);
  t.first_cdegc = measurement::shorted_thermistor;
  t.run(5);
  EXPECT_EQ(t.last_stored(), "temperature lost");
  EXPECT_TRUE(t.drives());
  EXPECT_GT(last<can::AllowedCurrent>()->discharge, 100);
  double stopped_s = 5;
  for (; stopped_s < 30 && last<can::AllowedCurrent>()->discharge > 0; stopped_s += 0.1) t.step();
  EXPECT_NEAR(stopped_s, 11, 1.2) << "published in time";
  t.load_a = 0;
  t.run(1);
  EXPECT_FALSE(t.any_closed());
  EXPECT_EQ(t.last_stored(), "thermistor shorted");
  t.first_cdegc = 2'500;
  EXPECT_TRUE(t.next_key_on_drives());
  TruckDay broken(true, std::nullopt, all_inputs);
  ASSERT_TRUE(broken.key_on());
  broken.first_cdegc = measurement::no_temperature;
  broken.run(60);
  EXPECT_TRUE(broken.drives()) << "a broken one reads as cold, and the front end stops no discharge for it";
}

TEST(FrontEndDie, ThatIsHotStopsInAnOrderlyWayAndTheTruckDrivesAgainWhenItHasCooled) {
  TruckDay t(true, std::nullopt, all_inputs);
  ASSERT_TRUE(t.key_on());
  t.load_a = 100;
  host_hal::front_end.die_cdegc = 9'500;
  t.run(20);
  EXPECT_TRUE(t.drives());
  EXPECT_NEAR(last<can::FrontEnd>()->die_temperature, 95, 1.01);
  EXPECT_EQ(t.faults(), 0U);
  host_hal::front_end.die_cdegc = 9'510;
  t.run(2.2);
  EXPECT_EQ(t.last_stored(), "front end hot");
  EXPECT_TRUE(t.any_closed()) << "5 s of grace";
  EXPECT_EQ(last<can::AllowedCurrent>()->discharge, 0);
  EXPECT_EQ(last<can::MoreFaults>()->front_end_hot, 1U);
  EXPECT_EQ(last<can::Faults>()->first_cause, can::Faults::first_cause_front_end_hot);
  t.load_a = 0;
  t.run(1);
  EXPECT_FALSE(t.any_closed());
  host_hal::front_end.die_cdegc = 8'400;
  t.run(61);
  EXPECT_TRUE(t.next_key_on_drives());
  host_hal::front_end.die_cdegc = measurement::no_temperature;
  t.run(1);
  EXPECT_TRUE(t.drives()) << "the readings of the pack say whether the chip measures";
  EXPECT_EQ(t.faults(), 0U);
  EXPECT_TRUE(std::isnan(last<can::FrontEnd>()->die_temperature));
}

TEST(SecondCurrentSensor, ThatIsFittedAndGivesNoReadingIsAFault) {
  for (const bool fitted : {true, false}) {
    TruckDay t(true, std::nullopt, all_inputs);
    host_hal::second_current_sensor = fitted;
    t.run(4);
    EXPECT_EQ(t.faults(), 0U);
    t.run(4);
    EXPECT_EQ(t.last_stored(), fitted ? "second current missing" : "none");
    EXPECT_TRUE(t.key_on()) << "derated";
  }
}

/// Two sensors of a driving truck, cells of 0.3 mohm with 0.3 mV of noise. wrong: changes the reading of one of them.
template <class Wrong>
std::uint32_t named(std::uint64_t seed, bool first_is_wrong, Wrong&& wrong) {
  plant::Random random(seed);
  CurrentReferee referee;
  double amps = 0;
  for (int k = 0; k < 200; ++k) {
    if (k % 7 == 0) amps = 300 * (random.uniform() - 0.7);
    const double volts = 3.28 + 0.3e-3 * amps + 0.3e-3 * random.normal(), right = amps + 0.5 * random.normal();
    const double false_a = k < 100 ? right : wrong(amps) + 0.5 * random.normal();
    const auto ua = [](double a) { return static_cast<std::int32_t>(1e6 * a); };
    measurement::Sample s;
    s.voltage_uv = static_cast<std::int32_t>(1e6 * volts);
    s.current_ua = ua(first_is_wrong ? false_a : right);
    referee.update(s, ua(first_is_wrong ? right : false_a));
  }
  return referee.verdict();
}

TEST(CurrentReferee, NamesTheSensorThatDoesNotFollowTheVoltages) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    for (const bool first : {true, false}) {
      const std::uint32_t wrong = first ? Inputs::wrong_current_sensor_first : Inputs::wrong_current_sensor_second;
      EXPECT_EQ(named(seed, first, [](double) { return -60.0; }), wrong) << "stuck, " << seed;
      EXPECT_EQ(named(seed, first, [](double a) { return -a; }), wrong) << "reversed, " << seed;
      EXPECT_EQ(named(seed, first, [](double a) { return a + 40; }), Inputs::wrong_current_sensor_not_known)
          << "offset, " << seed;
      EXPECT_EQ(named(seed, first, [](double a) { return 1.3 * a; }), Inputs::wrong_current_sensor_not_known)
          << "gain, " << seed;
    }
  }
  EXPECT_EQ(CurrentReferee().verdict(), Inputs::wrong_current_sensor_not_known) << "no current has flowed";
}

TEST(CurrentReferee, IsPublishedWithoutInputsFromTheFirstWrongSensorOn) {
  TruckDay t;
  host_hal::second_current_sensor = true;
  host_hal::second_current_reading_ua = 0;
  t.run(3);
  EXPECT_FALSE(last<Inputs>()) << "a board without inputs, and no sensor is wrong";
  host_hal::second_current_reading_ua = 200'000'000;
  t.run(4);
  ASSERT_TRUE(last<Inputs>());
  EXPECT_EQ(last<Inputs>()->wrong_current_sensor, Inputs::wrong_current_sensor_not_known) << "no current has flowed";
  host_hal::second_current_reading_ua = 0;
  t.run(12);
  can::Command clear;
  clear.code = can::Command::code_clear_faults;
  clear.argument = 1;
  t.send(clear.frame(13));
  t.run(3);
  EXPECT_EQ(t.faults(), 0U);
  EXPECT_EQ(last<Inputs>()->wrong_current_sensor, Inputs::wrong_current_sensor_none);
}

TEST(Shelf, WaitsForAMinuteOfRest) {
  constexpr std::int32_t empty_uv = 2'908'000;
  Shelf shelf;
  std::uint64_t us = 0;
  bool ready = true;
  const auto after = [&](int seconds, std::int32_t uv, bool used = false, bool silent = true) {
    bool off = false;
    for (int k = 0; k < 10 * seconds; ++k) off = shelf.update(uv, empty_uv, used, silent, ready, us += 100'000) || off;
    return off;
  };
  EXPECT_FALSE(after(3'600, empty_uv));
  EXPECT_FALSE(after(59, empty_uv - 1));
  EXPECT_FALSE(after(1, empty_uv)) << "one sample above begins the minute again";
  EXPECT_FALSE(after(59, empty_uv - 1));
  EXPECT_FALSE(after(3'600, empty_uv - 1, true)) << "while it is used";
  EXPECT_FALSE(after(3'600, empty_uv - 1, false, false)) << "while somebody listens";
  EXPECT_FALSE(after(3'600, measurement::no_reading));
  EXPECT_TRUE(after(61, empty_uv - 1));
  ready = false;
  EXPECT_FALSE(after(3'600, empty_uv - 1)) << "the DC link is charged";
  ready = true;
  EXPECT_TRUE(after(1, empty_uv - 1)) << "at once when it is empty";
}

TEST(Shelf, AsksOnceAMinuteIfTheSupplyDoesNotFall) {
  Shelf shelf;
  int times = 0;
  for (std::uint64_t us = 0; us <= 600'000'000; us += 100'000)
    times += shelf.update(2'500'000, 2'908'000, false, true, true, us);
  EXPECT_EQ(times, 10);
}

TEST(Shelf, OfAWorkshopWaitsForItsAnswerAndNotForVoltageOrBus) {
  Shelf shelf;
  std::uint64_t us = 0;
  bool ready = true;
  const auto off_after_s = [&](bool used) {
    for (int k = 1; k < 1'000; ++k) {
      if (shelf.update(3'300'000, 2'908'000, used, false, ready, us += 100'000)) return 0.1 * k;
    }
    return -1.0;
  };
  EXPECT_FALSE(shelf.ship()) << "nothing is known yet";
  EXPECT_LT(off_after_s(false), 0);
  EXPECT_TRUE(shelf.ship());
  EXPECT_NEAR(off_after_s(false), 2, 0.15);
  EXPECT_LT(off_after_s(false), 0) << "once, if key or plug keep it on";
  EXPECT_TRUE(shelf.ship());
  EXPECT_LT(off_after_s(true), 0);
  EXPECT_FALSE(shelf.ship());
  EXPECT_LT(off_after_s(false), 0) << "used meanwhile: no more";
  EXPECT_TRUE(shelf.ship());
  ready = false;
  EXPECT_LT(off_after_s(false), 0) << "the DC link is charged";
  ready = true;
  EXPECT_NEAR(off_after_s(false), 0.1, 0.05);
}

/// A battery with an empty cell and all else at rest, for two minutes.
class Parking : public ::testing::Test {
 protected:
  Parking() {
    pack.cell_uv.fill(3'300'000);
    pack.cell_uv[7] = 2'500'000;
    pack.current_ua = 0;
    host_hal::begin();
    host_hal::listening = false;
  }
  ~Parking() override { host_hal::begin(); }

  bool goes_off() {
    TruckSide<true> side;
    bool off = false;
    for (int k = 0; k < 1'200; ++k) {
      pack.time_us += 100'000;
      off = side.park(pack, inputs, charger, decision, board, TruckBoard::plan()) || off;
    }
    return off;
  }

  measurement::PackSample<16> pack;
  protection::ExternalInputs inputs;
  ChargerState charger;
  protection::Decision decision;
  BoardStatus board;
};

TEST_F(Parking, AnInsulationMonitorKeepsTheChipAwakeButNotTheBatteryOn) {
  board.insulation = {.fitted = true, .ohm = 500'000};
  EXPECT_TRUE(goes_off());
  EXPECT_FALSE(host_hal::parked);
}

TEST_F(Parking, AContactorThatMayBeClosedKeepsTheBatteryOn) {
  EXPECT_TRUE(goes_off());
  EXPECT_TRUE(host_hal::parked);
  const std::int32_t rest_ua = TruckBoard::plan().contactors.rest_ua;
  for (const std::int32_t ua : {rest_ua + 1, -rest_ua - 1, measurement::no_reading}) {
    pack.current_ua = ua;
    EXPECT_FALSE(goes_off()) << ua;
  }
  pack.current_ua = -rest_ua;
  EXPECT_TRUE(goes_off());
  decision.welded_pole = protection::Pole::minus;
  EXPECT_FALSE(goes_off());
  decision.welded_pole = protection::Pole::none;
  inputs.auxiliary = {.fitted = true, .main_plus_closed = true};
  EXPECT_FALSE(goes_off());
  inputs.auxiliary = {.fitted = true, .main_minus_closed = true};
  EXPECT_FALSE(goes_off());
  inputs.auxiliary = {.fitted = true};
  EXPECT_TRUE(goes_off());
}

TEST_F(Parking, WithoutItsBuildOptionNothingSwitchesOff) {
  TruckSide<false> side;
  for (int k = 0; k < 1'200; ++k) {
    pack.time_us += 100'000;
    EXPECT_FALSE(side.park(pack, inputs, charger, decision, board, TruckBoard::plan()));
  }
  EXPECT_TRUE(host_hal::parked);
  can::Command command;
  command.code = can::Command::code_switch_off;
  EXPECT_EQ(side.command(command, false, [](Privilege) { return true; }), can::CommandAnswer::result_refused);
}

TEST(TruckOutputs, HeatOnlyAtACharger) {
  TruckOutputs outputs;
  const protection::ProtectionPlan& plan = TruckBoard::plan();
  TruckOutputs::Input in{.cdegc = {-500, -400, -300, -200}, .soc_ppb = 500'000'000, .requested = true};
  const auto has = [&](hal::TruckOutput output) {
    return (outputs.update(in, plan) & static_cast<unsigned>(output)) != 0;
  };
  EXPECT_FALSE(has(hal::TruckOutput::heater)) << "not from the battery";
  in.charger_present = true;
  EXPECT_TRUE(has(hal::TruckOutput::heater));
  in.cdegc = {600, 650, 700, 700};
  EXPECT_TRUE(has(hal::TruckOutput::heater)) << "until 7 degrees C";
  in.cdegc = {710, 720, 730, 740};
  EXPECT_FALSE(has(hal::TruckOutput::heater));
  in.cdegc[0] = 300;
  EXPECT_FALSE(has(hal::TruckOutput::heater)) << "from 2 degrees C";
  in.cdegc[0] = 100;
  EXPECT_TRUE(has(hal::TruckOutput::heater));
  in.opens = true;
  EXPECT_FALSE(has(hal::TruckOutput::heater));
  in.opens = false;
  in.cdegc[1] = measurement::no_temperature;
  EXPECT_FALSE(has(hal::TruckOutput::heater)) << "a cell may be hot";
  EXPECT_TRUE(has(hal::TruckOutput::fan));
}

TEST(TruckOutputs, CoolAWarmPackAndShowTheStateOfCharge) {
  TruckOutputs outputs;
  const protection::ProtectionPlan& plan = TruckBoard::plan();
  TruckOutputs::Input in{.cdegc = {2'500, 2'500, 2'500, 2'500}, .soc_ppb = 500'000'000, .requested = true};
  const auto has = [&](hal::TruckOutput output) {
    return (outputs.update(in, plan) & static_cast<unsigned>(output)) != 0;
  };
  EXPECT_FALSE(has(hal::TruckOutput::fan));
  const auto warm = static_cast<std::int16_t>(plan.derating.charge_warm.from);
  in.cdegc[2] = static_cast<std::int16_t>(warm - 490);
  EXPECT_TRUE(has(hal::TruckOutput::fan));
  in.cdegc[2] = static_cast<std::int16_t>(warm - 990);
  EXPECT_TRUE(has(hal::TruckOutput::fan));
  in.cdegc[2] = static_cast<std::int16_t>(warm - 1'010);
  EXPECT_FALSE(has(hal::TruckOutput::fan));
  const auto lit_samples = [&](std::int32_t soc_ppb) {
    int lit = 0;
    in.soc_ppb = soc_ppb;
    for (int k = 0; k < 100; ++k) {
      in.now_us += 100'000;
      lit += has(hal::TruckOutput::soc_lamp) ? 1 : 0;
    }
    return lit;
  };
  EXPECT_EQ(lit_samples(210'000'000), 100);
  EXPECT_EQ(lit_samples(190'000'000), 50);
  EXPECT_EQ(lit_samples(90'000'000), 50);
  in.requested = false;
  EXPECT_EQ(lit_samples(900'000'000), 0);
}

}  // namespace
}  // namespace bms::firmware
