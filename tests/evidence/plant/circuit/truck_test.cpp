#include "plant/circuit/truck.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "tests/evidence/plant/circuit/wiring.hpp"

namespace bms::plant {
namespace {

ControllerPins pins(std::initializer_list<Relay> high) {
  ControllerPins result;
  for (const Relay relay : high) result.relay[static_cast<std::size_t>(relay)] = PinLevel::high;
  result.ddsg = result.dchg = PinLevel::high;
  return result;
}

/// K1 and K2 closed, the DC link charged.
Truck running(TruckParameters world) {
  world.dc_link.start_v = battery_v(world);
  Truck truck(world);
  truck.set_pins(pins({Relay::main_plus, Relay::main_minus}));
  truck.advance(0.1);
  return truck;
}

TEST(Truck, BiasedDividersShowTheVoltagesOfTheDcLink) {
  const Situation all = at_rest_after(typical_world(), 20, {Relay::main_plus});
  EXPECT_NEAR(all.plus_v, all.v.l_plus_v, 1e-3);
  EXPECT_NEAR(all.minus_v, all.v.l_minus_v, 1e-3);
  EXPECT_NEAR(all.v.l_minus_v, all.v.b_plus_v - 20, 0.01);
  const Truck truck(typical_world());
  EXPECT_NEAR(truck.pins().vdda_v, 3.3, 1e-12);
}

TEST(Truck, PrechargesThroughItsResistorWithHalfOfTheEnergy) {
  TruckParameters world = typical_world();
  Truck truck(world);
  truck.set_pins(pins({Relay::main_minus, Relay::precharge}));
  truck.advance(5);
  const double v = battery_v(world);
  EXPECT_NEAR(truck.voltages().dc_link_v(), v, 0.01);
  // the bounce of K3 and the loss in the other resistances of 0.02 ohm are below 1 %
  EXPECT_NEAR(truck.precharge_heat_j(), 0.01 * v * v / 2, 0.01 * 0.01 * v * v / 2);
  EXPECT_GT(truck.precharge_resistor_c(), 25.5);
}

TEST(Truck, PrechargeResistorOverheatsOnAShortedDcLink) {
  TruckParameters world = typical_world();
  world.dc_link.bleeder_ohm = 0.01;
  Truck truck(world);
  weld(truck, {Relay::main_minus, Relay::precharge});
  truck.advance(20);
  const double w = battery_v(world) * battery_v(world) / 50;
  EXPECT_NEAR(truck.precharge_heat_j(), 20 * w, 0.01 * 20 * w);
  EXPECT_GT(truck.precharge_resistor_c(), 80);
}

TEST(Truck, MeasuresTheCurrentOfTheBatteryWithItsSign) {
  Truck truck = running(typical_world());
  truck.set_drive({.power_w = 5'000});
  truck.advance(0.05);
  EXPECT_NEAR(truck.current_a(), -5'000 / truck.voltages().dc_link_v(), 0.3);
  EXPECT_NEAR(truck.pins().shunt_v, 1e-4 * truck.current_a(), 1e-9);
  EXPECT_NEAR(truck.pins().pa1_v, 1.65 + 1.65e-3 * truck.current_a(), 1e-9);
  EXPECT_LT(truck.voltages().b_plus_v, battery_v(typical_world()) - 0.5);
  truck.set_drive({.power_w = -2'000});
  truck.advance(0.05);
  EXPECT_GT(truck.current_a(), 30);
}

TEST(Truck, CellsAddUpToTheBatteryAndTheirChargeIsCounted) {
  for (const std::size_t cells : {8U, 16U, 24U}) {
    TruckParameters world = typical_world(cells);
    world.cells[1].soc = 0.7;
    world.dc_link.lockout_v = 10;
    Truck truck = running(world);
    truck.set_drive({.current_a = 100});
    truck.advance(10);
    double sum_v = 0;
    for (std::size_t k = 0; k < cells; ++k) sum_v += truck.cell_v(k);
    EXPECT_NEAR(sum_v + 0.3e-3 * truck.current_a(), truck.voltages().b_plus_v, 1e-3);
    EXPECT_NEAR(truck.cells().soc(0), 0.5 - 100 * 10 / (200 * 3'600.0), 1e-6);
    EXPECT_NEAR(truck.cells().soc(1), 0.7 - 100 * 10 / (200 * 3'600.0), 1e-6);
  }
}

TEST(Truck, CellAgreesWithTheReferenceCell) {
  TruckParameters world = typical_world();
  Truck truck = running(world);
  Cell reference({.capacity_ah = 6}, {.soc = 0.5});  // 3 A through 6 Ah are 100 A through 200 Ah
  truck.set_drive({.current_a = 100});
  for (int k = 0; k < 60; ++k) {
    truck.advance(1);
    reference.run(truck.current_a() * 6 / 200, 20, 1);
    ASSERT_NEAR(truck.cell_v(0), reference.voltage_v(), 3e-4) << k;  // the OCV is linear over 0.1 % of SOC
  }
}

TEST(Truck, ChargerChargesWithConstantCurrentThenVoltage) {
  TruckParameters world = typical_world();
  for (StringCell& cell : world.cells) cell.soc = 0.9;
  world.dc_link.start_v = battery_v(world);
  Truck truck(world);
  truck.set_pins(pins({Relay::main_plus, Relay::main_minus, Relay::charge}));
  truck.set_charger({.on = true, .voltage_v = 58.4, .current_a = 30});
  truck.advance(1);
  EXPECT_NEAR(truck.current_a(), 30, 0.1);
  truck.set_charger({.on = true, .voltage_v = battery_v(world) + 0.15, .current_a = 30});
  truck.advance(5);
  EXPECT_LT(truck.current_a(), 0.15 / CellString(world.cells).resistance_ohm());
  EXPECT_GT(truck.current_a(), 5);
  EXPECT_NEAR(truck.voltages().charger_v, battery_v(world) + 0.15, 0.03);  // 1 mohm of the limit
}

TEST(Truck, EnablesOfTheFrontEndOpenTheirContactors) {
  Truck truck = running(typical_world());
  ControllerPins without_ddsg = pins({Relay::main_plus, Relay::main_minus, Relay::charge});
  truck.set_pins(without_ddsg);
  truck.advance(0.1);
  EXPECT_TRUE(truck.contact_closed(Relay::charge));
  without_ddsg.ddsg = without_ddsg.dchg = PinLevel::low;
  truck.set_pins(without_ddsg);
  truck.advance(0.1);
  EXPECT_FALSE(truck.contact_closed(Relay::main_plus));
  EXPECT_FALSE(truck.contact_closed(Relay::charge));
  EXPECT_TRUE(truck.contact_closed(Relay::main_minus));
  EXPECT_EQ(truck.pins().pb14_v, 3.3);
  EXPECT_EQ(truck.pins().pb15_v, 0);
  ControllerPins floating;
  floating.relay.fill(PinLevel::floating);
  truck.set_pins(floating);
  truck.advance(0.1);
  EXPECT_FALSE(truck.contact_closed(Relay::main_minus));
}

TEST(Truck, LogsTheVoltageAndThePeakCurrentOfAClosing) {
  TruckParameters world = typical_world();
  Truck truck(world);
  truck.set_pins(pins({Relay::main_plus, Relay::main_minus}));
  truck.advance(0.1);
  // Both close on an empty DC link: the second one makes the inrush through all resistances of the loop.
  const auto worst = std::max_element(truck.events().begin(), truck.events().end(),
                                      [](const ContactEvent& a, const ContactEvent& b) { return a.peak_a < b.peak_a; });
  ASSERT_NE(worst, truck.events().end());
  const double loop_ohm = CellString(world.cells).resistance_ohm() + 0.3e-3 + 0.1e-3 + 2 * 0.2e-3 + 0.010;
  EXPECT_TRUE(worst->closes);
  EXPECT_NEAR(std::abs(worst->across_v), battery_v(world), 0.1);
  EXPECT_NEAR(worst->peak_a, battery_v(world) / loop_ohm, 0.01 * worst->peak_a);
}

TEST(Truck, DipsOfTheSuppliesReachThePinsAndTheCoils) {
  Truck truck = running(typical_world());
  truck.add_vdda_dip({truck.time_s() + 0.01, 0.005, 0.3});
  truck.advance(0.0149);
  EXPECT_NEAR(truck.pins().vdda_v, 3.0, 1e-9);
  truck.advance(0.001);
  EXPECT_NEAR(truck.pins().vdda_v, 3.3, 1e-9);
  truck.add_coil_supply_dip({truck.time_s(), 0.030, 9});
  truck.advance(0.02);
  EXPECT_FALSE(truck.contact_closed(Relay::main_plus));
}

TEST(Truck, CoilsPullTheRailDownInABadInstallation) {
  TruckParameters world = typical_world();
  world.supply.rail_ohm = 0.3;
  Truck truck(world);
  truck.set_pins(pins({Relay::main_minus}));
  double least_v = 3.3;
  for (int k = 0; k < 300; ++k) {
    truck.advance(0.001);
    least_v = std::min(least_v, truck.pins().vdda_v);
  }
  EXPECT_LT(least_v, 3.25);
  EXPECT_NEAR(truck.pins().vdda_v, 3.3, 1e-3);
}

TEST(Truck, RecuperationIntoAnOpenContactorRaisesTheDcLink) {
  Truck truck = running(typical_world());
  truck.set_drive({.current_a = -100});
  truck.advance(0.02);
  truck.set_pins({});
  truck.advance(0.05);
  EXPECT_NEAR(truck.voltages().dc_link_v(), 64, 1);  // where the drive stops, and not the battery
}

TEST(Truck, ResistorsAndWiresBreak) {
  Truck truck(typical_world());
  truck.break_wire(Wire::precharge_resistor);
  weld(truck, {Relay::precharge});
  truck.advance(0.06);
  EXPECT_LT(truck.voltages().l_plus_v, 2);
  Truck second = running(typical_world());
  second.break_wire(Wire::plus_divider);
  second.advance(0.06);
  EXPECT_NEAR(second.pins().pc1_v, 3.3 / 2, 0.01);
  Truck third = running(typical_world());
  third.break_wire(Wire::fuse);
  third.set_drive({.power_w = 1'000});
  third.advance(0.5);
  EXPECT_LT(third.voltages().b_plus_v, 38);  // the drive has emptied the DC link down to its lock-out
}

TEST(Truck, IsTheSameForTheSameSeed) {
  const auto run = [] {
    Truck truck = running(random_world(17));
    truck.set_drive({.power_w = 3'000});
    truck.advance(0.5);
    return truck.voltages().l_plus_v;
  };
  EXPECT_EQ(run(), run());
}

/// One alone carries no current. With the truck's own the floating poles follow the tap.
TEST(Truck, ALeakToTheFrameMovesThePolesThatFloat) {
  constexpr double leak_ohm = 4e3, sound_ohm = 1e6;
  TruckParameters world = typical_world(24);
  const double without_v = at_rest_after(world, 0, {}).v.l_plus_v;
  double before_v = -1;
  for (const std::size_t below : {std::size_t{0}, std::size_t{12}, std::size_t{24}}) {
    world.leaks = {.string_ohm = leak_ohm, .cells_below = below};
    EXPECT_NEAR(at_rest_after(world, 0, {}).v.l_plus_v, without_v, 1e-3) << below << ": 1 Tohm stands for none";
    world.leaks.plus_ohm = world.leaks.minus_ohm = sound_ohm;
    const double v = at_rest_after(world, 0, {}).v.l_plus_v;
    EXPECT_GT(v, before_v + (below > 0 ? 10 : 0)) << below;
    before_v = v;
    Truck truck(world);
    truck.advance(0.1);
    double cells_v = 0;
    for (std::size_t k = 0; k < truck.cell_count(); ++k) cells_v += truck.cell_v(k);
    EXPECT_NEAR(truck.voltages().b_plus_v, cells_v, 1e-3) << "the string is whole";
    EXPECT_NEAR(truck.insulation_ohm(), leak_ohm, 1e-9);
    weld(truck, {Relay::main_minus});
    truck.advance(0.1);
    EXPECT_NEAR(truck.insulation_ohm(), 1 / (1 / leak_ohm + 2 / sound_ohm), 1e-9) << "the truck's count, too";
    truck.set_string_leak_ohm(sound_ohm);
    EXPECT_NEAR(truck.insulation_ohm(), sound_ohm / 3, 1e-6);
  }
}

}  // namespace
}  // namespace bms::plant
