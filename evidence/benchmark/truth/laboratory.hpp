// What all recordings of a case share: how well the cell was calibrated, and its instruments.
#pragma once

#include "benchmark/truth/cases.hpp"
#include "benchmark/truth/scaled_effect.hpp"
#include "plant/instruments.hpp"

namespace bms::benchmark::truth {

struct Laboratory {
  double calibration_share = 0.6;  ///< calibration errors as a share of the tolerances
  plant::InstrumentParameters instruments;
  double step_s = 1;  ///< sampling step
  bool measures_temperature = true;
};

/// demanding: calibration and drift are near their tolerances.
Laboratory draw_laboratory(double one_c_a, bool demanding, plant::Random& random);

/// Standard deviation [V] of the white noise of the voltage, with that of the current through R0.
double white_v(const Laboratory& lab, const HealthyCell& cell);

/// The series as the instruments of the laboratory record it.
Series record(const World& world, const MeasuredSeries& measured, const Laboratory& lab, std::uint64_t seed);

}  // namespace bms::benchmark::truth
