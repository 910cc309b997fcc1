#include "plant/circuit/truck_parameters.hpp"

#include <cmath>

namespace bms::plant {

namespace {

/// Random numbers by their range.
class Draw {
 public:
  explicit Draw(std::uint64_t seed) : random_(seed) {}
  double between(double least, double most) { return least + random_.uniform() * (most - least); }
  double within(double value, double tolerance) { return value * between(1 - tolerance, 1 + tolerance); }
  /// Every decade is equally probable.
  double decades(double least, double most) { return least * std::pow(most / least, random_.uniform()); }
  bool chance(double probability) { return random_.uniform() < probability; }

 private:
  Random random_;
};

ContactorParameters precharge_relay() {
  ContactorParameters relay;
  relay.closing = {0.005, 0.010};
  relay.opening = {0.003, 0.005};
  relay.bounce = {0.0005, 0.002};  // chosen
  return relay;
}

/// The board of more than 16 cells has a divider of its own.
double divider_ohm(std::size_t cells) { return cells > 16 ? 2e6 : 1e6; }

Divider random_divider(Draw& draw, std::size_t cells, double tolerance) {
  const Divider typical;
  return {.upper_ohm = draw.within(divider_ohm(cells), tolerance),
          .lower_ohm = draw.within(typical.lower_ohm, tolerance),
          .bias_ohm = draw.within(typical.bias_ohm, tolerance),
          .capacitance_f = draw.within(typical.capacitance_f, 0.1)};
}

std::vector<StringCell> random_cells(Draw& draw, std::size_t count) {
  const double capacity_ah = draw.between(100, 400), soc = draw.between(0.05, 0.98);
  std::vector<StringCell> cells;
  for (std::size_t k = 0; k < count; ++k) {
    cells.push_back({.capacity_ah = draw.within(capacity_ah, 0.03),
                     .soc = soc + draw.between(-0.02, 0.02),
                     .resistance_factor = draw.between(0.85, 1.3)});
  }
  return cells;
}

/// Of the voltage of 16 cells, for which the defaults are.
double share_of(std::size_t cells) { return static_cast<double>(cells) / 16; }

}  // namespace

bool FrameLeaks::any() const {
  return std::isfinite(string_ohm) || std::isfinite(plus_ohm) || std::isfinite(minus_ohm);
}

TruckParameters typical_world(std::size_t cells) {
  TruckParameters world;
  world.cells.resize(cells);
  world.dc_link.idle_from_v *= share_of(cells);
  world.dc_link.lockout_v *= share_of(cells);
  world.dc_link.recuperation_limit_v *= share_of(cells);
  world.plus_divider.upper_ohm = world.minus_divider.upper_ohm = divider_ohm(cells);
  world.relay[static_cast<std::size_t>(Relay::precharge)] = precharge_relay();
  return world;
}

TruckParameters random_world(std::uint64_t seed, const WorldLimits& limits) {
  Draw draw(seed);
  TruckParameters world = typical_world(limits.cells);
  world.seed = seed;
  world.cells = random_cells(draw, limits.cells);
  world.shunt_ohm = draw.within(world.shunt_ohm, 0.01);
  const double rated_v = draw.chance(0.5) ? 12 : 24;
  for (ContactorParameters& relay : world.relay) {
    relay.rated_v = rated_v;
    relay.coil_ohm = draw.between(12, 24);
    relay.drop_out_share = draw.between(0.1, 0.6);
    relay.pull_in_share = draw.between(0.65, 0.8);
  }
  world.supply.coil_v = draw.within(rated_v, 0.1);
  world.supply.vdda_v = draw.within(world.supply.vdda_v, 0.02);
  if (draw.chance(0.2)) world.supply.rail_ohm = draw.between(0, 0.2);
  world.precharge.ohm = draw.within(world.precharge.ohm, 0.05);
  world.dc_link.capacitance_f = draw.within(world.dc_link.capacitance_f, 0.2);
  world.dc_link.esr_ohm = draw.between(0.005, 0.020);
  if (draw.chance(0.7)) world.dc_link.bleeder_ohm = draw.decades(1e3, 1e5);
  const double share = share_of(limits.cells);
  // Through the same resistor: the power by the square of a lower voltage. A higher one allows no more, because the
  // contactor and its loop decide how far the DC link may be below the pack.
  world.dc_link.idle_w = draw.chance(0.5) ? std::min(1.0, share * share) * draw.between(0, 5) : 0;
  world.dc_link.idle_from_v = share * draw.between(9, 36);
  world.dc_link.start_v = CellString(world.cells).emf_v() * draw.between(0, 1);
  world.charger.idle_v = draw.chance(0.3) ? share * draw.between(20, 60) : 0;
  world.front_end.ld_ohm = draw.decades(0.5e6, 5e6);
  world.front_end.pack_ohm = draw.decades(0.5e6, 5e6);
  world.plus_divider = random_divider(draw, limits.cells, limits.divider_tolerance);
  world.minus_divider = random_divider(draw, limits.cells, limits.divider_tolerance);
  for (HallParameters& hall : world.hall) {
    hall = {.gain = draw.within(1, 0.01), .supply_v = draw.within(5, 0.02), .offset_v = draw.between(-0.01, 0.01)};
  }
  return world;
}

}  // namespace bms::plant
