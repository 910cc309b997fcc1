// Uncertainty that contains the error of the model.
//
// The inverse of the normal matrix assumes a whitened residual that is white. What a model lacks is not: it pulls the
// parameters in one direction for minutes. The sandwich estimate takes the pulls of whole blocks of time as they were.
// H. White, Econometrica 48 (1980) 817; K.-Y. Liang, S. Zeger, Biometrika 73 (1986) 13.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "diagnosis/likelihood_model.hpp"

namespace bms::diagnosis {

/// Blocks of a recording: each lasts many times a pull, and there are enough to know their spread to a quarter.
inline constexpr Eigen::Index covariance_blocks = 12;

/// block(first, count) for the rows of each block of a recording, within the recording.
template <class Block>
void for_each_block(std::size_t size, Block&& block) {
  const auto rows = static_cast<Eigen::Index>(size);
  for (Eigen::Index b = 0; b < covariance_blocks; ++b) {
    const Eigen::Index first = rows * b / covariance_blocks;
    block(first, rows * (b + 1) / covariance_blocks - first);
  }
}

/// A parameter that a fit leaves as it is, and its standard deviation.
struct FileParameter {
  ParameterRef ref;
  double sigma = 0;
};
/// The parameters of the cell file's own mechanisms that have a standard deviation.
std::vector<FileParameter> own_parameters(const Hypothesis& h);
/// Derivatives by own_parameters(), in their standard deviations; whitened. Their error goes into what a fit finds.
Columns by_own_mechanisms(const LikelihoodModel& likelihood, const HypothesisFit& fit);

/// Covariance of the estimated parameters of a fit, the base parameters marginalised. What the data say is in each
/// direction as uncertain as the pulls of equal blocks of time in each recording are, but not less than by the
/// covariance of the fit; what is known before any voltage is looked at stays known. The likelihood has the noise model
/// of the fit.
Eigen::MatrixXd block_covariance(const LikelihoodModel& likelihood, const HypothesisFit& fit);

/// Replaces covariance and standard deviations by those of block_covariance().
void include_model_error(const LikelihoodModel& likelihood, HypothesisFit& fit);

}  // namespace bms::diagnosis
