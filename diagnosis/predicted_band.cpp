#include "diagnosis/predicted_band.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "diagnosis/thresholds.hpp"

namespace bms::diagnosis {

namespace {

/// Error of healthy recordings [V] at the nearest state of charge at which there were any; 0 without them.
double healthy_error_v(const std::vector<measurement::HealthyRegime>& regimes, double soc) {
  double nearest = std::numeric_limits<double>::infinity(), rms_v = 0;
  for (const measurement::HealthyRegime& r : regimes) {
    const double away = std::max({r.from - soc, soc - r.to, 0.0});
    if (r.axis != "soc" || !(r.hours > 0) || away >= nearest) continue;
    nearest = away;
    rms_v = r.rms_v;
  }
  return thresholds.healthy.error_times * rms_v;
}

}  // namespace

std::vector<double> predicted_sigma_v(const LikelihoodModel& likelihood, std::size_t record,
                                      const std::vector<measurement::HealthyRegime>& regimes) {
  const Hypothesis base = likelihood.base();
  std::vector<double> soc;
  const std::vector<double> file_v = likelihood.voltage(base, likelihood.unchanged(), record, &soc);
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
  std::vector<double> sigma_v;
  for (std::size_t k = 0; k < file_v.size(); ++k)
    sigma_v.push_back(std::max(std::sqrt(variance_v2[k]), healthy_error_v(regimes, soc[k])));
  return sigma_v;
}

}  // namespace bms::diagnosis
