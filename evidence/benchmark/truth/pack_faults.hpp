// The faults of simulated packs: what may be planted, and how large.
#pragma once

#include <cstddef>
#include <string_view>
#include <vector>

#include "benchmark/truth/packs.hpp"
#include "benchmark/truth/random_functions.hpp"

namespace bms::benchmark::truth {

struct PackSetting {
  std::size_t cells = 8, sensors = 2;
  double capacity_ah = 6, r0_ohm = 0.01, step_s = 1;
  bool voltmeter = false;
  bool long_recording = false;  ///< days: self-discharge is visible
};

/// One to three faults, mostly of different cells. only: one fault with this id; throws if this pack cannot have it.
std::vector<PackFault> draw_pack_faults(const PackSetting& setting, std::string_view only, plant::Random& random);

/// Whether this cell has this fault, and its size; 0 if not.
double size_of(const std::vector<PackFault>& faults, const char* id, std::size_t cell);
/// Of the whole pack.
double size_of(const std::vector<PackFault>& faults, const char* id);

}  // namespace bms::benchmark::truth
