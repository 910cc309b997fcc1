// What the residual of a healthy cell looks like, on three time scales, and the filter that whitens it.
//
//   residual = white + fast + slow      white: independent from sample to sample
//                                       fast, slow: Ornstein-Uhlenbeck processes with correlation times fast_s, slow_s
//
// A step of the current adds an error of its own, because a resistance is known only to a few per cent: the fast part
// is widened there. Where the OCV is steep the slow part is widened: a soc known to a few tenths of a per cent is a
// voltage that is not known to a millivolt. Without this the last percent of a discharge outvotes the rest: the half
// gap of a real cell's hysteresis was 58 ± 14 mV, with it 16 ± 5 mV, where 20 mV are measured.
//
// The white part alone would take every slow drift for physics: residuals of a drift look white from sample to sample
// and are still wrong for hours. The whitener is the Kalman filter of the two correlated parts. Its innovations,
// divided by their standard deviations, are white with variance 1. O(n), any sampling. (Astrom, Introduction to
// Stochastic Control Theory, 1970, ch. 7.)
#pragma once

#include <array>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "diagnosis/thresholds.hpp"

namespace bms::diagnosis {

struct NoiseModel {
  double white_v = 0.001;
  double fast_v = 0.0015, fast_s = thresholds.noise.fast_correlation_s;
  double slow_v = 0.001, slow_s = thresholds.noise.slow_correlation_s;
  double edge = 1;           ///< factor on the error that a step of the current adds
  double current_check = 1;  ///< factor on the steady part of the deviation of checks of the current (Check::steady)
  double voltage_check = 1;  ///< the same of the voltage
  bool operator==(const NoiseModel&) const = default;
};

/// Additional variances by row [V^2].
struct RowNoise {
  std::vector<double> white_v2;  ///< added to the white part, before NoiseModel::edge
  std::vector<double> edge_v2;   ///< added to the fast part at a step of the current, before NoiseModel::edge
  std::vector<double> slow_v2;   ///< added to the slow part, if there is one, where the OCV is steep

  explicit RowNoise(std::size_t rows = 0) : white_v2(rows, 0.0), edge_v2(rows, 0.0), slow_v2(rows, 0.0) {}
};

/// Amplitudes of a noise model that are estimated.
inline constexpr std::array amplitudes = {&NoiseModel::fast_v, &NoiseModel::slow_v,        &NoiseModel::white_v,
                                          &NoiseModel::edge,   &NoiseModel::current_check, &NoiseModel::voltage_check};

/// -2 log prior of noise that is larger than the nominal one; 0 if no amplitude is. Each amplitude costs
/// (ln ratio / Thresholds::Noise::amplitude_log_sigma)^2: little compared with a gross mismatch, much compared with
/// chance.
double price_of_noise(const NoiseModel& noise, const NoiseModel& nominal);

/// One column per signature, one row per sample.
using Columns = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// Columns in, white columns out. Rows that are not usable give 0.
class Whitener {
 public:
  /// rows and usable: as long as time_s.
  Whitener(const NoiseModel& noise, std::span<const double> time_s, const RowNoise& rows, std::span<const char> usable);

  /// In place; as many rows as time_s had.
  void whiten(Eigen::Ref<Columns> columns) const;
  /// The same for one column that is 0 before row `first`.
  void whiten(std::size_t first, std::span<double> values) const;
  /// Sum of the logarithms of the innovations' variances: the part of -2 log likelihood without the residual.
  double log_determinant() const { return log_determinant_; }
  /// Number of usable rows.
  std::size_t used() const { return used_; }

 private:
  struct Gain {
    double fast, slow;              ///< Kalman gain of each state
    double fast_decay, slow_decay;  ///< of each state until the next row
    double slow_size;               ///< standard deviation of the slow part over that on a flat OCV
    double weight;                  ///< 1 / standard deviation of the innovation; 0: row not used
  };
  /// Some columns of a matrix whose rows are `stride` apart.
  void whiten_some(double* columns, std::size_t count, Eigen::Index stride) const;

  std::vector<Gain> gains_;
  double log_determinant_ = 0;
  std::size_t used_ = 0;
};

/// -2 log likelihoods of a residual by some noise models, without the constant: whitened and summed in one pass for
/// several. As Whitener, for a residual of one column. All noise models have the same correlation times.
std::vector<double> minus_two_log_likelihoods(std::span<const NoiseModel> noises, std::span<const double> time_s,
                                              const RowNoise& rows, std::span<const char> usable,
                                              std::span<const double> residual_v);

/// Standard deviation of a voltage channel's white noise [V]: from second differences where the current moves by less
/// than quiet_a, and at least that of the quantisation. fallback_v if there are too few such rows.
double white_noise(std::span<const double> voltage_v, std::span<const double> current_a, double quiet_a,
                   double fallback_v);

/// Step of the grid on which readings lie; 0 if they lie on none. NaN is skipped; one finite value at least.
double quantisation_step(std::span<const double> values);

}  // namespace bms::diagnosis
