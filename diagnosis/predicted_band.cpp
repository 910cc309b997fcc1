#include "diagnosis/predicted_band.hpp"

#include <cmath>

namespace bms::diagnosis {

std::vector<double> predicted_sigma_v(const LikelihoodModel& likelihood, std::size_t record) {
  const Hypothesis base = likelihood.base();
  const std::vector<double> file_v = likelihood.voltage(base, likelihood.unchanged(), record);
  const NoiseModel& noise = likelihood.noise();
  const RowNoise& rows = likelihood.row_noise(record);
  std::vector<double> variance_v2(file_v.size());
  for (std::size_t k = 0; k < variance_v2.size(); ++k)
    variance_v2[k] = noise.white_v * noise.white_v + rows.white_v2[k] + noise.fast_v * noise.fast_v +
                     noise.slow_v * noise.slow_v + rows.slow_v2[k];
  for (std::size_t j = 0; j < likelihood.calibration().size(); ++j) {
    Eigen::VectorXd moved = likelihood.unchanged();
    moved[static_cast<Eigen::Index>(j)] = 1;  // in standard deviations
    const std::vector<double> moved_v = likelihood.voltage(base, moved, record);
    for (std::size_t k = 0; k < file_v.size(); ++k) variance_v2[k] += std::pow(moved_v[k] - file_v[k], 2);
  }
  for (double& v : variance_v2) v = std::sqrt(v);
  return variance_v2;
}

}  // namespace bms::diagnosis
