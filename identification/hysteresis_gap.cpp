#include "identification/hysteresis_gap.hpp"

#include <algorithm>
#include <cmath>

#include "model/mechanism.hpp"

namespace bms::identification {

std::optional<double> plateau_half_gap_v(const OcvCurve& curve) {
  if (!curve.coulombic_efficiency) return std::nullopt;
  double sum = 0;
  std::size_t count = 0;
  for (std::size_t k = 0; k < curve.soc.size(); ++k) {
    if (curve.soc[k] < 0.2 || curve.soc[k] > 0.8) continue;
    sum += curve.half_gap_v[k];
    ++count;
  }
  return sum / static_cast<double>(count);
}

std::optional<SlowGap> slow_gap(const std::vector<GapAtTemperature>& gaps, double reference_c) {
  const auto colder = [](const GapAtTemperature& a, const GapAtTemperature& b) {
    return a.temperature_c < b.temperature_c;
  };
  if (gaps.size() < 3) return std::nullopt;
  const auto [coldest, warmest] = std::minmax_element(gaps.begin(), gaps.end(), colder);
  if (warmest->temperature_c - coldest->temperature_c < 20) return std::nullopt;
  std::optional<SlowGap> best;
  for (double energy = 10'000; energy <= 80'000; energy += 500) {
    const auto factor = [&](double temperature_c) {
      return std::exp(model::mechanism_detail::energy_over_rt(energy, reference_c) * (reference_c - temperature_c) /
                      (temperature_c + 273.15));
    };
    // two unknowns that are not negative
    double a = 0, aa = 0, g = 0, ag = 0, gg = 0;
    const auto n = static_cast<double>(gaps.size());
    for (const GapAtTemperature& at : gaps) {
      const double f = factor(at.temperature_c);
      a += f;
      aa += f * f;
      g += at.half_gap_v;
      ag += f * at.half_gap_v;
      gg += at.half_gap_v * at.half_gap_v;
    }
    double over_v = std::max(0.0, (n * ag - a * g) / (n * aa - a * a)), m_v = (g - over_v * a) / n;
    if (m_v < 0) {
      m_v = 0;
      over_v = std::max(0.0, ag / aa);
    }
    const double squares =
        gg - 2 * m_v * g - 2 * over_v * ag + n * m_v * m_v + 2 * m_v * over_v * a + over_v * over_v * aa;
    const double residual_v = std::sqrt(std::max(0.0, squares) / n);
    if (!best || residual_v < best->residual_v) best = {m_v, over_v, energy, residual_v};
  }
  return best;
}

}  // namespace bms::identification
