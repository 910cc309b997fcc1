// Whether a cause stands out from what healthy recordings of the cell show as well
// (inference/healthy_data/healthy_data.hpp). They show causes because every model lacks something: a healthy second
// half of a real drive had six causes in an error of 20 mV.
//
// The gain of each cause is divided by its usual level on the healthy blocks. The largest of these ratios on a
// healthy block, with the levels of the other blocks, is what chance and model error reach on a healthy recording
// whatever the cause. A cause is named if its own ratio is larger than that at the false alarm rate: with enough blocks
// by its rank among them (conformal), otherwise by a Student distribution of the blocks' logarithms.
//
// Where no healthy block was, the model may be off by more. That widens the distribution and forbids nothing: a fault
// may be larger than any model error that is to be expected there.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "healthy_data/healthy_data.hpp"

namespace bms::diagnosis {

/// What healthy data say of one cause.
struct HealthyComparison {
  bool stands_out = false;
  double false_alarm = 1;   ///< probability that a healthy recording shows as much of any cause
  double healthy_gain = 0;  ///< the largest of this cause on a healthy block, for a recording of this duration
  /// With so many hours of healthy recordings like these it would be named; nothing: healthy recordings show as much.
  std::optional<double> hours_needed;
};

/// Healthy recordings [h], each as long as duration_h, that would let a cause of this gain stand out if they
/// showed nothing of it.
double hours_if_none_shows_any(double gain, double duration_h, double rate);

/// Standard deviation, in ln, of a gain where healthy blocks cover this share of the recordings, next to that of the
/// blocks.
double log_spread_beyond(double covered);

/// Factor on the error of a healthy recording that one which healthy blocks cover so far exceeds at the false alarm
/// rate. A gain grows as the square of an error.
double error_factor(double covered, double rate);

class HealthyNull {
 public:
  /// rate: of false alarms, 0 < rate < 1. duration_s: of the recordings to be diagnosed; gain grows with it.
  HealthyNull(const healthy_data::HealthyData& healthy, double rate, double duration_s);

  /// gain: of a cause in the recordings that are diagnosed, >= 0. covered: share of them where healthy blocks were
  /// (HealthyCoverage::share), 0 to 1.
  HealthyComparison compare(const std::string& cause, double gain, double covered = 1) const;
  /// The smallest gain of a cause that would stand out; nothing with too few blocks.
  std::optional<double> gain_needed(const std::string& cause, double covered = 1) const;
  /// Whether a block shows any cause, as in a recording of the duration to be diagnosed.
  bool shows_a_cause() const;
  double hours() const { return hours_; }
  std::size_t blocks() const { return level_of_block_.size(); }

 private:
  /// ln of gain over the usual level of the cause.
  double log_ratio(const std::string& cause, double gain) const;
  double gain_of(std::size_t block, const std::string& cause) const;

  std::vector<healthy_data::HealthyBlock> blocks_;  ///< their gain as in a recording of the duration to be diagnosed
  std::vector<double> level_of_block_;              ///< largest log ratio of any cause, by block
  double rate_, hours_, mean_ = 0, spread_ = 0;
};

}  // namespace bms::diagnosis
