// The flashed image of the forklift board in the circuit of a truck: a few cases of each scenario of `./bms world`, and
// the models of the ports and of the ADC against the reference manual.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/firmware/world/promise.hpp"
#include "tests/firmware/world/scenarios.hpp"

namespace bms::world {
namespace {

using plant::Relay;
using ::testing::IsEmpty;

const Pack& pack() {
  static const Pack built = pack_of(6);
  return built;
}

void expect_good(const Result& result) {
  EXPECT_FALSE(result.outcomes.empty());
  for (const Outcome& o : result.outcomes) EXPECT_TRUE(o.good) << o.name << ": " << o.why;
}

Extent some(std::size_t count, const std::string& only = "") { return {.count = count, .only = only, .at_once = 2}; }

TEST(World, ATruckWithRandomComponentsDrivesChargesAndRestartsWithAChargedDcLink) { expect_good(run_starts(some(3))); }

TEST(World, AWeldedMainContactorIsFoundBeforeTheNextStart) {
  expect_good(run_contact_failures(some(0, "K1 welds while driving|K2 welds while driving")));
}

/// With the cells of the other tests here: no image of its own.
TEST(World, ABurntOrShortedPrechargeResistorIsFound) {
  expect_good(
      run_contact_failures({.only = "resistor burnt|resistor shorted", .at_once = 2, .capacity_ah = printed_ah}));
}

TEST(World, DipsOfTheSupplyNeverCloseAMainContactOnAnEmptyDcLink) { expect_good(run_supply_dips(some(12))); }

TEST(World, ProtectionsActOnPhysicalCauses) {
  expect_good(run_fault_matrix(some(0, "drive: cell overvoltage severe, |drive: cell undervoltage severe, |off: I2C")));
}

TEST(World, AShiftWithNoiseHasNoFault) { expect_good(run_shift({.only = "", .minutes = 3, .at_once = 2})); }

/// And not after it, while the charger goes on to ask.
TEST(World, ChargersOfBothProtocolsChargeUntilAStop) { expect_good(run_charges({.only = "a stop", .at_once = 2})); }

TEST(World, AnOrdinaryDayNeedsNoWorkshop) { expect_good(run_month({.count = 2, .only = "", .days = 1, .at_once = 2})); }

/// Between deep discharge (1.5 V) and cell undervoltage severe (1.8 V): C/20 after a clear command.
TEST(World, ACellBelow1800mVIsChargedWithATwentiethOfTheCapacityOnly) {
  TruckWorld world(pack().image, typical_setup(pack()));
  for (std::size_t k = 0; k < 16; ++k) world.hold_cell(k, 1.65);
  world.run_ms(5'000);
  EXPECT_EQ(world.vehicle.first_cause(), 6U) << "cell undervoltage severe";
  world.vehicle.request = Request::drive;
  world.vehicle.clear_faults();
  EXPECT_LT(world.run_until([&] { return world.any_main_closed(); }, 10'000), 0) << "drives";
  world.vehicle.request = Request::none;
  world.run_ms(1'000);
  world.vehicle.clear_faults();
  world.run_ms(500);
  world.vehicle.request = Request::charge;
  const auto charges = [&] { return world.both_mains_closed() && world.closed(Relay::charge); };
  ASSERT_GE(world.run_until(charges, start_limit_ms), 0) << summary(world);
  world.run_ms(6'000);
  EXPECT_NEAR(world.vehicle.allowed_charge_a(), pack().capacity_ah / 20, 0.02);
  set_charger_a(world, 0.8 * pack().capacity_ah / 20);
  world.run_ms(10'000);
  EXPECT_TRUE(charges()) << summary(world);
  set_charger_a(world, 1.2 * pack().capacity_ah / 10);
  EXPECT_GE(world.run_until([&] { return world.isolated(); }, 1e3 * (chain_s + contactor_s)), 0);
}

/// The flashed image for a truck of 24 V, and one with an odd number of cells.
class PackSize : public ::testing::TestWithParam<std::size_t> {};

TEST_P(PackSize, DrivesChargesAndOpensForItsHighestCell) {
  const Pack small = pack_of(6, GetParam());
  TruckWorld world(small.image, typical_setup(small));
  for (const Operating state : {Operating::drive, Operating::charge, Operating::recuperate}) {
    EXPECT_EQ(bring_to(world, small, state), "");
    EXPECT_EQ(fault_names(world.vehicle.faults_seen()), "none") << name_of(state);
    if (state == Operating::recuperate) break;
    EXPECT_GE(key_off(world), 0) << name_of(state);
  }
  const double begun_ms = world.now_ms();
  world.hold_cell(GetParam() - 1, 3.9);
  EXPECT_GE(world.run_until([&] { return world.isolated(); }, 1e3 * (0.2 + chain_s + contactor_s)), 0);
  EXPECT_GT(world.opened_ms() - begun_ms, 200) << "the delay of the row";
  world.run_ms(300);
  EXPECT_EQ(world.vehicle.first_cause(), 3U) << "cell overvoltage severe";
  EXPECT_THAT(world.closings_below_v(closing_limit_v), IsEmpty());
  EXPECT_THAT(world.violations(), IsEmpty());
}
INSTANTIATE_TEST_SUITE_P(Cells, PackSize, ::testing::Values(8, 15), ::testing::PrintToStringParamName());

/// The promise is read from the page as it is printed.
TEST(Promise, ThePublishedTableHasTheRowsOfTheDbcFileInOrder) {
  const auto rows = promised_rows(BMS_SOURCE_DIR "/firmware/protection/README.md");
  ASSERT_GE(rows.size(), 32U);
  EXPECT_EQ(rows[2].name, "cell overvoltage severe");
  EXPECT_EQ(rows[2].quantity, "highest cell");
  EXPECT_TRUE(rows[2].above);
  EXPECT_EQ(rows[2].reaction, Reaction::open_now);
  EXPECT_FALSE(rows[14].above) << "undertemperature";
  for (unsigned k = 0; k < rows.size(); ++k) EXPECT_EQ(rows[k].bit, k);
}

/// 24 cells: 24 times the limits of a cell; each cell adds 15 mV to the 0.2 V of the stack.
TEST(Promise, TheRowsOfThePackFollowTheNumberOfCells) {
  const auto rows = promised_rows(BMS_SOURCE_DIR "/firmware/protection/README.md", 1, 24),
             printed = promised_rows(BMS_SOURCE_DIR "/firmware/protection/README.md");
  EXPECT_NEAR(rows[6].threshold, 24 * (3.65 + 0.02 * 1.65), 0.01) << "pack overvoltage";
  EXPECT_NEAR(rows[7].threshold, 24 * (2.0 + 0.06 * 1.65), 0.01) << "pack undervoltage";
  EXPECT_NEAR(rows[19].threshold, 0.2 + 24 * 0.015, 1e-3) << "sum mismatch";
  EXPECT_NEAR(rows[19].release_threshold, 0.2 + 24 * 0.005, 1e-3);
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const bool of_pack = k == 6 || k == 7 || k == 19;
    EXPECT_EQ(rows[k].threshold != printed[k].threshold, of_pack) << rows[k].name;
  }
}

/// RM0090, 13.3.8 to 13.5: a sequence of two in single conversions with EOCS, as software polls it.
TEST(AdcModel, ConvertsASequenceInTheTimesOfTheManual) {
  firmware::UnicornBoard board(pack().image);
  ASSERT_TRUE(board.run_until([&] { return (board.register_value(0x40023844) >> 8 & 1) != 0; }, 3'000))
      << "the image clocks the ADC at its first sample, after it has erased the sectors for data";
  AdcModel adc(board);
  adc.noise_lsb = 0;
  adc.pin_v = [](unsigned channel) { return channel == 11 ? 1.65 : 0.33; };
  const double mhz = 1e-6 * board.rcc.apb2_hz();
  adc.write(0x04, 1U << 8, 0);        // SCAN
  adc.write(0x2C, 1U << 20, 0);       // two conversions
  adc.write(0x34, 11 | 10U << 5, 0);  // L+, L-
  adc.write(0x0C, 7U << 3 | 7, 0);    // 480 cycles
  adc.write(0x08, 1 | 1U << 10, 0);   // ADON, EOCS
  adc.write(0x08, 1 | 1U << 10 | 1U << 30, 10);
  const double one_us = (480 + 12) / (mhz / 2);
  EXPECT_EQ(adc.read(0x00, 10 + 0.98 * one_us) & 2, 0U);
  EXPECT_EQ(adc.read(0x00, 10 + 1.02 * one_us) & 2, 2U);
  EXPECT_NEAR(adc.read(0x4C, 10 + 1.03 * one_us), 4095 / 2.0, 1);
  EXPECT_EQ(adc.read(0x00, 10 + 1.9 * one_us) & 2, 0U) << "cleared by reading DR";
  EXPECT_NEAR(adc.read(0x4C, 10 + 2.1 * one_us), 409.5, 1);
  EXPECT_THAT(adc.violations, IsEmpty());
}

TEST(GpioModel, APinDrivesOnlyAsAnOutput) {
  TruckWorld world(pack().image, typical_setup(pack()));
  EXPECT_EQ(world.pin(Relay::main_plus), Level::floating) << "before the firmware runs";
  world.run_ms(2'500);
  EXPECT_EQ(world.pin(Relay::main_plus), Level::low);
  EXPECT_EQ(world.pin(Relay::charge), Level::low);
  world.dip_vdda(1, 20, 3.3);
  world.run_ms(10);
  EXPECT_EQ(world.pin(Relay::main_plus), Level::floating) << "in reset";
  world.run_ms(2'500);
  EXPECT_EQ(world.pin(Relay::main_plus), Level::low);
  EXPECT_THAT(world.violations(), IsEmpty());
}

/// A remainder below a tick of the emulated clock once repeated the same step for ever.
TEST(TruckWorld, PassesTimesThatAreNoMultipleOfAClockTick) {
  TruckWorld world(pack().image, typical_setup(pack()));
  world.run_ms(2'500);  // the erases of the first start are over
  const double begun_ms = world.now_ms();
  plant::Random random(3);
  double sum_ms = 0;
  for (int k = 0; k < 20'000; ++k) {
    const double ms = 0.01 + 0.05 * random.uniform();
    sum_ms += ms;
    world.run_ms(ms);
  }
  EXPECT_NEAR(world.now_ms() - begun_ms, sum_ms, 150) << "a wait for I2C or the converter takes up to 50 us";
}

/// hal/i2c.hpp allows 2 ms in each transfer for clock stretching and interrupts.
TEST(World, ADelayOfMainWithinATransferLosesNoReading) {
  TruckWorld world(pack().image, typical_setup(pack()));
  ASSERT_EQ(bring_to(world, pack(), Operating::standby), "");
  world.run_ms(2'000);
  plant::Random random(5);
  world.fine_steps(60'000, 0.5);
  unsigned within = 0;
  for (int k = 0; k < 60; ++k) {
    world.run_until([&] { return !world.board.sleeping(); }, 200);
    world.run_ms(8 * random.uniform());
    within += world.board.sleeping() ? 0 : 1;
    world.board.program_held = true;
    world.run_ms(1.9);
    world.board.program_held = false;
    world.run_until([&] { return world.board.sleeping(); }, 30);
    world.run_ms(70);
  }
  EXPECT_GT(within, 30U);
  EXPECT_EQ(fault_names(world.vehicle.faults_seen()), "none");
}

/// Board.LongestSample counts from the first transfer of the front end to the last message of the sample.
TEST(World, ASampleWithItsAcquisitionStaysWithinTheBudget) {
  TruckWorld world(pack().image, typical_setup(pack()));
  ASSERT_EQ(bring_to(world, pack(), Operating::drive), "");
  world.run_ms(20'000);
  RecordProperty("longest_sample_us", static_cast<int>(1e3 * world.vehicle.longest_sample_ms()));
  EXPECT_LT(world.vehicle.longest_sample_ms(), 50) << "BMS_SAMPLE_BUDGET_MS of board.cmake";
  EXPECT_GT(world.vehicle.longest_sample_ms(), 9) << "the transfers alone take this time";
}

}  // namespace
}  // namespace bms::world
