// Figures of a profile: duration, charge, largest current.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "experiments/experiment.hpp"

namespace bms::experiments {

struct ProfileFigures {
  std::size_t samples = 0;
  double duration_s = 0, charged_ah = 0, discharged_ah = 0;
  double largest_current_a = 0;  ///< absolute value
};

/// rows: at least one.
inline ProfileFigures figures_of(const std::vector<ProfileRow>& rows) {
  ProfileFigures figures{.samples = rows.size(), .duration_s = rows.back().time_s - rows.front().time_s};
  double before_s = rows.front().time_s;
  for (const ProfileRow& row : rows) {
    (row.current_a > 0 ? figures.charged_ah : figures.discharged_ah) +=
        std::abs(row.current_a) * (row.time_s - before_s) / 3'600;
    figures.largest_current_a = std::max(figures.largest_current_a, std::abs(row.current_a));
    before_s = row.time_s;
  }
  return figures;
}

}  // namespace bms::experiments
