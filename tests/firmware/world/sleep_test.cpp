// A parked truck in the circuit's world: how long the chip is stopped, what ends it, and what it does not miss.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fmt/format.h>

#include "can_messages.hpp"  // generated from firmware/can/greybox_bms.dbc
#include "files/cell_file.hpp"
#include "files/text_file.hpp"
#include "images/chosen_image.hpp"
#include "tests/firmware/world/cases.hpp"
#include "tests/firmware/world/operating.hpp"

namespace bms::world {
namespace {

using plant::Relay;
using ::testing::IsEmpty;

constexpr unsigned pack_state = 0x180;
constexpr double asleep_share = 0.86;  ///< as the page of the board says

Pack pack_with(const images::Choice& choice) {
  Pack pack = pack_of(6);
  pack.image = images::chosen_image("stm32f405_forklift", files::read_cell("table9"), choice);
  return pack;
}

/// Wired to switch itself off, with a key that is read.
Pack pack_that_switches_off() {
  return pack_with(
      {"switches_off", {"-DBMS_SWITCHES_OFF=ON", "-DBMS_INPUTS=key;charger_plug;coil_supply;interlock;crash"}});
}

/// Parked, with a silent bus, since so long that the chip stops between the samples.
class Sleep : public ::testing::Test {
 protected:
  explicit Sleep(const Pack& pack = pack_of(6), double ld_ohm = plant::FrontEndInputs{}.ld_ohm)
      : pack_(pack), world_(pack_.image, setup_of(pack_, ld_ohm)) {
    world_.fit_clock();
    world_.run_ms(4'000);  // the crystal of the clock starts
    EXPECT_EQ(world_.board.stops, 0U) << "the truck's controller talks";
    world_.silence_bus(true);
    world_.run_ms(13'000);
    EXPECT_GT(world_.board.stops, 10U);
  }
  ~Sleep() override { EXPECT_THAT(world_.violations(), IsEmpty()); }

  static WorldSetup setup_of(const Pack& pack, double ld_ohm) {
    WorldSetup setup = typical_setup(pack);
    setup.truck.front_end.ld_ohm = ld_ohm;
    return setup;
  }
  double asleep_of(double ms) {
    const double before_ms = world_.board.stopped_ms();
    world_.run_ms(ms);
    return (world_.board.stopped_ms() - before_ms) / ms;
  }
  /// Time until the next sample is on the bus, or a negative value.
  double sample_after_ms(double within_ms = 3'000) {
    const unsigned before = world_.vehicle.frames[pack_state];
    return world_.run_until([&] { return world_.vehicle.frames[pack_state] != before; }, within_ms);
  }

  Pack pack_;
  TruckWorld world_;
};

TEST_F(Sleep, TakesMostOfTheTimeAndLosesNoSample) {
  const unsigned before = world_.board.estimates;
  const double share = asleep_of(60'000);
  fmt::print("asleep {:.1f} % of a minute\n", 100 * share);
  EXPECT_NEAR(share, asleep_share, 0.01);
  EXPECT_NEAR(world_.board.estimates - before, 600, 3) << "the clock goes on";
  const unsigned frames = world_.vehicle.frames[pack_state];
  world_.run_ms(2'000);
  EXPECT_EQ(world_.vehicle.frames[pack_state], frames) << "a silent bus stays silent";
}

TEST_F(Sleep, AFrameOfTheTruckWakesTheBoard) {
  world_.silence_bus(false);
  world_.vehicle.request = Request::drive;
  const double ms = sample_after_ms();
  fmt::print("first sample on the bus {:.0f} ms after the first frame\n", ms);
  EXPECT_GE(ms, 0);
  EXPECT_LT(ms, 1'200) << "the truck repeats its request each second";
  EXPECT_GT(world_.vehicle.soc_percent(), 0);
  EXPECT_GE(world_.run_until([&] { return world_.both_mains_closed(); }, start_limit_ms), 0);
  EXPECT_EQ(world_.vehicle.faults(), 0U);
  const unsigned stops = world_.board.stops;
  world_.run_ms(15'000);
  EXPECT_EQ(world_.board.stops, stops);
  world_.vehicle.request = Request::none;
  world_.run_ms(2'000);
  world_.silence_bus(true);
  EXPECT_GT(asleep_of(30'000), 0.4) << "and asleep again";
}

/// A node whose frames another one acknowledges, so that it repeats none, and whose clock is that of the samples: each
/// of its frames meets the same part of a cycle of 0.1 s.
class NodeInStep {
 public:
  explicit NodeInStep(TruckWorld& world) : world_(world) {}
  void send_at(double ms) {
    can::Command command;
    command.code = can::Command::code_request;
    counter_ = can::next(counter_);
    world_.board.can.others_acknowledge = true;
    world_.board.can.others.push_back({firmware::wire_frame(command.frame(counter_)), bit_at(ms), true});
  }

 private:
  std::uint64_t bit_at(double ms) const {
    return static_cast<std::uint64_t>(1e-3 * ms * world_.board.can.bits_per_second);
  }
  TruckWorld& world_;
  std::uint8_t counter_ = 0;
};

TEST_F(Sleep, ANodeThatSendsInStepWithTheSamplesIsReceivedWithItsSecondFrame) {
  constexpr double step_ms = 2.5, period_ms = 600;  // by itself the battery sends a second after an edge
  Cases cases(processors());
  for (double phase_ms = 0; phase_ms < 100; phase_ms += step_ms) {
    cases.start(fmt::format("{} ms after a sample", phase_ms), [&, phase_ms](Outcome& outcome) {
      const unsigned samples = world_.board.estimates;
      world_.run_until([&] { return world_.board.estimates != samples; }, 200);
      NodeInStep node(world_);
      const double first_ms = world_.now_ms() + phase_ms;
      for (int k = 0; k < 4; ++k) node.send_at(first_ms + k * period_ms);
      world_.run_ms(phase_ms);
      const double ms = sample_after_ms(2.5 * period_ms);
      outcome.values["received"] = ms;
      if (ms < 0) outcome.fail("not received");
      for (const std::string& violation : world_.violations()) outcome.fail(violation);
    });
  }
  double latest_ms = 0;
  int with_the_first = 0, all = 0;
  for (const Outcome& o : cases.finish()) {
    EXPECT_TRUE(o.good) << o.name << ": " << o.why;
    latest_ms = std::max(latest_ms, o.value("received", -1));
    with_the_first += o.good && o.value("received", -1) < period_ms ? 1 : 0;
    ++all;
  }
  fmt::print("{} phases, {} received with the first frame, all after {:.0f} ms\n", all, with_the_first, latest_ms);
  EXPECT_EQ(all, 40);
  EXPECT_LT(latest_ms, period_ms + 200) << "before it would have sent by itself";
}

/// A falling edge of CAN RX after the n-th register write of the way into a stop, counted from the one that arms its
/// line. No interrupt of these lines has a handler: taken by one, the edge would reset the chip.
TEST_F(Sleep, AFrameInAnyMomentOfTheWayIntoTheStopIsKeptAndResetsNothing) {
  constexpr std::uint32_t exti_pending = 0x40013C14, receive = 1U << 8, interrupts_enabled = 0xE000E100;
  constexpr unsigned port_of_b = 1, most_writes = 60;
  Cases cases(processors());
  for (unsigned n = 0; n < most_writes; ++n) {
    cases.start(fmt::format("after write {}", n), [&, n](Outcome& outcome) {
      unsigned writes = 0;
      bool armed = false, enables = false;
      const auto chip_writes = world_.board.core().on_write;
      world_.board.core().on_write = [&](std::uint32_t address, std::uint32_t value, unsigned bytes) {
        chip_writes(address, value, bytes);
        if (writes > n) return;
        armed = armed || (address == exti_pending && value == receive);
        if (!armed || writes++ != n) return;
        enables = address == interrupts_enabled;
        world_.exti.pin_edge(port_of_b, 8, false);
      };
      world_.run_until([&] { return writes > n; }, 300);
      const unsigned stops = world_.board.stops;
      world_.run_ms(3'000);
      world_.board.core().on_write = chip_writes;
      outcome.values["enables"] = enables;
      if (writes <= n) outcome.fail("no such write");
      if (!world_.board.resets.empty()) outcome.fail("a reset");
      if (world_.board.stops > stops + 2) outcome.fail("the edge was not seen");
    });
  }
  int with_the_interrupt = 0, all = 0;
  for (const Outcome& o : cases.finish()) {
    EXPECT_TRUE(o.good) << o.name << ": " << o.why;
    with_the_interrupt += o.value("enables", 0) > 0 ? 1 : 0;
    ++all;
  }
  EXPECT_EQ(all, most_writes);
  EXPECT_GE(with_the_interrupt, 1) << "none of the writes enabled the interrupt";
}

/// Its ready flag stays, and its wake-up timer counts no more: a chip that stopped would be reset for ever.
TEST_F(Sleep, ADeadCrystalOfTheClockLeavesItAwake) {
  world_.rtc.crystal = false;
  world_.run_ms(15'000);
  const unsigned stops = world_.board.stops, before = world_.board.estimates;
  world_.run_ms(10'000);
  EXPECT_EQ(world_.board.stops, stops);
  EXPECT_NEAR(world_.board.estimates - before, 100, 2);
  EXPECT_LE(world_.board.resets.size(), 1U) << "at most the one of the stop in which it died";
}

TEST_F(Sleep, ThePlugWakesTheBoard) {
  world_.plugged = true;
  world_.board.can.others_acknowledge = true;
  const double ms = sample_after_ms();
  fmt::print("first sample on the bus {:.0f} ms after the plug\n", ms);
  EXPECT_GE(ms, 0);
  EXPECT_LT(ms, 1'300);
  const unsigned stops = world_.board.stops;
  world_.silence_bus(true);
  world_.run_ms(20'000);
  EXPECT_LE(world_.board.stops, stops + 1) << "while a charger is plugged";
}

TEST_F(Sleep, ACellThatRunsDownIsFound) {
  world_.hold_cell(3, 1.7);
  world_.run_ms(1'000);
  EXPECT_GT(asleep_of(5'000), 0.5) << "with a fault as without";
  world_.silence_bus(false);
  EXPECT_GE(sample_after_ms(), 0);
  world_.run_ms(300);
  EXPECT_TRUE(world_.vehicle.fault(5)) << "cell undervoltage severe";
  EXPECT_EQ(world_.vehicle.first_cause(), 6U) << "and not that a sample was missing";
}

class SwitchOff : public Sleep {
 protected:
  static constexpr double with_pull_down_ohm = 1 / (1 / 220e3 + 1 / plant::FrontEndInputs{}.ld_ohm);
  SwitchOff() : Sleep(pack_that_switches_off(), with_pull_down_ohm) { world_.chip.ld_high_v = 0.8; }
};

TEST_F(SwitchOff, AnEmptyCellSwitchesTheBatteryOffUntilTheKeyIsTurned) {
  world_.hold_cell(7, 2.92);  // just above the release of cell undervoltage
  world_.run_ms(90'000);
  EXPECT_FALSE(world_.chip.in_shutdown());
  world_.hold_cell(7, 2.89);
  const double off_ms = world_.run_until([&] { return world_.off(); }, 90'000);
  fmt::print("off after {:.1f} s\n", 1e-3 * off_ms);
  EXPECT_NEAR(off_ms, 60'000, 1'000);
  EXPECT_TRUE(world_.chip.in_shutdown());
  EXPECT_GT(world_.lowest_cell_v(), 2.5) << "long before 1.5 V";
  world_.run_ms(20'000);
  EXPECT_TRUE(world_.off());
  world_.key_on = true;
  world_.silence_bus(false);
  const double ms = sample_after_ms(10'000);
  fmt::print("first sample on the bus {:.0f} ms after the key\n", ms);
  EXPECT_GE(ms, 0);
  world_.run_ms(2'000);
  EXPECT_FALSE(world_.off());
  EXPECT_EQ(world_.vehicle.faults(), 0U) << "it is empty, and no fault";
  world_.vehicle.request = Request::charge;
  EXPECT_GE(world_.run_until([&] { return world_.closed(Relay::charge); }, start_limit_ms), 0) << "it can be charged";
}

/// Key, plug or a frame around the command that switches the battery off. What comes after the last reading of the
/// inputs holds the front end on, with its outputs off, and the battery has to come back by itself.
class SwitchOffWindow : public SwitchOff {
 protected:
  SwitchOffWindow() {
    world_.hold_cell(7, 2.89);
    world_.run_ms(50'000);
    EXPECT_FALSE(world_.chip.in_shutdown());
    world_.fine_steps(30'000, 0.5);
    find_command();
  }
  struct Result {
    int all = 0, before = 0, held_on = 0, after = 0;
  };
  /// The event `ms` after the command, which is not there yet if negative.
  Result at_times(double from_ms, double to_ms, double step_ms, const std::function<void()>& event,
                  const std::function<void(Outcome&)>& judge) {
    Cases cases(processors());
    for (double ms = from_ms; ms < to_ms; ms += step_ms) {
      cases.start(fmt::format("{} ms after the command", ms), [&, ms](Outcome& outcome) {
        world_.run_ms(command_ms_ + ms);
        event();
        follow(outcome, judge);
      });
    }
    return count(cases);
  }
  /// The event after each of the last readings of the input pins before the command.
  Result after_readings(unsigned last, const std::function<void()>& event, const std::function<void(Outcome&)>& judge) {
    Cases cases(processors());
    for (unsigned n = readings_ - last + 1; n <= readings_; ++n) {
      cases.start(fmt::format("after reading {} of {}", n, readings_), [&, n](Outcome& outcome) {
        unsigned readings = 0;
        const auto chip_reads = world_.board.core().on_read;
        world_.board.core().on_read = [&](std::uint32_t address, unsigned bytes) {
          const std::uint32_t value = chip_reads(address, bytes);
          if (address == input_pins && ++readings == n) event();
          return value;
        };
        world_.run_until([&] { return readings >= n; }, 20'000);
        world_.board.core().on_read = chip_reads;
        follow(outcome, judge);
      });
    }
    return count(cases);
  }
  void turn_key() {
    world_.key_on = true;
    world_.port_c.set_outside(2, true);
    world_.chip.pull_ts2(true);
  }
  void put_in_plug() {
    world_.plugged = true;
    world_.port_c.set_outside(3, true);
    world_.chip.pull_ts2(true);
  }
  void drive(Outcome& outcome) {
    world_.hold_cell(7, 3.28);
    world_.silence_bus(false);
    if (const std::string why = bring_to(world_, pack_, Operating::standby); !why.empty()) outcome.fail(why);
  }
  void charge(Outcome& outcome) {
    world_.silence_bus(false);
    world_.vehicle.request = Request::charge;
    if (world_.run_until([&] { return world_.closed(Relay::charge); }, start_limit_ms) < 0) outcome.fail("no charge");
  }

 private:
  static constexpr std::uint32_t input_pins = 0x40020810;  // GPIOC_IDR; one reading of the inputs takes two
  static constexpr std::uint64_t imbalance = 1U << 17;     ///< of the cell that is held

  void find_command() {
    Cases cases(1);
    cases.start("without an event", [&](Outcome& outcome) {
      unsigned readings = 0;
      const auto chip_reads = world_.board.core().on_read;
      world_.board.core().on_read = [&](std::uint32_t address, unsigned bytes) {
        readings += address == input_pins && !world_.chip.in_shutdown() ? 1 : 0;
        return chip_reads(address, bytes);
      };
      outcome.values["ms"] = world_.run_until([&] { return world_.chip.in_shutdown(); }, 20'000);
      outcome.values["readings"] = readings;
      world_.board.core().on_read = chip_reads;
    });
    const Outcome found = cases.finish().at(0);
    command_ms_ = found.value("ms", -1);
    readings_ = static_cast<unsigned>(found.value("readings", 0));
    EXPECT_GT(command_ms_, 500);
    EXPECT_GT(readings_, 20U);
  }
  void follow(Outcome& outcome, const std::function<void(Outcome&)>& judge) {
    bool off = world_.chip.in_shutdown(), held_on = false;
    world_.each_step = [&] {
      off = off || world_.chip.in_shutdown();
      held_on = held_on || world_.chip.in_soft_shutdown();
    };
    world_.run_ms(200);
    outcome.values["off"] = off;
    outcome.values["held on"] = held_on;
    judge(outcome);
    world_.each_step = nullptr;
    if ((world_.vehicle.faults_seen() & ~imbalance) != 0) outcome.fail(fault_names(world_.vehicle.faults_seen()));
    for (const std::string& violation : world_.violations()) outcome.fail(violation);
  }
  static Result count(Cases& cases) {
    Result result;
    for (const Outcome& o : cases.finish()) {
      EXPECT_TRUE(o.good) << o.name << ": " << o.why;
      if (o.value("held on", 0) > 0)
        ++result.held_on;
      else
        ++(o.value("off", 0) > 0 ? result.after : result.before);
      ++result.all;
    }
    fmt::print("{} moments: {} before it, {} held on, {} after it\n", result.all, result.before, result.held_on,
               result.after);
    return result;
  }
  double command_ms_ = -1;
  unsigned readings_ = 0;  ///< of the input pins, until the command
};

TEST_F(SwitchOffWindow, AKeyAfterAnyReadingStartsTheTruck) {
  const Result result = after_readings(
      6, [&] { turn_key(); }, [&](Outcome& outcome) { drive(outcome); });
  EXPECT_EQ(result.all, 6);
  EXPECT_EQ(result.held_on, 2) << "all others are seen right before the command";
  EXPECT_EQ(result.before, 4);
}

TEST_F(SwitchOffWindow, AKeyAtAnyTimeStartsTheTruck) {
  const Result result = at_times(
      -40, 20, 4, [&] { turn_key(); }, [&](Outcome& outcome) { drive(outcome); });
  EXPECT_EQ(result.all, 15);
  EXPECT_GT(result.before, 0);
  EXPECT_GT(result.after, 0);
}

TEST_F(SwitchOffWindow, APlugAfterAnyReadingLetsTheBatteryBeCharged) {
  const Result result = after_readings(
      6, [&] { put_in_plug(); }, [&](Outcome& outcome) { charge(outcome); });
  EXPECT_EQ(result.held_on, 2);
  EXPECT_EQ(result.before, 4);
}

/// Nothing but key and plug hold the front end on, so a frame comes before the command or too late.
TEST_F(SwitchOffWindow, AFrameKeepsItAwakeOrComesTooLate) {
  NodeInStep node(world_);
  const auto judge = [&](Outcome& outcome) {
    world_.key_on = true;
    drive(outcome);
  };
  const Result result = at_times(
      -40, 20, 4, [&] { node.send_at(world_.now_ms() + 0.1); }, judge);
  EXPECT_EQ(result.held_on, 0);
  EXPECT_GT(result.before, 0);
  EXPECT_GT(result.after, 0);
}

/// A battery that nobody uses is off, or goes off after its minute.
TEST_F(SwitchOffWindow, AKeyThatIsTurnedForAMomentDoesNotKeepItOn) {
  const auto judge = [&](Outcome& outcome) {
    world_.key_on = false;
    if (world_.run_until([&] { return world_.off(); }, 90'000) < 0) outcome.fail("on");
    world_.key_on = true;
    drive(outcome);
  };
  const Result result = after_readings(
      2, [&] { turn_key(); }, judge);
  EXPECT_EQ(result.held_on, 2);
}

/// The DC link of the last drive is at LD: with the command, the front end would wait with its outputs off.
class SwitchOffAfterADrive : public SwitchOff {
 protected:
  SwitchOffAfterADrive() {
    world_.key_on = true;
    world_.silence_bus(false);
    EXPECT_EQ(bring_to(world_, pack_, Operating::standby), "");
    EXPECT_GE(key_off(world_), 0);
    world_.key_on = false;
    world_.hold_cell(7, 2.89);
    world_.run_ms(1'000);
    world_.silence_bus(true);
    world_.run_ms(90'000);
    EXPECT_FALSE(world_.off());
    EXPECT_FALSE(world_.chip.in_soft_shutdown());
    EXPECT_GT(world_.truck.pins().ld_v, 2);
  }
  void drives_after(double parked_ms) {
    world_.run_ms(parked_ms);
    world_.hold_cell(7, 3.28);
    world_.run_ms(1'000);
    world_.key_on = true;
    world_.silence_bus(false);
    EXPECT_EQ(bring_to(world_, pack_, Operating::standby), "");
    EXPECT_FALSE(world_.vehicle.faults_seen() >> second_line_failed & 1) << fault_names(world_.vehicle.faults_seen());
  }
  static constexpr unsigned second_line_failed = 33;
};

TEST_F(SwitchOffAfterADrive, WaitsForAnEmptyDcLink) {
  const double ms = world_.run_until([&] { return world_.off() || world_.chip.in_soft_shutdown(); }, 900'000);
  fmt::print("off after {:.0f} s more, LD at {:.2f} V\n", 1e-3 * ms, world_.truck.pins().ld_v);
  ASSERT_GE(ms, 0);
  EXPECT_TRUE(world_.off());
  drives_after(5'000);
}

TEST_F(SwitchOffAfterADrive, DoesNotHappenIfTheKeyIsTurnedBefore) { drives_after(0); }

/// Between the threshold of the detector and that of the reset.
TEST_F(Sleep, ALowSupplyIsNotMissed) {
  const double low_v = typical_setup(pack_).truck.supply.vdda_v - 2.95;
  world_.dip_vdda(37, 6'000, low_v);
  world_.run_ms(1'000);
  world_.silence_bus(false);
  EXPECT_GE(sample_after_ms(), 0);
  world_.run_ms(300);
  EXPECT_TRUE(world_.vehicle.fault(41)) << "supply dip";
  EXPECT_THAT(world_.board.resets, IsEmpty());
}

/// Typical values of the data sheets [mA], and what follows for a pack of 16 cells.
TEST(Currents, AreThoseOfThePageOfTheBoard) {
  constexpr double core_runs = 40, core_waits = 12, core_stopped = 0.28, transceiver = 10, transceiver_listens = 0.37,
                   front_end = 0.286, regulator = 0.0105, off = 0.001 + 0.003, efficiency = 0.8, pack_v = 51.2,
                   runs = 1 - asleep_share;
  const auto from_pack = [&](double at_3v3) { return at_3v3 * 3.3 / (pack_v * efficiency) + front_end + regulator; };
  const double on = from_pack(runs * core_runs + (1 - runs) * core_waits + transceiver),
               parked = from_pack(runs * core_runs + (1 - runs) * core_stopped + transceiver_listens);
  constexpr double capacity_ah = 280, empty = 0.011, lost_ma = 1e3 * capacity_ah * 0.02 / 730, hours_a_week = 168;
  std::string table =
      "| state | current [mA] | lasts from 10 % [weeks] | the same with what the cells lose [weeks] |\n"
      "|---|---|---|---|\n";
  const auto row = [&](const char* state, double ma, double share) {
    const double charge_mah = 1e3 * capacity_ah * share;
    table += fmt::format("| {} | {:.2g} | {:.0f} | {:.1f} |\n", state, ma, charge_mah / ma / hours_a_week,
                         charge_mah / (ma + lost_ma) / hours_a_week);
  };
  row("on: the bus is alive, or no crystal", on, 0.1 - empty);
  row("parked", parked, 0.1 - empty);
  row("parked, with a Hall sensor of 10 mA", parked + 10 * 5 / (pack_v * efficiency), 0.1 - empty);
  row("off, from an empty cell on", off, empty);
  const std::string page = files::read_file(BMS_SOURCE_DIR "/boards/stm32f405_forklift/README.md");
  EXPECT_NE(page.find(table), std::string::npos) << table;
}

}  // namespace
}  // namespace bms::world
