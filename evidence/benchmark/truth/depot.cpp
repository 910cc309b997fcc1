#include "benchmark/truth/depot.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "benchmark/truth/calibration.hpp"
#include "benchmark/truth/effects/contact_intermittent.hpp"
#include "benchmark/truth/healthy_cells.hpp"
#include "benchmark/truth/profiles.hpp"

namespace bms::benchmark::truth {

namespace {

constexpr double full_soc = 0.955;     // where the charger ends; within what a calibration knows
constexpr double least_slope_v = 0.6;  // of the OCV there [V per 1]: the voltage of a full cell shows its charge

/// A seed of its own for each cell and day.
std::uint64_t seed_of(std::uint64_t truck, std::size_t cell, std::size_t day) {
  return derived_seed(derived_seed(truck, 1'000 + cell), day);
}

}  // namespace

Depot::Depot(const DepotSize& size, std::uint64_t seed) : size_(size) {
  if (size.trucks < 5 || size.cells < 1 || size.days < 1) throw std::invalid_argument("a depot has 5 trucks or more");
  plant::Random random(derived_seed(seed, 0xDE907));
  for (std::size_t t = 0; t < size.trucks; ++t) {
    Truck truck;
    do {
      truck.cell = draw_healthy_cell(random);
    } while (truck.cell.ocv_v.slope_at(full_soc) < least_slope_v);
    truck.lab = draw_laboratory(truck.cell.capacity_ah, false, random);
    truck.lab.step_s = size.step_s;
    truck.lab.measures_temperature = true;
    truck.file = calibrate(truck.cell, truck.lab.calibration_share, random);
    truck.resistance_per_day = log_between(random, 0.00005, 0.0005);
    truck.capacity_per_day = truck.resistance_per_day / 3;
    truck.seed = random.bits();
    trucks_.push_back(std::move(truck));
  }
  std::vector<std::size_t> order(size.trucks);
  for (std::size_t k = 0; k < order.size(); ++k) order[k] = k;
  for (std::size_t k = order.size() - 1; k > 0; --k) std::swap(order[k], order[below(random, k + 1)]);
  const auto any_cell = [&] { return below(random, size.cells); };
  const double r0_ohm = trucks_[order[0]].cell.r0_ohm.at(0.5), one_c_a = trucks_[order[1]].cell.capacity_ah;
  faults_.push_back({order[0], any_cell(), false, "contact_intermittent", 12, r0_ohm * between(random, 0.5, 0.9)});
  faults_.push_back({order[1], 0, true, "current_offset", 4 + below(random, 5),
                     sign(random) * one_c_a * between(random, 0.0015, 0.0025)});
  faults_.push_back({order[2], any_cell(), false, "capacity_change", 0, between(random, 0.12, 0.16)});
  faults_.push_back({order[3], any_cell(), false, "leakage", 4 + below(random, 5), between(random, 0.005, 0.009)});
}

const PlantedFault* Depot::fault(std::size_t truck, std::size_t cell, const char* cause) const {
  for (const PlantedFault& f : faults_) {
    if (f.truck == truck && (f.whole_truck || f.cell == cell) && f.cause == cause) return &f;
  }
  return nullptr;
}

World Depot::world(std::size_t t, std::size_t cell, std::size_t day) const {
  const Truck& truck = trucks_[t];
  const auto since = [&](const PlantedFault* f) {
    return f == nullptr || day < f->onset_day ? 0 : static_cast<double>(day - f->onset_day + 1);
  };
  plant::Random shift(seed_of(truck.seed, 0, day)), of_cell(seed_of(truck.seed, cell + 1, 1'000'000));
  World world;
  world.stimulus.step_s = size_.step_s;
  world.start_soc = full_soc + 0.002 * (2 * shift.uniform() - 1);
  const double one_c_v = truck.cell.capacity_ah * (truck.cell.r0_ohm.at(0.5) + truck.cell.r1_ohm.at(0.5));
  world.stimulus.current_a = draw_current_a({.profile = Profile::forklift_shift,
                                             .step_s = size_.step_s,
                                             .capacity_ah = truck.cell.capacity_ah,
                                             .start_soc = world.start_soc,
                                             .lowest_soc = 0.15,
                                             .highest_soc = full_soc,
                                             .duration_s = 3'600 * size_.hours,
                                             .fastest_charge = std::min(2.0, 0.27 / one_c_v),
                                             .fastest_discharge = std::min(5.5, 0.75 / one_c_v)},
                                            shift);
  const std::size_t samples = world.stimulus.current_a.size();
  world.stimulus.ambient_c.assign(samples, between(shift, 18, 28));
  const double age = static_cast<double>(day);
  world.cell.capacity_factor = (1 + 0.003 * of_cell.normal()) * (1 - truck.capacity_per_day * age);
  world.cell.growth.of_r0 = (1 + 0.01 * of_cell.normal()) * (1 + truck.resistance_per_day * age) - 1;
  world.start_soc += 0.001 * of_cell.normal();
  if (const PlantedFault* weak = fault(t, cell, "capacity_change"); since(weak) > 0) {
    world.cell.capacity_factor *= 1 - weak->size;
    world.cell.growth.of_r0 = (1 + world.cell.growth.of_r0) * (1.25 + 0.1 * of_cell.uniform()) - 1;
  }
  if (const PlantedFault* leak = fault(t, cell, "leakage")) {
    world.start_soc -= leak->size * since(leak);
    if (since(leak) > 0) world.cell.leak.at_3v3_a = leak->size * truck.cell.capacity_ah / 24;
  }
  if (const PlantedFault* loose = fault(t, cell, "contact_intermittent"); since(loose) > 0) {
    world.cell.contact_scale = loose->size;
    world.cell.contact_ohm = effects::contact_bursts({.seed = seed_of(truck.seed, cell + 1, 2'000'000 + day),
                                                      .count = samples,
                                                      .step_s = size_.step_s,
                                                      .between_s = 300,
                                                      .dwell_s = 12});
  }
  if (const PlantedFault* sensor = fault(t, cell, "current_offset")) {
    world.faults.current.offset_scale = sensor->size * since(sensor);
    world.faults.current.offset_a.assign(samples, 1.0);
  }
  return world;
}

Series Depot::recording(std::size_t t, std::size_t cell, std::size_t day) const {
  const Truck& truck = trucks_[t];
  const MeasuredSeries measured = observe(truck.cell, world(t, cell, day));
  // one sensor for the current of all cells
  const plant::Instruments shared(truck.lab.instruments, seed_of(truck.seed, 0, 3'000'000 + day)),
      own(truck.lab.instruments, seed_of(truck.seed, cell + 1, 3'000'000 + day));
  Series series;
  series.current_a = read_by(shared.current_a, size_.step_s, measured.current_a);
  series.voltage_v = read_by(own.voltage_v, size_.step_s, measured.voltage_v);
  series.temperature_c = read_by(own.temperature_c, size_.step_s, measured.temperature_c);
  series.soc = measured.trace.soc;
  for (std::size_t k = 0; k < series.soc.size(); ++k) series.time_s.push_back(static_cast<double>(k) * size_.step_s);
  return series;
}

}  // namespace bms::benchmark::truth
