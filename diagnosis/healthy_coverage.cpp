#include "diagnosis/healthy_coverage.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "diagnosis/charge_count.hpp"
#include "diagnosis/thresholds.hpp"

namespace bms::diagnosis {

namespace {

using measurement::HealthyRange;

constexpr const Thresholds::Healthy& coverage_limits = thresholds.healthy;

/// One axis, and by how much a row may leave it.
struct Dimension {
  BeyondHealthy of;
  double margin = 0;

  bool is_within(double value) const {
    const HealthyRange& h = of.healthy;
    return !h.known() || !std::isfinite(value) || (value >= h.low - margin && value <= h.high + margin);
  }
};

/// State of charge, current, temperature.
std::array<Dimension, 3> axes_of(const measurement::HealthyData& healthy) {
  std::array<Dimension, 3> axes;
  auto& [soc, current, temperature] = axes;
  soc = {{"soc", 0, {}, {}}, coverage_limits.soc_beyond};
  temperature = {{"temperature_c", 0, {}, {}}, coverage_limits.temperature_beyond_k};
  double largest_a = 0;
  for (const measurement::HealthyBlock& b : healthy.blocks) {
    soc.of.healthy.add(b.soc);
    temperature.of.healthy.add(b.temperature_c);
    if (b.current_a.known()) largest_a = std::max({largest_a, -b.current_a.low, b.current_a.high});
  }
  current = {{"current_a", 0, {}, {}}, (coverage_limits.current_beyond - 1) * largest_a};
  current.of.healthy.add(0);
  current.of.healthy.add(largest_a);
  return axes;
}

}  // namespace

HealthyCoverage coverage_of(const std::vector<PreparedRecording>& records, const measurement::HealthyData& healthy,
                            double capacity_ah) {
  std::array<Dimension, 3> axes = axes_of(healthy);
  HealthyCoverage c{0, 1, {}};
  double all_inside = 0, all_rows = 0;
  for (const PreparedRecording& r : records) {
    double inside = 0;
    for_each_row(r, capacity_ah, [&](const CountedRow& row) {
      const double at_c = r.temperature_c.empty() ? std::nan("") : r.temperature_c[row.k];
      const std::array<double, 3> values = {row.soc, std::abs(row.current_a), at_c};
      bool covered = true;
      for (std::size_t k = 0; k < axes.size(); ++k) {
        const bool within = axes[k].is_within(values[k]);
        axes[k].of.recorded.add(values[k]);
        axes[k].of.share += within ? 0 : 1;
        covered = covered && within;
      }
      inside += covered ? 1 : 0;
    });
    const auto rows = static_cast<double>(r.size());
    c.least = std::min(c.least, rows > 0 ? inside / rows : 0);
    all_inside += inside;
    all_rows += rows;
  }
  if (!(all_rows > 0)) return {};
  c.share = all_inside / all_rows;
  for (Dimension& axis : axes) {
    axis.of.share /= all_rows;
    if (axis.of.share > 0) c.beyond.push_back(std::move(axis.of));
  }
  std::stable_sort(c.beyond.begin(), c.beyond.end(), [](const auto& a, const auto& b) { return a.share > b.share; });
  return c;
}

}  // namespace bms::diagnosis
