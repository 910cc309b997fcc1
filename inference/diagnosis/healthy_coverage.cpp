#include "diagnosis/healthy_coverage.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "diagnosis/charge_count.hpp"
#include "diagnosis/thresholds.hpp"

namespace bms::diagnosis {

namespace {

using healthy_data::HealthyRange;

constexpr const HealthyThresholds& coverage_limits = thresholds.healthy;

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
std::array<Dimension, 3> axes_of(const healthy_data::HealthyData& healthy) {
  std::array<Dimension, 3> axes;
  auto& [soc, current, temperature] = axes;
  soc = {{"soc", 0, {}, {}}, coverage_limits.soc_beyond};
  temperature = {{"temperature_c", 0, {}, {}}, coverage_limits.temperature_beyond_k};
  double largest_a = 0;
  for (const healthy_data::HealthyBlock& b : healthy.blocks) {
    soc.of.healthy.add(b.soc);
    temperature.of.healthy.add(b.temperature_c);
    if (b.current_a.known()) largest_a = std::max({largest_a, -b.current_a.low, b.current_a.high});
  }
  current = {{"current_a", 0, {}, {}}, (coverage_limits.current_beyond - 1) * largest_a};
  current.of.healthy.add(0);
  current.of.healthy.add(largest_a);
  return axes;
}

/// Share that is covered, of the rows or of the squared current, whichever is less: what a model lacks in its
/// resistances shows in proportion to the current, and a few large ones may carry most of it.
class CoveredShare {
 public:
  void add(double current_a, bool covered) {
    const double square = current_a * current_a;
    (covered ? inside_ : outside_) += 1;
    (covered ? inside_square_ : outside_square_) += square;
  }
  void add(const CoveredShare& other) {
    inside_ += other.inside_;
    outside_ += other.outside_;
    inside_square_ += other.inside_square_;
    outside_square_ += other.outside_square_;
  }
  double rows() const { return inside_ + outside_; }
  double share() const {
    if (!(rows() > 0)) return 0;
    const double square = inside_square_ + outside_square_, of_rows = inside_ / rows();
    return square > 0 ? std::min(of_rows, inside_square_ / square) : of_rows;
  }

 private:
  double inside_ = 0, outside_ = 0, inside_square_ = 0, outside_square_ = 0;
};

}  // namespace

HealthyCoverage coverage_of(const std::vector<PreparedRecording>& records, const healthy_data::HealthyData& healthy,
                            double capacity_ah) {
  std::array<Dimension, 3> axes = axes_of(healthy);
  HealthyCoverage c{0, 1, {}};
  CoveredShare all;
  for (const PreparedRecording& r : records) {
    CoveredShare one;
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
      one.add(row.current_a, covered);
    });
    c.least = std::min(c.least, one.share());
    all.add(one);
  }
  if (!(all.rows() > 0)) return {};
  c.share = all.share();
  for (Dimension& axis : axes) {
    axis.of.share /= all.rows();
    if (axis.of.share > 0) c.beyond.push_back(std::move(axis.of));
  }
  std::stable_sort(c.beyond.begin(), c.beyond.end(), [](const auto& a, const auto& b) { return a.share > b.share; });
  return c;
}

}  // namespace bms::diagnosis
