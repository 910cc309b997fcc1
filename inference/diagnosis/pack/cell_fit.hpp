// How one cell differs from its neighbours: a linear model around the best fit, on white residuals.
//
//   v_cell(t) - v_neighbours(t) = p(t; theta) + noise        theta: the parameters of causes.hpp
//
//   p = OCV(z + dz) - OCV(z) + (R0(z + dz) - R0(z)) I + h(resistance) (R0 I + v_rc) + polarisation v_rc + joint I
//       + offset + gain v_neighbours + [v_neighbours(t - delay) - v_neighbours(t)] + blur R0 (I - mean of I around t)
//   dz = charge + capacity (z(t) - z(0)) - leak t
//   h(r) = r / (1 + a w(t) (1 + r))      of a cell that its higher resistance warms up
//
// The neighbours are warmer by w than at the start. A cell with (1 + h) times their resistance warms up (1 + h) times
// as much, and its resistance falls by the share a for each kelvin: 1 + h = (1 + r) (1 - a w h), to first order.
//
// All causes of a cell share these columns. A hypothesis is a prior: a parameter that is healthy has the spread of the
// pack's cells, a faulty one a wide spread. Its likelihood follows from two matrices, so that no hypothesis needs a fit
// of its own.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "diagnosis/noise.hpp"
#include "diagnosis/pack/causes.hpp"
#include "diagnosis/pack/pack_recording.hpp"
#include "diagnosis/pack/track.hpp"

namespace bms::diagnosis::pack {

using Vector = Eigen::Matrix<double, parameter_count, 1>;
using Matrix = Eigen::Matrix<double, parameter_count, parameter_count>;

/// parameter_count as an index of Eigen.
inline constexpr Eigen::Index width = parameter_count;

/// The rows up to a time: information and its product with the data.
struct Information {
  double until_s = 0;
  Matrix of_parameters = Matrix::Zero();  ///< columns' white products
  Vector with_data = Vector::Zero();
};

struct CellFit {
  Vector theta = Vector::Zero();  ///< around which the model is linear
  NoiseModel noise;
  std::vector<Information> until;    ///< at checkpoints; the last one has all rows
  std::vector<double> difference_v;  ///< to the neighbours; NaN: not used
  std::vector<double> residual_v;    ///< without what theta explains; NaN: not used
  Columns white;                     ///< while it is fitted: the columns of the parameters, and last the residual
  std::vector<double> soc;           ///< the same: of the cell, by row
  RowNoise row_noise;                ///< the same
  std::vector<double> lasting_v2;    ///< the part of its variance that lasts [V^2], by row; once fitted
  std::size_t used = 0;
  double cost = 0;    ///< -2 log posterior of theta but for a constant
  double square = 0;  ///< of the white difference, with all rows

  const Information& all() const { return until.back(); }
};

/// What a fit of one cell needs.
struct FitInput {
  const PackRecording* pack = nullptr;
  const Track* track = nullptr;
  std::vector<double> warmer_k;  ///< by row: temperature of the cell minus the mean of the sensors; empty: unknown
  std::size_t cell = 0;
  std::optional<double> known_delay_s;  ///< of the channel, where the rows that are used do not show it
};

/// Where a fit begins: a coarse search over charge and capacity. lag_s: of the channel.
Vector starting_point(const FitInput& input, double lag_s);

/// prior: standard deviation of each parameter.
CellFit fit_cell(const FitInput& input, const Vector& start, const Vector& prior, const NoiseModel& noise);

/// Noise by maximum likelihood of the residual of a fit.
NoiseModel noise_of(const FitInput& input, const CellFit& fit);

}  // namespace bms::diagnosis::pack
