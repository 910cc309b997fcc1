// Resistances of a cell with a fit's mechanisms, averaged over the steps of the recorded current, with their
// derivatives by everything that is uncertain.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "diagnosis/likelihood_model.hpp"
#include "diagnosis/mechanism.hpp"

namespace bms::diagnosis {

/// A resistance and its derivatives.
struct Quantity {
  double ohm = 0;
  Eigen::VectorXd by_base;   ///< by the base parameters, then by own_parameters(), each in its standard deviation
  Eigen::VectorXd by_found;  ///< by the estimated parameters

  friend Quantity operator-(const Quantity& a, const Quantity& b) {
    return {a.ohm - b.ohm, a.by_base - b.by_base, a.by_found - b.by_found};
  }
};

/// Of the cell at one temperature.
struct Resistances {
  Quantity r0, r1, step;
  std::vector<Quantity> own;  ///< by setting
};

/// A row in which the current has changed.
struct SteppedRow {
  std::size_t record = 0;
  double time_s = 0, soc = 0;
  double current_a = 0;  ///< the larger one of before and after
  double weight = 0;     ///< squared step, of all together 1
};

/// What the means are over.
struct Load {
  std::vector<SteppedRow> rows;
  double temperature_c = 0;  ///< weighted by the squared current
  double step_s = 0;         ///< [s] median time between rows
};

/// Nothing if the current never changes or no temperature was recorded.
std::optional<Load> load_of(const LikelihoodModel& likelihood, const HypothesisFit& fit);

/// Means over the load, weighted by the squared steps. reference: at the temperature of the cell file, else at the
/// load's. without: a mechanism that does not act.
Resistances mean_resistances(const LikelihoodModel& likelihood, const HypothesisFit& fit, const Load& load,
                             bool reference, std::size_t without = no_mechanism);

/// Returns true if a mechanism makes them depend on the temperature.
bool resistances_follow_temperature(const LikelihoodModel& likelihood, const HypothesisFit& fit);

}  // namespace bms::diagnosis
