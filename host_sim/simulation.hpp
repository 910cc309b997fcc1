// Open loop: what voltage the model says for a current, with nothing measured fed back.
#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "model/one_rc.hpp"

namespace bms {

/// A cell for the host: any number of intervals that a file may have.
template <class S>
using HostCell = model::Cell<S, model::max_intervals>;

struct SimulatedRow {
  double voltage_v;
  double soc;
};

/// Integrates the model over rows of (time_s, mean current_a since the row before) from a cell at rest at initial_soc.
/// A missing current (NaN) is taken as the last one known, as the estimator does, and soc stops at -1/4 and 5/4 as its does.
/// Row 0 has no interval before it: its voltage is the rested one plus R0 I. Rows whose time is not later repeat the state.
inline std::vector<SimulatedRow> simulate(const HostCell<double>& cell, double capacity_ah, std::span<const double> time_s,
                                          std::span<const double> current_a, double initial_soc) {
  using Model = model::OneRc<double>;
  std::vector<SimulatedRow> rows(time_s.size());
  Model::Polarisation x{};
  double soc = initial_soc, known_a = 0;
  std::uint8_t interval = 0;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const double duration_s = k == 0 ? 0 : time_s[k] - time_s[k - 1];
    if (current_a[k] == current_a[k]) known_a = current_a[k];
    const model::Drive<double> drive{known_a, duration_s};
    soc = std::clamp(soc + drive.current_a * duration_s / (3'600 * capacity_ah), -0.25, 1.25);
    const auto at = model::look_up(cell, soc, interval);
    if (duration_s > 0) x = Model::advance(x, at, Model::settling(at, duration_s), drive);
    rows[k] = {Model::voltage(x, at, drive), soc};
  }
  return rows;
}

}  // namespace bms
