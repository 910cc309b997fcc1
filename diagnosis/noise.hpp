// What a healthy cell's residual looks like, on more than one time scale, and the filter that makes it white.
//
//   residual = white + fast + slow        white: new in every sample; fast, slow: Ornstein-Uhlenbeck, each with its own
//   memory
//
// A step of the current brings a new error with it (a resistance that is good to some per cent): the fast part is
// widened there. Where the OCV is steep the slow part is: what is known of soc to some tenths of a per cent is not
// known of the voltage to a millivolt.
//
// The white part alone would take every slow drift for physics; residuals of a drift are white from sample to sample
// and still wrong for hours. The filter is the Kalman filter of the two slow parts: what it does not foresee, over how
// well it can know, is white with variance 1. O(n), any sampling. (Astrom, Introduction to Stochastic Control Theory,
// 1970, ch. 7.)
#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

namespace bms::diagnosis {

struct NoiseModel {
  double white_v = 0.001;
  double fast_v = 0.0015, fast_s = 60;
  double slow_v = 0.001, slow_s = 3'600;
  double edge = 1;  ///< times what a step of the current is reckoned to bring
  bool operator==(const NoiseModel&) const = default;
};

/// What comes on top of it row by row, variances.
struct RowNoise {
  std::vector<double> white_v2;  ///< added to the white part
  std::vector<double> edge_v2;   ///< what the fast part gains at a step of the current, before NoiseModel::edge
  std::vector<double> slow_v2;   ///< added to the slow part, if there is one: where the OCV is steep, a small error of
                                 ///< soc is a large one of the voltage

  explicit RowNoise(std::size_t rows = 0) : white_v2(rows, 0.0), edge_v2(rows, 0.0), slow_v2(rows, 0.0) {}
};

/// What it costs a hypothesis, in -2 log likelihood, that its residual is larger than the nominal noise: 0 where it is
/// not. A factor of 2 costs 21, of 4 85, of 10 240: small against a gross mismatch, large against chance.
double price_of_noise(const NoiseModel& noise, const NoiseModel& nominal);

/// Columns in, white columns out. Rows without a voltage give 0.
using Columns = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

class Whitener {
 public:
  /// As many rows as time_s has.
  Whitener(const NoiseModel& noise, std::span<const double> time_s, const RowNoise& rows, std::span<const char> usable);

  /// In place, rows first .. first + size of columns.
  void whiten(Eigen::Ref<Columns> columns) const;
  /// The same for one column that is 0 before row first.
  void whiten(std::size_t first, std::span<double> values) const;
  /// Sum of the logarithms of the variances: the part of -2 log likelihood that does not depend on the residual.
  double log_determinant() const { return log_determinant_; }
  /// Rows that count.
  std::size_t used() const { return used_; }

 private:
  struct Gain {
    double fast, slow;            ///< of the filter
    double fast_left, slow_left;  ///< what remains of each until the next row
    double slow_size;             ///< the slow part in units of its deviation far from any slope
    double weight;                ///< 1 / standard deviation of what is not foreseen; 0: row not used
  };
  std::vector<Gain> gains_;
  double log_determinant_ = 0;
  std::size_t used_ = 0;
};

/// White noise of a voltage channel: from second differences where the current is quiet, at least a quantisation
/// step's. quiet_a: how far the current may move. Returns fallback_v when there are too few such rows.
double white_noise(std::span<const double> voltage_v, std::span<const double> current_a, double quiet_a,
                   double fallback_v);

/// Smallest step between two different readings that occurs often, where readings lie on a grid of it; 0: none found.
double quantisation_step(std::span<const double> values);

}  // namespace bms::diagnosis
