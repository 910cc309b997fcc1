#include "diagnosis/predicted_band.hpp"

#include <cmath>

#include "diagnosis/thresholds.hpp"

namespace bms::diagnosis {

namespace {

/// The error of healthy recordings at a state of charge; nullptr if none was there.
const measurement::HealthyRegime* regime_at(const std::vector<measurement::HealthyRegime>& regimes, double soc) {
  for (const measurement::HealthyRegime& r : regimes) {
    // the outermost ranges have no outer end
    const bool from = soc >= r.from || r.from <= 0, to = soc < r.to || r.to >= 1;
    if (r.axis == "soc" && r.hours > 0 && from && to) return &r;
  }
  return nullptr;
}

/// Mean square error [V^2] of this file. The one that was measured left a part out: with n parts the error is 1 + 1/n
/// times a part's own, with n - 1 of them 1 + 1/(n - 1) times. With a single part nothing is known of that.
double of_all_parts_v2(const measurement::HealthyRegime& there) {
  const double less = there.parts > 1 ? 1 - 1 / (there.parts * there.parts) : 1;
  return less * there.high_v * there.high_v;
}

/// Returns true if the current goes beyond that of the healthy recordings.
bool is_beyond(const PreparedRecording& record, const std::vector<measurement::HealthyBlock>& blocks) {
  measurement::HealthyRange here, healthy;
  for (const double a : record.current_a) here.add(std::abs(a));
  for (const measurement::HealthyBlock& b : blocks) {
    healthy.add(std::abs(b.current_a.low));
    healthy.add(std::abs(b.current_a.high));
  }
  return healthy.known() && here.high > thresholds.healthy.current_beyond * healthy.high;
}

/// By the cell file alone [V^2]: noise, and the base parameters within their tolerance.
std::vector<double> expected_v2(const LikelihoodModel& likelihood, std::size_t record,
                                const std::vector<double>& file_v) {
  const NoiseModel& noise = likelihood.noise();
  const RowNoise& rows = likelihood.row_noise(record);
  std::vector<double> variance_v2(file_v.size());
  for (std::size_t k = 0; k < variance_v2.size(); ++k)
    variance_v2[k] = noise.white_v * noise.white_v + rows.white_v2[k] + noise.fast_v * noise.fast_v +
                     noise.slow_v * noise.slow_v + rows.slow_v2[k];
  for (std::size_t j = 0; j < likelihood.calibration().size(); ++j) {
    Eigen::VectorXd moved = likelihood.unchanged();
    moved[static_cast<Eigen::Index>(j)] = 1;  // in standard deviations
    const std::vector<double> moved_v = likelihood.voltage(likelihood.base(), moved, record);
    for (std::size_t k = 0; k < file_v.size(); ++k) variance_v2[k] += std::pow(moved_v[k] - file_v[k], 2);
  }
  return variance_v2;
}

}  // namespace

std::vector<double> predicted_sigma_v(const LikelihoodModel& likelihood, std::size_t record,
                                      const measurement::HealthyData& healthy) {
  constexpr const Thresholds::Healthy& limits = thresholds.healthy;
  std::vector<double> soc;
  const std::vector<double> file_v = likelihood.voltage(likelihood.base(), likelihood.unchanged(), record, &soc),
                            variance_v2 = expected_v2(likelihood, record, file_v);
  const bool beyond = is_beyond(likelihood.records()[record], healthy.blocks);
  std::vector<double> sigma_v;
  for (std::size_t k = 0; k < file_v.size(); ++k) {
    const measurement::HealthyRegime* there = beyond ? nullptr : regime_at(healthy.regimes, soc[k]);
    double v2 = variance_v2[k];
    if (there != nullptr)
      v2 = (limits.tolerance_counts * v2 + there->parts * of_all_parts_v2(*there)) /
           (limits.tolerance_counts + there->parts);
    else if (!healthy.regimes.empty())
      v2 = std::pow(limits.tolerance_beyond, 2) * v2 + std::pow(healthy.beyond_tolerance_v, 2);
    sigma_v.push_back(std::sqrt(v2));
  }
  return sigma_v;
}

}  // namespace bms::diagnosis
