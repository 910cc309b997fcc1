// Prints the tables of evidence/plant/circuit/README.md: what the voltages at L+ and L- say, over 200 random worlds.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <vector>

#include "tests/evidence/plant/circuit/wiring.hpp"

namespace {

using namespace bms::plant;
constexpr int worlds = 200;

struct Range {
  double least = std::numeric_limits<double>::infinity(), most = -std::numeric_limits<double>::infinity();
  void add(double value) {
    least = std::min(least, value);
    most = std::max(most, value);
  }
};

void print(const char* what, const Range& truth, const Range& shown) {
  std::printf("| %s | %.2f to %.2f | %.2f to %.2f |\n", what, truth.least, truth.most, shown.least, shown.most);
}

struct Row {
  Range truth, shown;
  void add(double true_v, double shown_as_v) {
    truth.add(true_v);
    shown.add(shown_as_v);
  }
};

/// The statements as deviations from what they say [V].
void print_statements(double tolerance) {
  Row open_plus, open_minus, main_plus, main_plus_minus, precharge, precharge_minus, minus, minus_plus, both, no_relay,
      no_minus;
  for (int seed = 1; seed <= worlds; ++seed) {
    const TruckParameters world = random_world(static_cast<std::uint64_t>(seed), {.divider_tolerance = tolerance});
    const double start_v = world.dc_link.start_v;
    const auto add_difference = [](Row& row, double v, double shown_as_v, double expected_v) {
      row.add(v - expected_v, shown_as_v - expected_v);
    };
    const Situation open = at_rest_after(world, start_v, {});
    add_difference(open_plus, open.v.l_plus_v, open.plus_v, open.v.dc_link_v() / 2);
    add_difference(open_minus, open.v.l_minus_v, open.minus_v, -open.v.dc_link_v() / 2);
    const Situation k1 = at_rest_after(world, start_v, {Relay::main_plus});
    add_difference(main_plus, k1.v.l_plus_v, k1.plus_v, k1.v.b_plus_v);
    add_difference(main_plus_minus, k1.v.l_minus_v, k1.minus_v, k1.v.b_plus_v - k1.v.dc_link_v());
    const Situation k3 = at_rest_after(world, start_v, {Relay::precharge});
    add_difference(precharge, k3.v.l_plus_v, k3.plus_v, k3.v.b_plus_v);
    add_difference(precharge_minus, k3.v.l_minus_v, k3.minus_v, k3.v.b_plus_v - k3.v.dc_link_v());
    const Situation k2 = at_rest_after(world, start_v, {Relay::main_minus});
    add_difference(minus, k2.v.l_minus_v, k2.minus_v, 0);
    add_difference(minus_plus, k2.v.l_plus_v, k2.plus_v, k2.v.dc_link_v());
    const Situation k23 = at_rest_after(world, start_v, {Relay::main_minus, Relay::precharge});
    add_difference(both, k23.v.l_minus_v, k23.minus_v, 0);
    // K3 is switched on and its relay or its resistor is open; K2 is switched on with K3 and stays open
    add_difference(no_relay, open.v.l_plus_v, open.plus_v, open.v.b_plus_v);
    add_difference(no_minus, k3.v.l_minus_v, k3.minus_v, 0);
  }
  std::printf(
      "\nResistors of the dividers within %g %%:\n\n| closed | deviation | in truth [V] | shown by the divider [V] "
      "|\n|---|---|---|---|\n",
      100 * tolerance);
  print("none | L+ - Vc/2", open_plus.truth, open_plus.shown);
  print("none | L- + Vc/2", open_minus.truth, open_minus.shown);
  print("K1 | L+ - V(B+)", main_plus.truth, main_plus.shown);
  print("K1 | L- - (V(B+) - Vc)", main_plus_minus.truth, main_plus_minus.shown);
  print("K3 | L+ - V(B+)", precharge.truth, precharge.shown);
  print("K3 | L- - (V(B+) - Vc)", precharge_minus.truth, precharge_minus.shown);
  print("K2 | L-", minus.truth, minus.shown);
  print("K2 | L+ - Vc", minus_plus.truth, minus_plus.shown);
  print("K2, K3 | L-", both.truth, both.shown);
  print("none; K3 switched on but open | L+ - V(B+)", no_relay.truth, no_relay.shown);
  print("K3; K2 switched on but open | L-", no_minus.truth, no_minus.shown);
}

/// Where two situations look alike.
void print_blind_spots() {
  std::puts(
      "\n| LD divider [Mohm] | none closed, Vc = 0: L+ = L- [V] | L- = 0 with none closed at Vc = [V] | L- per volt of "
      "Vc |\n|---|---|---|---|");
  for (const double ld_ohm : {0.5e6, 1e6, 2e6, 5e6, 1e9}) {
    TruckParameters world = typical_world();
    world.front_end.ld_ohm = ld_ohm;
    const double empty_v = at_rest_after(world, 0, {}).v.l_minus_v;
    const Situation full = at_rest_after(world, 40, {});
    const double slope = (full.v.l_minus_v - empty_v) / full.v.dc_link_v();
    std::printf("| %.1f | %.2f | %.2f | %.2f |\n", ld_ohm / 1e6, empty_v, -empty_v / slope, slope);
  }
  std::puts(
      "\n| bleeder [kohm] | DC/DC idle [W] | time until Vc is 3 V below V(B+) after opening [s] |\n|---|---|---|");
  const double infinite = std::numeric_limits<double>::infinity();
  for (const auto& [bleeder_ohm, idle_w] : std::vector<std::pair<double, double>>{
           {infinite, 0}, {1e5, 0}, {1e4, 0}, {1e3, 0}, {infinite, 1}, {infinite, 5}}) {
    TruckParameters world = typical_world();
    world.dc_link.bleeder_ohm = bleeder_ohm;
    world.dc_link.idle_w = idle_w;
    world.dc_link.start_v = battery_v(world);
    Truck truck(world);
    const double step_s = bleeder_ohm > 5e4 && idle_w == 0 ? 0.1 : 0.001;
    while (truck.voltages().dc_link_v() > battery_v(world) - 3) truck.advance(step_s);
    std::printf("| %g | %g | %.2f |\n", bleeder_ohm / 1e3, idle_w, truck.time_s());
  }
}

void print_precharge() {
  std::puts(
      "\n| cells | bleeder [kohm] | DC/DC idle [W] | share of V(B+) after 1.5 s | 2.5 s | 5 s | 20 s "
      "|\n|---|---|---|---|---|---|---|");
  struct Case {
    double soc, bleeder_ohm, idle_w;
  };
  const double infinite = std::numeric_limits<double>::infinity();
  for (const Case& c : std::vector<Case>{{0.5, infinite, 0},
                                         {0.5, 1e5, 0},
                                         {0.5, 1e4, 0},
                                         {0.5, 1e3, 0},
                                         {0.5, infinite, 1},
                                         {0.5, infinite, 2.5},
                                         {0.5, infinite, 5},
                                         {0.5, 1e3, 5},
                                         {0.02, infinite, 5}}) {
    TruckParameters world = typical_world();
    for (StringCell& cell : world.cells) cell.soc = c.soc;
    world.dc_link.bleeder_ohm = c.bleeder_ohm;
    world.dc_link.idle_w = c.idle_w;
    std::printf("| %.1f V | %g | %g |", battery_v(world), c.bleeder_ohm / 1e3, c.idle_w);
    for (const double time_s : {1.5, 2.5, 5.0, 20.0}) {
      const Situation after = precharged(world, 0, time_s);
      std::printf(" %.1f %% |", 100 * after.v.dc_link_v() / after.v.b_plus_v);
    }
    std::puts("");
  }
  Range time_constant_s, at_1500ms, at_2500ms, final_share;
  for (int seed = 1; seed <= worlds; ++seed) {
    const TruckParameters world = random_world(static_cast<std::uint64_t>(seed));
    time_constant_s.add(world.precharge.ohm * world.dc_link.capacitance_f);
    const auto share = [&](double time_s) {
      const Situation after = precharged(world, 0, time_s);
      return 100 * after.v.dc_link_v() / after.v.b_plus_v;
    };
    at_1500ms.add(share(1.5));
    at_2500ms.add(share(2.5));
    final_share.add(share(8));
  }
  std::printf(
      "\n%d random worlds: RC %.2f to %.2f s; share after 1.5 s %.1f to %.1f %%, after 2.5 s %.1f to %.1f %%, after 8 "
      "s %.1f to %.1f %%.\n",
      worlds, time_constant_s.least, time_constant_s.most, at_1500ms.least, at_1500ms.most, at_2500ms.least,
      at_2500ms.most, final_share.least, final_share.most);
}

void print_inrush() {
  std::puts(
      "\n| DC link before K1 closes | voltage across K1 [V] | peak current, ESR 5 / 10 / 20 mohm [A] |\n|---|---|---|");
  for (const double share : {0.0, 0.5, 0.8, 0.9, 0.95, 0.98}) {
    double peak_a[3] = {}, across_v = 0;
    const double esr_ohm[3] = {0.005, 0.010, 0.020};
    for (int k = 0; k < 3; ++k) {
      TruckParameters world = typical_world();
      world.dc_link.esr_ohm = esr_ohm[k];
      world.dc_link.start_v = share * battery_v(world);
      Truck truck(world);
      weld(truck, {Relay::main_minus});
      truck.advance(0.02);
      weld(truck, {Relay::main_plus});
      truck.advance(0.01);
      across_v = truck.events().back().across_v;
      peak_a[k] = truck.events().back().peak_a;
    }
    std::printf("| %.0f %% | %.1f | %.0f / %.0f / %.0f |\n", 100 * share, across_v, peak_a[0], peak_a[1], peak_a[2]);
  }
}

void print_dip() {
  std::puts(
      "\n| depth of a VDDA dip of 5 ms [V] | L- shown, K2 closed, after 0.1 / 1 / 4 ms [V] | error of L+ minus L- [V] "
      "|\n|---|---|---|");
  for (const double depth_v : {0.1, 0.2, 0.3}) {
    Truck truck(typical_world());
    weld(truck, {Relay::main_minus, Relay::main_plus});
    truck.advance(0.1);
    truck.add_vdda_dip({truck.time_s(), 0.005, depth_v});
    double at_v[3] = {}, difference_v = 0;
    const double step_s[3] = {0.0001, 0.0009, 0.003};
    for (int k = 0; k < 3; ++k) {
      truck.advance(step_s[k]);
      const Situation now = situation(truck);
      at_v[k] = now.minus_v;
      difference_v = std::max(difference_v, std::abs(now.plus_v - now.minus_v - now.v.dc_link_v()));
    }
    std::printf("| %.1f | %.2f / %.2f / %.2f | %.2f |\n", depth_v, at_v[0], at_v[1], at_v[2], difference_v);
  }
}

}  // namespace

int main() {
  print_statements(0.01);
  print_statements(0.001);
  print_blind_spots();
  print_precharge();
  print_inrush();
  print_dip();
}
