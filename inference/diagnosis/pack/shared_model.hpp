// The unknowns of what all cells share (shared_current.hpp), and the model's voltage and its derivatives for them.
#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "diagnosis/noise.hpp"
#include "diagnosis/pack/pack_recording.hpp"
#include "diagnosis/pack/pack_thresholds.hpp"
#include "diagnosis/pack/shared_blocks.hpp"
#include "diagnosis/pack/track.hpp"

namespace bms::diagnosis::pack::shared {

enum Unknown : Eigen::Index {
  start,
  sensor_offset,
  charge_wave_1,
  sensor_gain = charge_wave_1 + PackThresholds::Shared::charge_waves,
  all_capacity,
  all_resistance,
  all_polarisation,
  warmth,
  level,
  lead,
  wave_1,
  resistance_wave_1 = wave_1 + PackThresholds::Shared::ocv_waves,
  unknowns = resistance_wave_1 + PackThresholds::Shared::resistance_waves
};
using Unknowns = Eigen::Matrix<double, unknowns, 1>;

struct Problem {
  const Track& track;
  const PackRecording& pack;
  std::vector<double> charge;  ///< by row: that the sensor has counted, over the capacity
  Blocks blocks;
  Unknowns healthy = Unknowns::Zero();

  double hours() const { return limits.hours_per_day * track.days.back(); }
};

/// A random walk from 0 to 1 is the sum of sin((k + 1/2) pi t) with independent amplitudes (Karhunen and Loeve).
double charge_wave(Eigen::Index k, double share);

/// Variance of what the walk has beyond the waves [SOC^2]: the sum of the squares of their other amplitudes, halved.
double beyond_waves(const Problem& p);

/// Standard deviations with a healthy sensor. ocv_factor: error of the file's OCV over its tolerance.
Unknowns healthy_of(const Problem& p, double ocv_factor);

/// State of charge and RC voltage by row for these unknowns.
struct Course {
  std::vector<double> soc, v_rc_v;
};

Course course_of(const Problem& p, const Unknowns& u);

/// Sets the columns of one block, and last what u does not explain. columns: unknowns and one more.
void set_row(const Problem& p, const Unknowns& u, std::size_t block, double soc, double v_rc_v, Columns& columns);

}  // namespace bms::diagnosis::pack::shared
