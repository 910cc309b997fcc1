#include "workflow/residual_regimes.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "diagnosis/charge_count.hpp"
#include "diagnosis/thresholds.hpp"

namespace bms::workflow {

namespace {

constexpr double edge_c = 0.1;  ///< [C] step of the current from which time is counted

struct Axis {
  const char* name;
  std::vector<double> edges;
};

const std::array<Axis, 5>& axes() {
  static const std::array<Axis, 5> all = {{
      {"soc", {0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1}},
      {"current_c", {0, 0.05, 0.5, 1, 2, 4, 8, 16}},
      {"temperature_c", {-40, -30, -20, -10, 0, 10, 20, 30, 40, 50, 60, 70, 80}},
      {"since_edge_s", {0, 2, 10, 60, 600, 36'000}},
      {"since_start_s", {0, 600, 3'600, 10'800, 360'000}},
  }};
  return all;
}

/// Index of the range; the outermost ones have no outer end.
std::size_t range_of(const std::vector<double>& edges, double value) {
  const auto above = std::upper_bound(edges.begin() + 1, edges.end() - 1, value);
  return static_cast<std::size_t>(above - edges.begin()) - 1;
}

}  // namespace

std::size_t ResidualRegimes::part_of(std::size_t block) const {
  const bool single = std::all_of(blocks_.begin(), blocks_.end(),
                                  [&](const Block& b) { return b.recording == blocks_.front().recording; });
  return single ? block : blocks_[block].recording;
}

void ResidualRegimes::add_block(std::size_t recording, const diagnosis::PreparedRecording& record,
                                const std::vector<double>& simulated_v, const std::vector<double>& expected_v,
                                double capacity_ah) {
  Block& block = blocks_.emplace_back();
  block.recording = recording;
  double last_edge_s = record.time_s.front();
  diagnosis::for_each_row(record, capacity_ah, [&](const diagnosis::CountedRow& row) {
    const double now_s = record.time_s[row.k];
    if (std::abs(row.current_a - row.previous_a) > edge_c * capacity_ah) last_edge_s = now_s;
    const double residual_v = record.voltage_v[row.k] - simulated_v[row.k];
    if (!std::isfinite(residual_v)) return;
    ++block.rows;
    block.squares += residual_v * residual_v;
    block.expected += expected_v[row.k] * expected_v[row.k];
    const std::array<double, 5> at = {row.soc, std::abs(row.current_a) / capacity_ah,
                                      record.temperature_c.empty() ? std::nan("") : record.temperature_c[row.k],
                                      now_s - last_edge_s, now_s - record.time_s.front()};
    for (std::size_t a = 0; a < at.size(); ++a) {
      if (!std::isfinite(at[a])) continue;
      Sum& s = block.sums[{a, range_of(axes()[a].edges, at[a])}];
      ++s.count;
      s.sum_v += residual_v;
      s.squares += residual_v * residual_v;
      s.hours += row.duration_s / 3'600;
    }
  });
}

std::vector<healthy_data::HealthyRegime> ResidualRegimes::regimes(const std::vector<char>& kept) const {
  std::map<std::pair<std::size_t, std::size_t>, std::vector<Sum>> all;
  std::map<std::pair<std::size_t, std::size_t>, std::set<std::size_t>> parts;
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    if (!kept.empty() && kept[b] == 0) continue;
    for (const auto& [place, sum] : blocks_[b].sums) {
      all[place].push_back(sum);
      parts[place].insert(part_of(b));
    }
  }
  std::vector<healthy_data::HealthyRegime> list;
  for (const auto& [place, sums] : all) {
    const Axis& axis = axes()[place.first];
    healthy_data::HealthyRegime r{axis.name, axis.edges[place.second], axis.edges[place.second + 1]};
    double count = 0, squares = 0;
    for (const Sum& s : sums) {
      r.hours += s.hours;
      r.bias_v += s.sum_v;
      squares += s.squares;
      count += s.count;
    }
    r.bias_v /= count;
    r.rms_v = std::sqrt(squares / count);
    for (const Sum& s : sums) r.spread_v += (s.sum_v / s.count - r.bias_v) * (s.sum_v / s.count - r.bias_v);
    r.spread_v = std::sqrt(r.spread_v / std::max<double>(static_cast<double>(sums.size()) - 1, 1));
    r.parts = static_cast<double>(parts[place].size());
    list.push_back(r);
  }
  return list;
}

double ResidualRegimes::beyond_tolerance_v(const std::vector<char>& kept) const {
  std::map<std::size_t, Block> parts;
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    if (kept[b] == 0 || !(blocks_[b].rows > 0)) continue;
    Block& part = parts[part_of(b)];
    part.rows += blocks_[b].rows;
    part.squares += blocks_[b].squares;
    part.expected += blocks_[b].expected;
  }
  double sum = 0, weights = diagnosis::thresholds.healthy.as_expected;
  for (const auto& [part, total] : parts) {
    sum += std::max(total.squares - total.expected, 0.0) / total.rows;
    ++weights;
  }
  return std::sqrt(sum / weights);
}

}  // namespace bms::workflow
