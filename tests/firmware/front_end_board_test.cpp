// The image of the forklift board in Unicorn, with register models of I2C controller and front end: the cell voltages
// are on the CAN bus, and a front end that disappears, hangs or is reset stops its readings but not the firmware. A
// simulated truck follows the contactor pins: they close in the right order and open in the time of protection's table.
#include <cmath>
#include <functional>
#include <map>
#include <sstream>
#include <utility>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "can_messages.hpp"  // generated from firmware/can/greybox_bms.dbc
#include "files/cell_file.hpp"
#include "files/text_file.hpp"
#include "images/firmware_image.hpp"
#include "plant/link_poles.hpp"
#include "tests/firmware/contactor_port_models.hpp"
#include "tests/firmware/converter_model.hpp"
#include "tests/firmware/i2c_controller_model.hpp"

namespace bms::firmware {
namespace {

using ::testing::IsEmpty;

const std::filesystem::path& image() {
  static const auto path =
      images::firmware_image("stm32f405_forklift", files::read_cell("table9"), images::Image::application);
  return path;
}

class FrontEndBoard : public ::testing::Test {
 protected:
  FrontEndBoard() {
    for (std::size_t k = 0; k < 16; ++k) chip.cell_v[k] = 3.28 + 0.001 * static_cast<double>(k);
    chip.stack_v = 16 * 3.2875;
    chip.ld_v = 0.2;
    chip.current_a = -12;
    converter.input_v = [this](std::uint32_t channel) { return pin_v(channel); };
    board.plugged = {{I2cControllerModel::base, &i2c},
                     {I2cPins::base, &pins},
                     {ConverterModel::base, &converter},
                     {ContactorPort::base, &port}};
  }
  void TearDown() override {
    EXPECT_THAT(i2c.violations, IsEmpty());
    EXPECT_THAT(converter.violations, IsEmpty());
    EXPECT_THAT(chip.violations, IsEmpty());
    EXPECT_THAT(board.can.violations, IsEmpty());
    if (clock_works) {
      EXPECT_LT(board.longest_unfed_ms, 1'360);
    }
  }
  std::optional<can::Frame> last(unsigned id) const {
    std::optional<can::Frame> found;
    for (const SeenFrame& s : board.can.seen) {
      if (s.from_board && s.frame.id == id) found = s.frame;
    }
    return found;
  }
  /// Cell voltage on the bus [V], 0 to 8.18; above: not known.
  double cell_on_the_bus(std::size_t k) const {
    const auto frame = last(0x190U + static_cast<unsigned>(k / 4));
    if (!frame) return -1;
    std::uint64_t bits = 0;
    for (std::size_t j = 0; j < 8; ++j) bits |= static_cast<std::uint64_t>(frame->data[j]) << 8 * j;
    return 0.001 * static_cast<double>(bits >> (12 + 13 * (k % 4)) & 0x1FFF);
  }
  void expect_cells() const {
    for (std::size_t k = 0; k < 16; ++k) EXPECT_NEAR(cell_on_the_bus(k), chip.cell_v[k], 0.00051) << k;
  }

  /// PC1 and PC0: dividers of 1 Mohm with 56 kohm to C0 and 56 kohm to VDDA. PA1: Hall sensor, 2.5 V + 2.5 mV/A from a
  /// supply of 4.95 V, by 33 / 50.
  double pin_v(std::uint32_t channel) const {
    const auto divided_v = [this](double pole_v) {
      return (pole_v / 1e6 + converter.supply_v / 56e3) / (1 / 1e6 + 2 / 56e3);
    };
    if (channel == 11) return divided_v(poles.plus_v);
    if (channel == 10) return divided_v(poles.minus_v);
    return channel == 1 ? 0.66 * 0.99 * (2.5 + 2.5e-3 * chip.current_a) : 0;
  }

  bool clock_works = true;  ///< a core that is too slow feeds its watchdog late
  Bq76952Model chip;
  plant::LinkPoles poles = plant::link_poles(false, false, 0, 0);
  I2cControllerModel i2c{chip};
  AuxiliaryPins pins{chip};
  ConverterModel converter;
  ContactorPort port;
  UnicornBoard board{image()};
};

/// On a CANopen bus, 0x310 to 0x31D are process data of other devices: receive PDO 2 of nodes 16 to 29.
TEST_F(FrontEndBoard, NoFrameOfASampleOrOfAStartingPointIsReceived) {
  for (int k = 0; k < 20; ++k) {
    for (std::uint32_t id = 0x310; id <= 0x322; ++id)
      board.can.others.push_back({{id, false, false, 8, {0x00, 0x65, 0xCD, 0x1D, 0x80, 0x96, 0x98, 0x00}}, 0});
  }
  board.run_for_ms(2'000);
  EXPECT_EQ(board.can_health().received, 0U);
  const auto start = last(can::StartingSoc::id);
  ASSERT_TRUE(start);
  EXPECT_EQ(can::StartingSoc::of(*start).given, can::StartingSoc::given_no) << "50 %, sigma 1 %";
}

TEST_F(FrontEndBoard, CellVoltagesAreOnTheBusToTheMillivolt) {
  board.run_for_ms(3'600 + 750);  // a new chip first erases three sectors, 0.25 s each
  expect_cells();
  EXPECT_EQ(i2c.ccr, 0x8023U) << "400 kHz from 42 MHz, RM0090, 27.6.8";
  EXPECT_EQ(i2c.frequency_mhz, 42U);
  EXPECT_EQ(i2c.trise, 13U);
  EXPECT_GE(board.estimates, 30U);
  fmt::print("stack {} bytes, {} transfers\n", board.stack_used(), i2c.transfers);
}

TEST_F(FrontEndBoard, AFrontEndThatDisappearsHangsAndReturnsStopsOnlyItsReadings) {
  board.run_for_ms(3'000);
  expect_cells();
  chip.gone = true;
  unsigned before = board.estimates;
  board.run_for_ms(1'200);
  EXPECT_GE(board.estimates - before, 11U);
  EXPECT_GT(cell_on_the_bus(3), 8.18) << "not known";
  chip.gone = false;
  chip.hung = true;
  before = board.estimates;
  board.run_for_ms(1'200);
  EXPECT_GE(board.estimates - before, 11U);
  chip.hung = false;
  chip.reset();
  chip.cell_v[3] = 3.4;
  board.run_for_ms(4'500);
  expect_cells();
}

TEST_F(FrontEndBoard, ContactorsAreOpenWithoutARequest) {
  board.run_for_ms(2'500);
  EXPECT_EQ(port.output() >> 6 & 15, 0U) << "PC6 to PC9 low";
  EXPECT_EQ(port.mode() >> 12 & 0xFF, 0x55U) << "outputs";
  EXPECT_EQ(port.mode() & 15, 15U) << "PC0 and PC1 analog";
  EXPECT_EQ(pins.pull_ups() >> 28, 5U) << "PB14 and PB15";
  EXPECT_EQ(board.register_value(0x40013814), 0x1100U) << "SYSCFG_EXTICR4: EXTI14 and EXTI15 from port B";
}

/// Levels of the contactor pins.
struct Pins {
  bool main_plus, main_minus, precharge, charge_enable;
  bool any_closed() const { return main_plus || main_minus || precharge; }
};

struct Load {
  double current_a = 0;
  bool plus_fails = false, minus_welded = false, plus_welded = false;
  bool coils_without_supply = false;
  bool link_keeps_its_charge = false;
};

/// A truck with a DC link of 10 mF that requests power every second and draws the current of `load`. Both poles of the
/// DC link are where the wiring puts them, also while they float.
class Truck : public FrontEndBoard {
 protected:
  Truck() { chip.current_a = 0; }
  Pins driven() const {
    const std::uint32_t high = port.output();
    return {(high >> 6 & 1) != 0, (high >> 7 & 1) != 0, (high >> 8 & 1) != 0, (high >> 9 & 1) != 0};
  }
  /// Contacts follow their coils at once.
  void move_contacts() {
    const Pins on = driven();
    const bool supplied = !load.coils_without_supply;
    const bool plus = (on.main_plus && supplied && !load.plus_fails) || load.plus_welded,
               minus = (on.main_minus && supplied) || load.minus_welded, relay = on.precharge && supplied;
    pins.set_contacts(plus, minus);
    if (plus && minus) {
      dc_link_v = chip.stack_v;
    } else if (relay && minus) {
      dc_link_v += (chip.stack_v - dc_link_v) * (1 - std::exp(-0.01 / 0.5));
    } else if (!load.link_keeps_its_charge) {
      dc_link_v *= std::exp(-0.01 / (load.current_a == 0 ? 1.5 : 0.05));
    }
    chip.current_a = plus && minus ? load.current_a : 0;
    poles = plant::link_poles(plus || relay, minus, chip.stack_v, dc_link_v);
    chip.ld_v = std::max(0.0, poles.plus_v);
  }
  /// Simulates 10 ms of the circuit.
  void step() {
    if (requests_power && steps_++ % 100 == 0) {
      can::Command command;
      command.code = can::Command::code_request;
      command.argument = 1;  // drive
      asked_ = can::next(asked_);
      board.can.others.push_back({wire_frame(command.frame(asked_)), 0});
    }
    move_contacts();
    board.run_for_ms(10);
  }
  /// Returns the milliseconds until the condition holds, or -1.
  int until(const std::function<bool(const Pins&)>& is, int most_ms) {
    for (int ms = 0; ms <= most_ms; ms += 10) {
      if (is(driven())) return ms;
      step();
    }
    return -1;
  }
  bool drive_off() {
    requests_power = true;
    if (until([](const Pins& p) { return p.main_plus && p.main_minus; }, 8'000) < 0) return false;
    load.current_a = -3;
    for (int k = 0; k < 60; ++k) step();
    return driven().main_plus && driven().main_minus;
  }
  can::Faults faults() const {
    const auto frame = last(can::Faults::id);
    return frame ? can::Faults::of(*frame) : can::Faults{};
  }

  can::ContactorState contactor_state() const {
    const auto frame = last(can::ContactorState::id);
    return frame ? can::ContactorState::of(*frame) : can::ContactorState{};
  }

  bool requests_power = false;
  Load load;
  double dc_link_v = 0;

 private:
  int steps_ = 0;
  std::uint8_t asked_ = 0;
};

TEST_F(Truck, PrechargesAndClosesTheSecondPoleOnlyOnAFullDcLink) {
  requests_power = true;
  ASSERT_GE(until([](const Pins& p) { return p.precharge; }, 4'000), 0);
  EXPECT_FALSE(driven().main_minus) << "precharge contactor alone: tests whether the other pole is welded";
  ASSERT_GE(until([](const Pins& p) { return !p.precharge && p.main_minus; }, 1'000), 200);
  ASSERT_GE(until([](const Pins& p) { return p.precharge && p.main_minus; }, 1'000), 200);
  const int charged_ms = until([](const Pins& p) { return p.main_plus; }, 3'000);
  EXPECT_NEAR(charged_ms, 500 * std::log(50.0), 250) << "98 % of the pack voltage";
  EXPECT_GE(dc_link_v, 0.975 * chip.stack_v);
  EXPECT_TRUE(driven().precharge) << "until main plus has closed";
  EXPECT_NEAR(until([](const Pins& p) { return !p.precharge; }, 500), 100, 20);
  EXPECT_FALSE(driven().charge_enable) << "no request to charge";
  for (int k = 0; k < 100; ++k) step();
  EXPECT_TRUE(driven().main_plus && driven().main_minus);
  EXPECT_EQ(faults().first_cause, 0U);
  EXPECT_EQ(contactor_state().auxiliary_fitted & contactor_state().auxiliary_plus & contactor_state().auxiliary_minus,
            1U);
}

TEST_F(Truck, DrivesAgainAtOnceWithAChargedDcLink) {
  load.link_keeps_its_charge = true;
  ASSERT_TRUE(drive_off());
  load.current_a = 0;
  requests_power = false;
  ASSERT_GE(until([](const Pins& p) { return !p.any_closed(); }, 7'000), 0);
  for (int k = 0; k < 100; ++k) step();
  EXPECT_EQ(faults().first_cause, 0U);
  requests_power = true;
  EXPECT_GE(until([](const Pins& p) { return p.main_plus; }, 3'000), 0);
  EXPECT_EQ(faults().first_cause, 0U) << "a charged DC link is not a weld";
}

/// A fault while driving. The pins open within delay_ms of the table, plus a sample period and the measuring time of
/// the front end.
struct InjectedFault {
  const char* name;
  std::function<void(Bq76952Model&, Load&)> happens;
  int delay_ms;
  std::function<bool(const can::Faults&)> is_published;
  int published_ms = 10;  ///< after the opening, at most
};
class OpensOnFault : public Truck, public ::testing::WithParamInterface<InjectedFault> {};

TEST_P(OpensOnFault, ThePinsOpenInTime) {
  ASSERT_TRUE(drive_off());
  EXPECT_EQ(faults().first_cause, 0U);
  const auto open = [](const Pins& p) { return !p.any_closed(); };
  int ms = 0;
  for (; ms <= GetParam().delay_ms + 2'000 && !open(driven()); ms += 10) {
    if (driven().main_plus) GetParam().happens(chip, load);
    step();
  }
  EXPECT_GE(ms, GetParam().delay_ms);
  EXPECT_LE(ms, GetParam().delay_ms + 100 + 250) << "a sample period, and a scan of the front end";
  for (ms = 0; ms < GetParam().published_ms; ms += 10) step();
  EXPECT_TRUE(GetParam().is_published(faults()));
}

// an auxiliary contact opens everything at once; its fault is in the table 0.3 s and a sample later
INSTANTIATE_TEST_SUITE_P(
    On, OpensOnFault,
    ::testing::Values(InjectedFault{"SevereOvervoltage", [](auto& chip, auto&) { chip.cell_v[5] = 3.9; }, 200,
                                    [](const auto& f) { return f.cell_overvoltage_severe == 1; }},
                      InjectedFault{"SevereUndervoltage", [](auto& chip, auto&) { chip.cell_v[9] = 1.7; }, 200,
                                    [](const auto& f) { return f.cell_undervoltage_severe == 1; }},
                      InjectedFault{"ShortCircuit", [](auto&, auto& load) { load.current_a = -45; }, 0,
                                    [](const auto& f) { return f.short_circuit == 1; }},
                      InjectedFault{"AContactorThatOpens", [](auto&, auto& load) { load.plus_fails = true; }, 0,
                                    [](const auto& f) { return f.contactor_not_closed == 1; }, 600}),
    [](const auto& p) { return std::string(p.param.name); });

/// Bit 0: main plus, else main minus; bit 1: the auxiliary contacts are stuck open, only the voltages show the weld.
class WeldedPole : public Truck, public ::testing::WithParamInterface<int> {};

TEST_P(WeldedPole, GivesNoPowerAndIsPublished) {
  const bool plus = (GetParam() & 1) != 0;
  (plus ? load.plus_welded : load.minus_welded) = true;
  pins.stuck_open = (GetParam() & 2) != 0;
  requests_power = true;
  EXPECT_LT(until([](const Pins& p) { return p.main_plus; }, 3'000), 0);
  EXPECT_EQ(faults().contactor_welded, 1U);
  EXPECT_EQ(contactor_state().welded_pole,
            plus ? can::ContactorState::welded_pole_plus : can::ContactorState::welded_pole_minus);
  EXPECT_FALSE(driven().any_closed());
}
INSTANTIATE_TEST_SUITE_P(Of, WeldedPole, ::testing::Range(0, 4));

/// The supply of the coils fails for a moment between two samples: the contacts drop out while the outputs are on.
class LostCoils : public Truck, public ::testing::WithParamInterface<std::pair<int, int>> {};

TEST_P(LostCoils, OpenAllOutputsByTheInterruptOfTheAuxiliaryContacts) {
  const auto [phase_ms, lasts_ms] = GetParam();
  ContactInterrupt exti{pins};
  board.plugged[ContactInterrupt::base] = &exti;
  ASSERT_TRUE(drive_off());
  board.run_for_ms(phase_ms);
  load.coils_without_supply = true;
  move_contacts();
  board.run_for_ms(0.2);
  EXPECT_FALSE(driven().any_closed()) << "the interrupt";
  board.run_for_ms(lasts_ms);
  load.coils_without_supply = false;
  for (int k = 0; k < 80; ++k) {
    step();
    ASSERT_FALSE(driven().any_closed()) << k;
  }
  EXPECT_EQ(faults().contactor_not_closed, 1U);
  EXPECT_EQ(faults().internal_fault, 0U);
}

INSTANTIATE_TEST_SUITE_P(AtForMs, LostCoils, ::testing::Values(std::pair(3, 1), std::pair(47, 40), std::pair(91, 250)),
                         [](const auto& p) {
                           return std::to_string(p.param.first) + "_" + std::to_string(p.param.second);
                         });

/// Dips of the supply that begin at any time between two samples and last for less than the time between them.
struct Dip {
  double duration_ms, phase_ms;  ///< phase: after a multiple of 10 ms
};
class DipWhileDriving : public Truck, public ::testing::WithParamInterface<Dip> {};

TEST_P(DipWhileDriving, OpensUntilTheKeyIsTurnedAndThenPrecharges) {
  ASSERT_TRUE(drive_off());
  board.run_for_ms(GetParam().phase_ms);
  board.supply(true);
  board.run_for_ms(GetParam().duration_ms);
  EXPECT_FALSE(driven().any_closed()) << "the interrupt";
  board.supply(false);
  for (int k = 0; k < 30; ++k) {
    step();
    ASSERT_FALSE(driven().any_closed()) << k;
  }
  EXPECT_EQ(faults().internal_fault, 0U);
  EXPECT_EQ(faults().first_cause, can::Faults::first_cause_supply_dip);
  requests_power = false;  // the request expires
  load.current_a = 0;
  for (int k = 0; k < 700; ++k) step();
  for (int k = 0; k < 50; ++k) {
    step();
    ASSERT_FALSE(driven().any_closed()) << "without a request";
  }
  requests_power = true;
  ASSERT_GE(until([](const Pins& p) { return p.any_closed(); }, 4'000), 0);
  EXPECT_FALSE(driven().main_plus) << "self-test and precharge come first";
}

INSTANTIATE_TEST_SUITE_P(Ms, DipWhileDriving, ::testing::Values(Dip{1, 3}, Dip{99, 31}),
                         [](const auto& p) { return fmt::format("{:g}", p.param.duration_ms); });

/// A failure of the clock while driving. within_ms: stated in boards/stm32f405_forklift/README.md.
struct ClockFailure {
  const char* name;
  std::function<void(RccModel&)> happens;
  double within_ms;
};
/// At both ends of the slow oscillator's range [Hz].
class ClockFailsWhileDriving : public Truck, public ::testing::WithParamInterface<std::tuple<ClockFailure, double>> {};

TEST_P(ClockFailsWhileDriving, TheContactorsOpenInTimeAndStayOpen) {
  const auto& [failure, lsi_hz] = GetParam();
  board.may_start_again = true;
  board.rcc.lsi_hz = lsi_hz;
  ASSERT_TRUE(drive_off());
  board.run_for_ms(37);
  clock_works = false;
  failure.happens(board.rcc);
  const auto open = [&] { return !driven().any_closed(); };
  ASSERT_TRUE(board.run_until(open, failure.within_ms)) << failure.name;
  for (int k = 0; k < 250; ++k) {
    ASSERT_TRUE(open()) << k;
    board.run_for_ms(10);
  }
  EXPECT_TRUE(board.board_state().unfit());
}

INSTANTIATE_TEST_SUITE_P(
    On, ClockFailsWhileDriving,
    ::testing::Combine(::testing::Values(ClockFailure{"CrystalStops", [](RccModel& rcc) { rcc.crystal = false; }, 0.1},
                                         ClockFailure{"CrystalStopsUnnoticed",
                                                      [](RccModel& rcc) { rcc.crystal = rcc.security_works = false; },
                                                      5},
                                         ClockFailure{"PllUnlocks", [](RccModel& rcc) { rcc.pll_locks = false; }, 5},
                                         ClockFailure{"CoreStandsStill",
                                                      [](RccModel& rcc) {
                                                        rcc.pll_locks = false;
                                                        rcc.free_running_hz = 0;
                                                      },
                                                      3'770}),
                       ::testing::Values(17e3, 47e3)),
    [](const auto& p) {
      return fmt::format("{}With{:.0f}Khz", std::get<0>(p.param).name, 1e-3 * std::get<1>(p.param));
    });

/// Disturbances of the I2C bus cost no sample.
TEST_F(FrontEndBoard, AMisplacedStartOrStopDoesNotDisturbATransfer) {
  board.run_for_ms(3'000);
  const unsigned transfers_a_period = [&] {
    const unsigned before = i2c.transfers;
    board.run_for_ms(1'000);
    return (i2c.transfers - before) / 10;
  }();
  const unsigned before = i2c.transfers;
  i2c.bus_errors = 100;
  board.run_for_ms(1'000);
  EXPECT_EQ(i2c.bus_errors, 0U);
  EXPECT_NEAR(i2c.transfers - before, 10 * transfers_a_period, 12) << "nothing is repeated";
  expect_cells();
}

TEST_F(FrontEndBoard, ALostArbitrationAndARefusedByteCostNoReading) {
  board.run_for_ms(3'000);
  for (int k = 0; k < 4; ++k) {
    const unsigned before = board.estimates;
    i2c.arbitrations_lost = 1;
    i2c.bytes_until_refused = k;
    chip.cell_v[3] = 3.2 + 0.01 * k;
    board.run_for_ms(1'300);  // the message is sent once a second
    EXPECT_EQ(i2c.arbitrations_lost, 0U);
    EXPECT_EQ(i2c.bytes_until_refused, -1);
    EXPECT_GE(board.estimates - before, 12U);
    expect_cells();
  }
}

TEST_F(Truck, DrivesWithWornOutFlashAndReportsIt) {
  board.flash.worn_out = true;
  EXPECT_TRUE(drive_off());
  EXPECT_EQ(faults().storage_fault, 1U);
}

/// Cells of the rows of a Markdown table, by the first one.
std::map<std::string, std::vector<std::string>> rows_of(const std::string& page) {
  std::map<std::string, std::vector<std::string>> rows;
  std::istringstream lines(page);
  for (std::string line; std::getline(lines, line);) {
    std::vector<std::string> cells;
    for (std::size_t at = 0; line.starts_with("| ") && at + 2 < line.size();) {
      const std::size_t end = line.find(" |", at + 2);
      if (end == std::string::npos) break;
      cells.push_back(line.substr(at + 2, end - at - 2));
      at = end + 1;
    }
    if (cells.size() > 3) rows[cells[0]] = cells;
  }
  return rows;
}

/// The table next to the image is read from the bytes of the image, by the manual of the chip. The one of the README is
/// computed by the code of the firmware.
TEST(SecondLineTable, OfTheImageIsTheColumnOfTheReadme) {
  std::filesystem::path table = image();
  const auto of_image = rows_of(files::read_file(table.replace_extension(".second_line.md")));
  const auto of_readme = rows_of(files::read_file(BMS_SOURCE_DIR "/hal/bq76952/README.md"));
  int compared = 0;
  for (const char* name : {"COV", "CUV", "OCC", "OCD1", "OCD2", "OCD3", "SCD", "OTC", "OTD", "UTC"}) {
    ASSERT_TRUE(of_image.contains(name) && of_readme.contains(name)) << name;
    const auto &here = of_image.at(name), &there = of_readme.at(name);
    EXPECT_EQ(here[1], there[1]) << name << ": what it opens";
    EXPECT_EQ(here[2], there[2]) << name << ": threshold";
    EXPECT_NEAR(std::stod(here.back()), std::stod(there.back()), 0.051) << name << ": delay";
    ++compared;
  }
  EXPECT_EQ(compared, 10);
  EXPECT_TRUE(of_image.contains("host watchdog"));
}

}  // namespace
}  // namespace bms::firmware
