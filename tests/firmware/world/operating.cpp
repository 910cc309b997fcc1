#include "tests/firmware/world/operating.hpp"

#include <array>
#include <limits>

#include <fmt/format.h>

#include "files/cell_file.hpp"
#include "images/chosen_image.hpp"
#include "images/firmware_image.hpp"
#include "tests/cell_of_capacity.hpp"
#include "tests/firmware/world/charges.hpp"

namespace bms::world {

using plant::Relay;

namespace {

files::CellFile scaled(double capacity_ah) {
  files::CellFile cell = files::read_cell("table9");
  cell.parameters = tests::of_capacity(cell.parameters, capacity_ah);
  cell.name = fmt::format("table9_{:.0f}ah", capacity_ah);
  cell.source = fmt::format("table9 with the capacity of {:.0f} Ah", capacity_ah);
  return files::parse_cell(files::cell_text(cell), cell.name);
}

}  // namespace

Pack pack_of(double capacity_ah, std::size_t cells, const std::string& vehicle_profile) {
  const files::CellFile cell = capacity_ah == 6 ? files::read_cell("table9") : scaled(capacity_ah);
  const bool stacked = cells > 16;
  return {capacity_ah, cell.parameters.limits.discharge_current_max_a, cells,
          images::firmware_image(stacked ? "stm32f405_80v" : "stm32f405_forklift", cell, images::Image::application,
                                 vehicle_profile, cells == (stacked ? 24U : 16U) ? 0 : cells)};
}

Pack pack_with_charger_bus(const std::string& vehicle_profile) {
  const files::CellFile cell = scaled(truck_ah);
  return {truck_ah, cell.parameters.limits.discharge_current_max_a, 16,
          images::chosen_image("stm32f405_forklift", cell,
                               {fmt::format("{}-can2-{}", vehicle_profile, own_charger_bit_rate),
                                {"-DBMS_VEHICLE_PROFILE=" + vehicle_profile, "-DBMS_CHARGER_BUS=can2",
                                 fmt::format("-DBMS_CHARGER_BIT_RATE={}", own_charger_bit_rate)}})};
}

Pack pack_with_insulation_monitor(std::size_t cells) {
  const files::CellFile cell = scaled(truck_ah);
  return {truck_ah, cell.parameters.limits.discharge_current_max_a, cells,
          images::chosen_image(cells > 16 ? "stm32f405_80v" : "stm32f405_forklift", cell,
                               {fmt::format("insulation-{}cells", cells),
                                {"-DBMS_INSULATION=pwm", fmt::format("-DBMS_CELLS={}", cells)}})};
}

WorldSetup random_setup(const Pack& pack, std::uint64_t seed) {
  WorldSetup setup;
  setup.seed = static_cast<std::uint32_t>(seed);
  setup.truck = plant::random_world(seed, {.cells = pack.cells, .divider_tolerance = 0.001});
  plant::Random random(seed + 1'000'000);
  const auto between = [&](double least, double most) { return least + random.uniform() * (most - least); };
  const double link_share = setup.truck.dc_link.start_v / plant::CellString(setup.truck.cells).emf_v();
  const double soc = between(0.15, 0.93);
  for (plant::StringCell& cell : setup.truck.cells) {
    cell.capacity_ah = pack.capacity_ah * between(0.97, 1.03);
    cell.soc = soc + between(-0.01, 0.01);
  }
  setup.truck.dc_link.start_v = link_share * plant::CellString(setup.truck.cells).emf_v();
  setup.truck.supply.rail_ohm = 0;
  setup.detector_error_v = between(-0.06, 0.06);
  setup.reset_v = between(2.75, 2.88);
  setup.reset_ends_v = setup.reset_v + 0.09;
  setup.adc_offset_lsb = between(-2, 2);
  setup.cell_noise_v = 0.0005;
  setup.shunt_noise_v = 1e-6;
  return setup;
}

WorldSetup typical_setup(const Pack& pack, std::uint64_t seed) {
  WorldSetup setup;
  setup.seed = static_cast<std::uint32_t>(seed);
  setup.truck = plant::typical_world(pack.cells);
  setup.truck.seed = seed;
  setup.truck.dc_link.bleeder_ohm = 10e3;
  for (plant::StringCell& cell : setup.truck.cells) cell = {.capacity_ah = pack.capacity_ah, .soc = 0.55};
  return setup;
}

const char* name_of(Operating state) {
  constexpr std::array states{"off", "standby", "drive", "recuperation", "charge"};
  return states[static_cast<std::size_t>(state)];
}

void set_drive_a(TruckWorld& world, double current_a) {
  world.truck.set_drive({.power_w = 0, .current_a = -current_a});
}

void set_charger_a(TruckWorld& world, double current_a) {
  const double voltage_v = 3.65 * static_cast<double>(world.truck.cell_count());
  world.truck.set_charger({.on = current_a > 0, .voltage_v = voltage_v, .current_a = current_a});
}

std::string bring_to(TruckWorld& world, const Pack& pack, Operating state) {
  if (state == Operating::off) {
    world.run_ms(5'000);
    return "";
  }
  const bool charge = state == Operating::charge;
  world.vehicle.request = charge ? Request::charge : Request::drive;
  const auto ready = [&] { return world.both_mains_closed() && (!charge || world.closed(Relay::charge)); };
  if (world.run_until(ready, start_limit_ms) < 0)
    return fmt::format("{}: does not close ({})", name_of(state), summary(world));
  world.run_ms(1'500);
  if (charge) set_charger_a(world, 0.5 * pack.limit_a);
  if (state == Operating::drive) set_drive_a(world, -0.5 * pack.limit_a);
  if (state == Operating::recuperate) set_drive_a(world, 0.33 * pack.limit_a);
  world.run_ms(1'500);
  if (!ready()) return fmt::format("{}: does not stay closed ({})", name_of(state), summary(world));
  return "";
}

double key_off(TruckWorld& world, double within_ms, double standby_a) {
  constexpr double drive_stops_ms = 300;
  world.vehicle.request = Request::none;
  const auto opened = [&] { return !world.any_main_closed(); };
  const double ms = world.run_until(opened, drive_stops_ms);
  set_drive_a(world, -standby_a);
  set_charger_a(world, 0);
  if (ms >= 0) return ms;
  const double rest_ms = world.run_until(opened, within_ms);
  return rest_ms < 0 ? rest_ms : drive_stops_ms + rest_ms;
}

std::string summary(const TruckWorld& world) {
  std::string text = fmt::format("faults {}, first cause {}, state {}", fault_names(world.vehicle.faults()),
                                 world.vehicle.first_cause(), world.vehicle.state());
  for (const auto& closing : world.closings_below_v(closing_limit_v)) {
    text += fmt::format(", contact {} closes over {:.1f} V with {:.0f} A at {:.0f} ms", static_cast<int>(closing.relay),
                        closing.across_v, closing.peak_a, closing.at_ms);
  }
  return text;
}

}  // namespace bms::world
