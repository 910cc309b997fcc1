// An effect scaled to a wanted strength, and the voltage difference that it makes.
#pragma once

#include <vector>

#include "benchmark/truth/detection_scale.hpp"
#include "benchmark/truth/effects.hpp"

namespace bms::benchmark::truth {

/// Readings of instruments without noise, and the truth behind them.
struct MeasuredSeries {
  std::vector<double> current_a, voltage_v, temperature_c;
  CellTrace trace;
};

/// source_v: voltage of a source that is connected instead of the cell, NaN where the cell is connected; empty: always
/// the cell.
MeasuredSeries observe(const HealthyCell& cell, const World& world, const std::vector<double>& source_v = {});

struct ScaledEffect {
  Effect effect;
  double amplitude = 0;
  double strength = 0;  ///< in detection limits
};

World with_effects(World world, const std::vector<ScaledEffect>& effects);

/// Voltages after a sticking converter, if the world has one.
std::vector<double> converted_v(const World& world, std::vector<double> voltage_v);

/// Measured voltage [V] with the `unknown` effects minus the voltage without them, in a world that has the `known`
/// effects, for the same measured current and temperature.
std::vector<double> difference_v(const HealthyCell& cell, const World& healthy, const std::vector<ScaledEffect>& known,
                                 const std::vector<ScaledEffect>& unknown);

/// Scales the effect until it has the wanted strength (to 4 %) or reaches the end of its physical range.
ScaledEffect scale(const HealthyCell& cell, const World& healthy, const std::vector<ScaledEffect>& known, Effect effect,
                   const DetectionScale& detection_scale, double wanted);

}  // namespace bms::benchmark::truth
