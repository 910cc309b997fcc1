// A leak from a tap of 24 cells to the frame, at the split of the two chips and at both ends: what a monitor at the
// board's input makes the flashed image report and do, and what the leak does to the tests of the contactors.
#include <cstdio>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/firmware/world/operating.hpp"

namespace bms::world {
namespace {

using plant::Relay;
using ::testing::IsEmpty;

constexpr std::size_t cells_of_truck = 24;
constexpr double leak_ohm = 4e3, no_leak_ohm = 1e9, sound_truck_ohm = 1e6;

/// 100 ohm per volt of 24 cells of 3.65 V.
constexpr double least_kohm = 0.1 * cells_of_truck * 3.65;
/// The monitor follows within 20 s, the row waits for 10 s.
constexpr double found_within_ms = 30'000 + 500;

const Pack& truck() {
  static const Pack built = pack_with_insulation_monitor(cells_of_truck);
  return built;
}

WorldSetup setup_with(std::size_t cells_below, double plus_ohm = sound_truck_ohm, double minus_ohm = sound_truck_ohm) {
  WorldSetup setup = typical_setup(truck());
  setup.truck.leaks = {no_leak_ohm, cells_below, plus_ohm, minus_ohm};
  return setup;
}

std::string faults_of(const TruckWorld& world) { return fault_names(world.vehicle.faults()); }

/// Cells below the leak.
class LeakAt : public ::testing::TestWithParam<std::size_t> {};

/// With a leak at the top L+ passes the voltage of the pack while the DC link discharges.
TEST_P(LeakAt, IsReportedForbidsChargingAndEndsWithTheLeak) {
  TruckWorld world(truck().image, setup_with(GetParam()));
  world.fit_insulation_monitor();
  ASSERT_EQ(bring_to(world, truck(), Operating::drive), "");
  world.run_ms(20'000);
  EXPECT_NEAR(world.vehicle.insulation_kohm(), 500, 10) << "1 Mohm from each pole of the DC link";
  EXPECT_EQ(fault_names(world.vehicle.faults_seen()), "none");

  const double begun_ms = world.now_ms();
  world.truck.set_string_leak_ohm(leak_ohm);
  const auto low = [&] { return faults_of(world).find("insulation low") != std::string::npos; };
  EXPECT_GE(world.run_until(low, found_within_ms), 0) << summary(world);
  const double reported_kohm = world.vehicle.insulation_kohm();
  std::printf("%zu cells below: insulation low after %.1f s, %.1f kohm reported then\n", GetParam(),
              1e-3 * (world.now_ms() - begun_ms), reported_kohm);
  EXPECT_LT(reported_kohm, least_kohm);
  world.run_ms(20'000);
  EXPECT_NEAR(world.vehicle.insulation_kohm(), 4, 0.3);
  EXPECT_TRUE(world.both_mains_closed()) << "a first fault does not stop a truck";

  EXPECT_GE(key_off(world), 0);
  world.run_ms(13'000);  // the precharge resistor cools
  world.vehicle.request = Request::charge;
  EXPECT_LT(world.run_until([&] { return world.closed(Relay::charge); }, 10'000), 0) << "the charger is earthed";
  EXPECT_EQ(fault_names(world.vehicle.faults_seen()), "insulation low");
  world.vehicle.request = Request::none;
  world.run_ms(2'000);

  world.truck.set_string_leak_ohm(no_leak_ohm);
  EXPECT_GE(world.run_until([&] { return !low(); }, 20'000 + 60'000 + 1'000), 0) << summary(world);
  world.vehicle.request = Request::charge;
  const auto charges = [&] { return world.closed(Relay::charge) && world.both_mains_closed(); };
  EXPECT_GE(world.run_until(charges, start_limit_ms), 0) << summary(world);
  EXPECT_THAT(world.closings_below_v(closing_limit_v), IsEmpty());
  EXPECT_THAT(world.violations(), IsEmpty());
}
INSTANTIATE_TEST_SUITE_P(Insulation, LeakAt, ::testing::Values(0, 12, 24), ::testing::PrintToStringParamName());

/// The signals that are no measurement. The row waits for 60 s.
TEST(InsulationMonitor, ThatFailsIsUnknown) {
  TruckWorld world(truck().image, setup_with(12));
  world.fit_insulation_monitor();
  world.run_ms(4'000);
  EXPECT_GT(world.vehicle.insulation_kohm(), 6'000) << "no leak: the end of the signal";
  for (const auto fault :
       {InsulationDevice::Fault::device, InsulationDevice::Fault::earth_broken, InsulationDevice::Fault::no_supply}) {
    world.insulation->fault = fault;
    world.run_ms(2'000);
    EXPECT_LT(world.vehicle.insulation_kohm(), 0);
    world.insulation->fault = InsulationDevice::Fault::none;
    world.run_ms(3'000);
    EXPECT_GT(world.vehicle.insulation_kohm(), 6'000);
  }
  EXPECT_EQ(fault_names(world.vehicle.faults_seen()), "none");
  world.insulation->fault = InsulationDevice::Fault::earth_broken;
  world.run_ms(62'000);
  EXPECT_EQ(faults_of(world), "insulation unknown");
}

/// The leak is there before the key is turned, and a second one of the truck: a sound one has 1 Mohm.
struct StartWithLeaks {
  const char* name;
  std::size_t cells_below;
  double plus_ohm, minus_ohm;
};
void PrintTo(const StartWithLeaks& s, std::ostream* to) { *to << s.name; }
class TwoLeaks : public ::testing::TestWithParam<StartWithLeaks> {};

TEST_P(TwoLeaks, CloseNoContactorInTheWrongMoment) {
  WorldSetup setup = setup_with(GetParam().cells_below, GetParam().plus_ohm, GetParam().minus_ohm);
  setup.truck.leaks.string_ohm = leak_ohm;
  TruckWorld world(truck().image, setup);
  world.run_ms(2'000);
  const plant::TrueVoltages open = world.truck.voltages();
  const std::string first = bring_to(world, truck(), Operating::drive);
  ASSERT_EQ(first, "");
  EXPECT_EQ(fault_names(world.vehicle.faults_seen()), "none");
  EXPECT_GE(key_off(world), 0);
  world.run_ms(14'000);
  const std::string again = bring_to(world, truck(), Operating::drive),
                    faults = fault_names(world.vehicle.faults_seen());
  std::printf("%s: L+ %.1f V, L- %.1f V while open; after a key-off %s, faults: %s\n", GetParam().name, open.l_plus_v,
              open.l_minus_v, again.empty() ? "drives" : again.c_str(), faults.c_str());
  EXPECT_EQ(again, "");
  EXPECT_EQ(faults, "none");
  EXPECT_THAT(world.closings_below_v(closing_limit_v), IsEmpty());
  EXPECT_THAT(world.violations(), IsEmpty());
}
constexpr double worn_ohm = 50e3;
INSTANTIATE_TEST_SUITE_P(Insulation, TwoLeaks,
                         ::testing::Values(StartWithLeaks{"SplitSoundTruck", 12, sound_truck_ohm, sound_truck_ohm},
                                           StartWithLeaks{"SplitAndMinus", 12, sound_truck_ohm, worn_ohm},
                                           StartWithLeaks{"SplitAndPlus", 12, worn_ohm, sound_truck_ohm},
                                           StartWithLeaks{"TopSoundTruck", 24, sound_truck_ohm, sound_truck_ohm},
                                           StartWithLeaks{"TopAndMinus", 24, sound_truck_ohm, worn_ohm},
                                           StartWithLeaks{"TopAndPlus", 24, worn_ohm, sound_truck_ohm},
                                           StartWithLeaks{"BottomAndMinus", 0, sound_truck_ohm, worn_ohm},
                                           StartWithLeaks{"BottomAndPlus", 0, worn_ohm, sound_truck_ohm}),
                         [](const auto& info) { return std::string(info.param.name); });

}  // namespace
}  // namespace bms::world
