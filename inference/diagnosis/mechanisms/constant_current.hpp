// What current_offset and leakage have in common: a constant current that the charge count does not contain.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "diagnosis/mechanism.hpp"
#include "diagnosis/numerics.hpp"
#include "diagnosis/recording_facts.hpp"
#include "model/mechanism.hpp"

namespace bms::diagnosis::constant_current {

/// [s] shorter recordings do not show a slow effect.
inline constexpr double shortest_s = 600;

/// Charge over the whole recordings that far starts move, in soc: in a real recording an offset that moved 13 % of soc
/// gained nothing from the signature's estimate and 213 from there.
inline constexpr std::array moved_soc = {-0.4, -0.2, -0.12, -0.06, -0.03, 0.03, 0.06, 0.12, 0.2, 0.4};

inline std::optional<std::string> too_short(const TestConditions& c) {
  if (c.facts.duration_s < shortest_s) return "the recording is too short";
  return std::nullopt;
}

inline std::vector<std::vector<double>> far_starts(const model::Parameter& current, const RecordingFacts& facts) {
  const double per_soc_a = facts.capacity_ah / std::max(facts.duration_h, numerics.search.shortest_hours),
               most_a = current.upper(facts.capacity_ah);
  std::vector<std::vector<double>> starts;
  for (const double soc : moved_soc) {
    if (std::abs(soc) * per_soc_a < most_a && (soc > 0 || current.low < 0)) starts.push_back({soc * per_soc_a});
  }
  return starts;
}

}  // namespace bms::diagnosis::constant_current
