// The statements of the wiring table about L+ and L-, over 200 random worlds, with the limits that the circuit gives.
// Voltages are those of the nodes; write_wiring_table prints what the dividers show of them.
#include "tests/evidence/plant/circuit/wiring.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace bms::plant {
namespace {

template <class Check>
void for_all_worlds(const Check& check) {
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    SCOPED_TRACE(seed);
    check(random_world(seed));
  }
}

/// L+ and L- float: the potentials for which the currents through dividers and LD add up to zero.
double floating_plus_v(const TruckParameters& world, double dc_link_v, double vdda_v) {
  const auto equivalent = [&](const Divider& d, double& ohm) {
    const double parallel_ohm = d.lower_ohm * d.bias_ohm / (d.lower_ohm + d.bias_ohm);
    ohm = d.upper_ohm + parallel_ohm;
    return vdda_v * parallel_ohm / d.bias_ohm;
  };
  double plus_ohm = 0, minus_ohm = 0;
  const double plus_v = equivalent(world.plus_divider, plus_ohm), minus_v = equivalent(world.minus_divider, minus_ohm);
  const double ld_s = 1 / (world.front_end.series_ohm + world.front_end.ld_ohm);
  return (plus_v / plus_ohm + (minus_v + dc_link_v) / minus_ohm) / (1 / plus_ohm + 1 / minus_ohm + ld_s);
}

TEST(Wiring, AllOpenTheDcLinkFloatsAroundTheBiasOfTheDividers) {
  for_all_worlds([](const TruckParameters& world) {
    const Situation open = at_rest_after(world, world.dc_link.start_v, {});
    const double expected_v = floating_plus_v(world, open.v.dc_link_v(), world.supply.vdda_v);
    EXPECT_NEAR(open.v.l_plus_v, expected_v, 0.02);  // the open contacts have 10 Gohm
    // Not "at Vc / 2 or less": the bias lifts both, by 1.65 V at most
    EXPECT_LT(open.v.l_plus_v, open.v.dc_link_v() / 2 + 1.72);
  });
}

TEST(Wiring, AClosedOrWeldedContactOfThePositiveSideHoldsLPlusAtBPlus) {
  for_all_worlds([](const TruckParameters& world) {
    for (const Relay relay : {Relay::main_plus, Relay::precharge}) {
      const Situation one = at_rest_after(world, world.dc_link.start_v, {relay});
      EXPECT_NEAR(one.v.l_plus_v, one.v.b_plus_v, 0.02);  // 52 ohm x 0.2 mA
      EXPECT_NEAR(one.v.l_minus_v, one.v.b_plus_v - one.v.dc_link_v(), 0.02);
    }
  });
}

TEST(Wiring, AClosedOrWeldedMinusContactorHoldsLMinusAtZero) {
  for_all_worlds([](const TruckParameters& world) {
    const Situation one = at_rest_after(world, world.dc_link.start_v, {Relay::main_minus});
    EXPECT_NEAR(one.v.l_minus_v, 0, 1e-6);
    EXPECT_NEAR(one.v.l_plus_v, one.v.dc_link_v(), 1e-6);
    const Situation with_precharge = at_rest_after(world, 0, {Relay::main_minus, Relay::precharge});
    EXPECT_NEAR(with_precharge.v.l_minus_v, 0, 1e-3);
  });
}

TEST(Wiring, AnOpenPrechargePathLeavesLPlusFarBelowBPlus) {
  for_all_worlds([](const TruckParameters& world) {
    const Situation open = at_rest_after(world, world.dc_link.start_v, {});
    EXPECT_LT(open.v.l_plus_v, open.v.b_plus_v / 2 + 1.72);
  });
}

TEST(Wiring, WithTheDcLinkAtBPlusAllClosedPositionsLookAlike) {
  TruckParameters world = typical_world();
  const double full_v = battery_v(world);
  const Situation plus = at_rest_after(world, full_v, {Relay::main_plus}),
                  minus = at_rest_after(world, full_v, {Relay::main_minus});
  const Situation precharge = at_rest_after(world, full_v, {Relay::precharge});
  for (const Situation& one : {plus, minus, precharge}) {
    EXPECT_NEAR(one.v.l_plus_v, full_v, 0.02);
    EXPECT_NEAR(one.v.l_minus_v, 0, 0.02);
  }
}

/// The curve with the load of bleeder and DC/DC converter at its end, and the time constant of both resistances.
TEST(Wiring, PrechargeFollowsTheExponentialWithoutLoadAndABleederDividesIt) {
  for_all_worlds([](TruckParameters world) {
    world.dc_link.idle_w = 0;
    const double ohm = world.precharge.ohm, bleeder_ohm = world.dc_link.bleeder_ohm;
    const double share = std::isfinite(bleeder_ohm) ? bleeder_ohm / (bleeder_ohm + ohm) : 1;
    const double start_v = world.dc_link.start_v, time_s = ohm * world.dc_link.capacitance_f;
    const Situation after = precharged(world, start_v, time_s);
    const double end_v = share * after.v.b_plus_v;
    // 20 mohm of ESR and 20 mohm of cells next to 50 ohm, and B+ falls by 20 mV under the current
    EXPECT_NEAR(after.v.dc_link_v(), end_v + (start_v - end_v) * std::exp(-1 / share), 0.04);
  });
}

TEST(Wiring, ADcDcConverterOf5WKeepsThePrechargeBelow90Percent) {
  TruckParameters world = typical_world();
  world.dc_link.idle_w = 5;
  const Situation after = precharged(world, 0, 10);
  const double v = after.v.b_plus_v;
  EXPECT_NEAR(after.v.dc_link_v(), v / 2 + std::sqrt(v * v / 4 - 50 * 5), 0.01);
  EXPECT_LT(after.v.dc_link_v(), 0.90 * v);
}

TEST(Wiring, AChargerBehindAWeldedChargeContactorHoldsTheDcLinkUp) {
  TruckParameters world = typical_world();
  world.charger.idle_v = 40;
  world.dc_link.start_v = 40;
  world.dc_link.bleeder_ohm = 1e4;
  Truck truck(world);
  weld(truck, {Relay::charge});
  truck.advance(20);  // ten times the bleeder's half-life of charge lost without the charger
  EXPECT_NEAR(truck.voltages().dc_link_v(), 40, 0.1);
}

}  // namespace
}  // namespace bms::plant
