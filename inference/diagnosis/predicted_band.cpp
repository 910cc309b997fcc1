#include "diagnosis/predicted_band.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include "diagnosis/numerics.hpp"
#include "diagnosis/thresholds.hpp"

namespace bms::diagnosis {

namespace {

constexpr const HealthyThresholds& band_limits = thresholds.healthy;

/// The error of healthy recordings at a state of charge; nullptr if none was there.
const healthy_data::HealthyRegime* regime_at(const std::vector<healthy_data::HealthyRegime>& regimes, double soc) {
  for (const healthy_data::HealthyRegime& r : regimes) {
    // the outermost ranges have no outer end
    const bool from = soc >= r.from || r.from <= 0, to = soc < r.to || r.to >= 1;
    if (r.axis == "soc" && r.hours > 0 && from && to) return &r;
  }
  return nullptr;
}

/// Mean square error [V^2] of this file. The one that was measured left a part out: with n parts the error is 1 + 1/n
/// times a part's own, with n - 1 of them 1 + 1/(n - 1) times. With a single part nothing is known of that.
double of_all_parts_v2(const healthy_data::HealthyRegime& there) {
  const double less = there.parts > 1 ? 1 - 1 / (there.parts * there.parts) : 1;
  return less * there.rms_v * there.rms_v;
}

/// 97.5 % quantile of Student's distribution over that of the normal one; within 1 % from 3 degrees of freedom on.
double student_over_normal(double freedom) {
  double ratio = 1, power = 1;
  for (const double c : numerics.statistics.student_975) ratio += c * (power /= freedom);
  return ratio;
}

/// Returns true if the current goes beyond that of the healthy recordings.
bool is_beyond(const PreparedRecording& record, const std::vector<healthy_data::HealthyBlock>& blocks) {
  healthy_data::HealthyRange here, healthy;
  for (const double a : record.current_a) here.add(std::abs(a));
  for (const healthy_data::HealthyBlock& b : blocks) {
    healthy.add(std::abs(b.current_a.low));
    healthy.add(std::abs(b.current_a.high));
  }
  return healthy.known() && here.high > band_limits.current_beyond * healthy.high;
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

/// By row of a record; nullptr where no healthy recording was, or if the current goes beyond theirs.
std::vector<const healthy_data::HealthyRegime*> regimes_at(const PreparedRecording& record,
                                                           const std::vector<double>& soc,
                                                           const healthy_data::HealthyData& healthy) {
  std::vector<const healthy_data::HealthyRegime*> there(soc.size(), nullptr);
  if (is_beyond(record, healthy.blocks)) return there;
  for (std::size_t k = 0; k < soc.size(); ++k) there[k] = regime_at(healthy.regimes, soc[k]);
  return there;
}

/// The mean square error of healthy recordings over the variance that the cell file expects: the geometric mean over
/// the ranges of the state of charge, and over one more recording that was as expected.
double error_over_expected(const std::vector<const healthy_data::HealthyRegime*>& there,
                           const std::vector<double>& expected_v2, double least_error_v) {
  struct Sum {
    double expected_v2 = 0, rows = 0;
  };
  std::map<const healthy_data::HealthyRegime*, Sum> ranges;
  for (std::size_t k = 0; k < there.size(); ++k) {
    if (there[k] == nullptr) continue;
    ranges[there[k]].expected_v2 += expected_v2[k];
    ++ranges[there[k]].rows;
  }
  double log_ratio = 0, parts = 0;
  const auto count = static_cast<double>(std::max<std::size_t>(ranges.size(), 1));
  for (const auto& [range, sum] : ranges) {
    log_ratio += std::log(std::pow(std::max(range->rms_v, least_error_v), 2) * sum.rows / sum.expected_v2) / count;
    parts += range->parts / count;
  }
  return std::exp(log_ratio * parts / (parts + band_limits.as_expected));
}

}  // namespace

std::vector<double> predicted_sigma_v(const LikelihoodModel& likelihood, std::size_t record,
                                      const healthy_data::HealthyData& healthy) {
  std::vector<double> soc;
  const std::vector<double> file_v = likelihood.voltage(likelihood.base(), likelihood.unchanged(), record, &soc),
                            expected = expected_v2(likelihood, record, file_v);
  const auto there = regimes_at(likelihood.records()[record], soc, healthy);
  const double ratio = error_over_expected(there, expected, likelihood.noise().white_v);
  std::vector<double> sigma_v;
  for (std::size_t k = 0; k < file_v.size(); ++k) {
    if (there[k] != nullptr) {
      const double file = band_limits.tolerance_counts, n = there[k]->parts;
      const double v2 = (file * ratio * expected[k] + n * of_all_parts_v2(*there[k])) / (file + n);
      sigma_v.push_back(student_over_normal(file + n) * std::sqrt(v2));
    } else if (!healthy.regimes.empty()) {
      sigma_v.push_back(std::hypot(band_limits.tolerance_beyond * std::sqrt(expected[k]), healthy.beyond_tolerance_v));
    } else {
      sigma_v.push_back(std::sqrt(expected[k]));
    }
  }
  return sigma_v;
}

}  // namespace bms::diagnosis
