#include "diagnosis/denoise_current.hpp"

#include <algorithm>
#include <cmath>

#include "diagnosis/noise.hpp"

namespace bms::diagnosis {

double current_noise(std::span<const double> a) {
  constexpr std::size_t block = 30;
  std::vector<double> spreads;
  for (std::size_t from = 0; from + block < a.size(); from += block) {
    double sum = 0;
    std::size_t count = 0;
    for (std::size_t k = from + 2; k < from + block; ++k) {
      const double bend = a[k] - 2 * a[k - 1] + a[k - 2];
      if (!std::isfinite(bend)) continue;
      sum += bend * bend / 6;
      ++count;
    }
    if (count > block / 2) spreads.push_back(std::sqrt(sum / static_cast<double>(count)));
  }
  if (spreads.size() < 5) return 0;
  const auto calm = spreads.begin() + static_cast<std::ptrdiff_t>(spreads.size() / 5);
  std::nth_element(spreads.begin(), calm, spreads.end());
  return std::max(*calm, quantisation_step(a) / std::sqrt(12.0));
}

std::vector<double> denoise_current(std::span<const double> a, double noise_a) {
  std::vector<double> quiet(a.begin(), a.end());
  if (!(noise_a > 0)) return quiet;
  constexpr std::size_t reach = 30;
  for (std::size_t k = 0; k < a.size(); ++k) {
    if (!std::isfinite(a[k])) continue;
    const auto near = [&](std::size_t j) { return std::abs(a[j] - a[k]) <= 4.5 * noise_a; };  // NaN is not
    double sum = a[k], count = 1;
    for (std::size_t j = k; j-- > 0 && k - j <= reach && near(j);) sum += a[j], ++count;
    for (std::size_t j = k + 1; j < a.size() && j - k <= reach && near(j); ++j) sum += a[j], ++count;
    if (count > 4) quiet[k] = sum / count;
  }
  return quiet;
}

}  // namespace bms::diagnosis
