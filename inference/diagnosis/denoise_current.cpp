#include "diagnosis/denoise_current.hpp"

#include <algorithm>
#include <cmath>

#include "diagnosis/noise.hpp"
#include "diagnosis/numerics.hpp"
#include "diagnosis/thresholds.hpp"
#include "measurement/statistics.hpp"

namespace bms::diagnosis {

namespace {

constexpr const Thresholds::CurrentDenoising& denoising_limits = thresholds.denoising;

}  // namespace

double current_noise(std::span<const double> a) {
  constexpr std::size_t block = denoising_limits.block_rows;
  std::vector<double> spreads;
  for (std::size_t from = 0; from + block < a.size(); from += block) {
    double sum = 0;
    std::size_t count = 0;
    for (std::size_t k = from + 2; k < from + block; ++k) {
      const double bend = a[k] - 2 * a[k - 1] + a[k - 2];
      if (!std::isfinite(bend)) continue;
      sum += bend * bend / numerics.statistics.second_difference_variance;
      ++count;
    }
    if (count > block / 2) spreads.push_back(std::sqrt(sum / static_cast<double>(count)));
  }
  if (spreads.size() < denoising_limits.blocks) return 0;
  const double calm_a = measurement::quantile(std::move(spreads), denoising_limits.calm_quantile);
  return std::max(calm_a, quantisation_step(a) / std::sqrt(numerics.statistics.uniform_variance_denominator));
}

std::vector<double> denoise_current(std::span<const double> a, double noise_a) {
  std::vector<double> denoised(a.begin(), a.end());
  if (!(noise_a > 0)) return denoised;
  for (std::size_t k = 0; k < a.size(); ++k) {
    if (!std::isfinite(a[k])) continue;
    const auto near = [&](std::size_t j) {  // NaN is not
      return std::abs(a[j] - a[k]) <= denoising_limits.neighbour_sigma * noise_a;
    };
    double sum = a[k], count = 1;
    for (std::size_t j = k; j-- > 0 && k - j <= denoising_limits.reach_rows && near(j);) {
      sum += a[j];
      ++count;
    }
    for (std::size_t j = k + 1; j < a.size() && j - k <= denoising_limits.reach_rows && near(j); ++j) {
      sum += a[j];
      ++count;
    }
    if (count > denoising_limits.neighbours) denoised[k] = sum / count;
  }
  return denoised;
}

}  // namespace bms::diagnosis
