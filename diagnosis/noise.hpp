// What a healthy cell's residual looks like, on more than one time scale, and the filter that makes it white.
//
//   residual = white + fast + slow        white: new in every sample; fast, slow: Ornstein-Uhlenbeck, each with its own memory
//
// A step of the current brings a new error with it (a resistance that is good to some per cent): the fast part is widened there.
//
// The white part alone would take every slow drift for physics; residuals of a drift are white from sample to sample and still
// wrong for hours. The filter is the Kalman filter of the two slow parts: what it does not foresee, over how well it can know,
// is white with variance 1. O(n), any sampling. (Astrom, Introduction to Stochastic Control Theory, 1970, ch. 7.)
#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

namespace bms::diagnosis {

struct NoiseModel {
  double white_v = 0.001;
  double fast_v = 0.0015, fast_s = 60;
  double slow_v = 0.001, slow_s = 3'600;
  double edge = 1;                   ///< times what a step of the current is reckoned to bring
  bool operator==(const NoiseModel&) const = default;
};

/// What it costs a hypothesis, in -2 log likelihood, that its residual is larger than the nominal noise: 0 where it is not. A factor
/// of 2 costs 21, of 4 85, of 10 240: small against a gross mismatch, large against chance.
double price_of_noise(const NoiseModel& noise, const NoiseModel& nominal);

/// Columns in, white columns out. Rows without a voltage give 0.
using Columns = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

class Whitener {
 public:
  /// Row by row: white variance to add, variance that the fast part gains; usable[k] == 0: no voltage in row k.
  Whitener(const NoiseModel& noise, std::span<const double> time_s, std::span<const double> more_white_v2, std::span<const double> more_fast_v2, std::span<const char> usable);

  /// In place, rows first .. first + size of columns.
  void whiten(Eigen::Ref<Columns> columns) const;
  /// Sum of the logarithms of the variances: the part of -2 log likelihood that does not depend on the residual.
  double log_determinant() const { return log_determinant_; }
  /// Rows that count.
  std::size_t used() const { return used_; }

 private:
  struct Gain {
    double fast, slow;           ///< of the filter
    double fast_left, slow_left; ///< what remains of each until the next row
    double weight;               ///< 1 / standard deviation of what is not foreseen; 0: row not used
  };
  std::vector<Gain> gains_;
  double log_determinant_ = 0;
  std::size_t used_ = 0;
};

/// White noise of a voltage channel: from second differences where the current is quiet, at least a quantisation step's.
/// quiet_a: how far the current may move. Returns fallback_v when there are too few such rows.
double white_noise(std::span<const double> voltage_v, std::span<const double> current_a, double quiet_a, double fallback_v);

/// Smallest step between two different readings that occurs often; 0: none found.
double quantisation_step(std::span<const double> values);

}  // namespace bms::diagnosis
