#include "benchmark/truth/pack_faults.hpp"

#include <algorithm>
#include <stdexcept>

namespace bms::benchmark::truth {

namespace {

double signed_between(plant::Random& random, double low, double high) {
  const double size = between(random, low, high);
  return sign(random) * size;
}

PackFault of_cell(const char* id, std::size_t cell, double size, bool of_data = false) {
  return {.id = id, .cell = cell, .size = size, .of_data = of_data};
}

/// Physics of a cell, of its connection, of its channel, or what the pack has only once.
PackFault draw_fault(const PackSetting& s, plant::Random& random) {
  const std::size_t cell = below(random, s.cells);
  std::vector<const char*> ids = {"charge_imbalance", "capacity_change", "resistance_growth", "joint_resistance",
                                  "voltage_offset",   "voltage_gain",    "sense_wire",        "channel_skew",
                                  "channel_held",     "current_offset"};
  if (s.long_recording) ids.insert(ids.end(), {"leakage", "leakage", "leakage"});
  if (s.sensors >= 3) ids.push_back("temperature_sensor");
  if (s.voltmeter) ids.push_back("pack_voltage");
  const std::string_view id = one_of(random, ids);
  if (id == "charge_imbalance") return of_cell("charge_imbalance", cell, -between(random, 0.04, 0.09));
  if (id == "capacity_change") return of_cell("capacity_change", cell, between(random, 0.07, 0.20));
  if (id == "leakage") return of_cell("leakage", cell, between(random, 0.01, 0.04));
  if (id == "resistance_growth") return of_cell("resistance_growth", cell, between(random, 0.25, 0.8));
  if (id == "joint_resistance") return of_cell("joint_resistance", cell, s.r0_ohm * between(random, 0.3, 1.2));
  if (id == "voltage_offset") return of_cell("voltage_offset", cell, signed_between(random, 0.007, 0.025));
  if (id == "voltage_gain") return of_cell("voltage_gain", cell, signed_between(random, 0.003, 0.010));
  if (id == "channel_skew") return of_cell("channel_skew", cell, s.step_s * between(random, 1.2, 6), true);
  if (id == "channel_held")
    return of_cell("channel_held", cell, s.step_s * (3 + static_cast<double>(below(random, 18))), true);
  if (id == "sense_wire")
    return of_cell("sense_wire", below(random, s.cells - 1), signed_between(random, 0.007, 0.025));
  if (id == "temperature_sensor")
    return of_cell("temperature_sensor", below(random, s.sensors), signed_between(random, 7, 20));
  if (id == "pack_voltage") return {.id = "pack_voltage", .cell = {}, .size = signed_between(random, 0.02, 0.05)};
  return {.id = "current_offset", .cell = {}, .size = s.capacity_ah * signed_between(random, 0.01, 0.03)};
}

/// Cells that a fault shows in its voltages.
bool shares_a_cell(const PackFault& a, const PackFault& b) {
  if (!a.cell || !b.cell || a.id == "temperature_sensor" || b.id == "temperature_sensor") return false;
  const auto reach = [](const PackFault& f) { return f.id == "sense_wire" ? 1U : 0U; };
  return *a.cell <= *b.cell + reach(b) && *b.cell <= *a.cell + reach(a);
}

/// A capacity and a resistance age together; other pairs in one cell would hide each other.
bool may_share(const PackFault& a, const PackFault& b) {
  const auto ages = [](const PackFault& f) { return f.id == "capacity_change" || f.id == "resistance_growth"; };
  return a.id != b.id && ages(a) && ages(b);
}

}  // namespace

std::vector<PackFault> draw_pack_faults(const PackSetting& setting, std::string_view only, plant::Random& random) {
  constexpr int most_draws = 10'000;
  for (int n = 0; !only.empty() && n < most_draws; ++n) {
    if (const PackFault fault = draw_fault(setting, random); fault.id == only) return {fault};
  }
  if (!only.empty()) throw std::invalid_argument("this pack cannot have the fault " + std::string(only));
  std::vector<PackFault> faults;
  const std::size_t count = 1 + below(random, 3);
  while (faults.size() < count) {
    const PackFault fault = draw_fault(setting, random);
    const bool refused = std::any_of(faults.begin(), faults.end(), [&](const PackFault& f) {
      if (!f.cell && f.id == fault.id) return true;
      return shares_a_cell(f, fault) && !may_share(f, fault);
    });
    if (!refused) faults.push_back(fault);
  }
  return faults;
}

double size_of(const std::vector<PackFault>& faults, const char* id, std::size_t cell) {
  for (const PackFault& f : faults) {
    if (f.id == id && f.cell == cell) return f.size;
  }
  return 0;
}

double size_of(const std::vector<PackFault>& faults, const char* id) {
  for (const PackFault& f : faults) {
    if (f.id == id && !f.cell) return f.size;
  }
  return 0;
}

}  // namespace bms::benchmark::truth
