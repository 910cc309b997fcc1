// Numbers of the comparison with healthy recordings, and of the tolerance that they give a cell file.
#pragma once

#include <array>

namespace bms::diagnosis {

/// Comparison with healthy recordings of the same cell (healthy_null.hpp).
struct HealthyThresholds {
  double log_spread = 0.5;          ///< standard deviation, in ln, of the gain on healthy blocks: that of the
                                    ///< square of an effect that differs by a quarter. A few blocks may agree by
                                    ///< chance
  double block_h = 0.5;             ///< [h] expected of a block, without any block
  double spread_counts = 2;         ///< as if so many more blocks had shown log_spread. With 2 or 3 the spreads of 46
                                    ///< sets of NASA blocks (0.38 pooled) are most probable; with 2 false alarms keep
                                    ///< their rate up to a spread of 1.5
  double log_spread_beyond = 2.1;   ///< log_spread where no healthy block was. In the second halves of eight A123
                                    ///< drives the largest gain is off by 2.3 (RMS), 1.0 of it within the blocks
  double soc_beyond = 0.05;         ///< soc beyond that of the healthy blocks which they still stand for
  double temperature_beyond_k = 5;  ///< [K]
  double current_beyond = 1.25;     ///< times their largest current
  double covered_at_least = 0.5;    ///< share of a recording's rows and squared current where healthy ones were
  double error_times = 1.5;         ///< of the RMS error of healthy recordings: a few know it to a third
  double error_at_least_v = 5e-4;   ///< [V]
  double learned_within = 0.95;     ///< share of a recording's rows where healthy ones were, from which their error
                                    ///< takes the place of the cell file's tolerance
  double as_expected = 1;           ///< in what healthy recordings show of a cell file's tolerance, so many more of
                                    ///< them were as the file expects
  double tolerance_counts = 2;      ///< healthy recordings that the shape of the tolerance counts as, in the band of
                                    ///< a prediction; with two, a single one gives a Student distribution with three
                                    ///< degrees of freedom, the least whole number of finite variance
  double tolerance_beyond = 1.5;    ///< factor on the tolerance in that band where no healthy recording was. With
                                    ///< the lowest 30 % of the charge unseen, 96 % of the readings of 46 discharges
                                    ///< of NASA cells lie within the band there, 91 % with a factor of 1
  double gross_times = 2;           ///< RMS error over the largest of a healthy block, above which it is gross
};

/// Tolerances of an extended cell file are widened by one of these factors (model_tolerance.hpp).
struct ModelToleranceThresholds {
  std::array<double, 7> factors = {1, 1.5, 2, 3, 4, 6, 8};
};

}  // namespace bms::diagnosis
