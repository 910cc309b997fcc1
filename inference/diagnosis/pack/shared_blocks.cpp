#include "diagnosis/pack/shared_blocks.hpp"

#include <algorithm>
#include <cmath>

#include "diagnosis/pack/current_kind.hpp"
#include "diagnosis/pack/pack_thresholds.hpp"

namespace bms::diagnosis::pack {

namespace {

double temperature_of(const PackRecording& pack, std::size_t row) {
  double sum = 0, count = 0;
  for (const auto& sensor : pack.sensor_c) {
    if (!std::isfinite(sensor[row])) continue;
    sum += sensor[row];
    ++count;
  }
  return count > 0 ? sum / count : no_value;
}

/// How much the current changes from row to row, on average before and after a row; 0 where it is not known.
std::vector<double> change_per_row(const std::vector<double>& current_a) {
  std::vector<double> change(current_a.size(), 0.0);
  for (std::size_t k = 1; k + 1 < change.size(); ++k) {
    const double a = (current_a[k + 1] - current_a[k - 1]) / 2;
    if (std::isfinite(a)) change[k] = a;
  }
  return change;
}

}  // namespace

Blocks::Blocks(const Track& t, const PackRecording& pack) : block_of_row_(pack.rows(), none) {
  const double length_s = std::max(limits.shared.block_s, limits.shared.block_rows * t.step_s);
  double since_s = 0;
  for (std::size_t k = 0; k < pack.rows(); ++k) {
    if (!std::isfinite(t.neighbours_v[k] + pack.current_a[k])) continue;
    if (count_ == 0 || pack.time_s[k] - since_s >= length_s) {
      ++count_;
      since_s = pack.time_s[k];
    }
    block_of_row_[k] = count_ - 1;
  }
  time_s = means(pack.time_s);
  voltage_v = means(t.neighbours_v);
  current_a = means(pack.current_a);
  change_a = means(change_per_row(pack.current_a));
  warmer_k = means(warmer_than_at_start(pack));
}

std::vector<double> Blocks::means(const std::vector<double>& by_row) const {
  std::vector<double> sums(count_, 0.0), rows(count_, 0.0);
  for (std::size_t k = 0; k < by_row.size(); ++k) {
    if (block_of_row_[k] == none) continue;
    sums[block_of_row_[k]] += by_row[k];
    ++rows[block_of_row_[k]];
  }
  for (std::size_t b = 0; b < count_; ++b) sums[b] /= rows[b];
  return sums;
}

std::vector<double> counted_charge(const Track& track, const PackRecording& pack) {
  std::vector<double> charge(pack.rows(), 0.0);
  for (std::size_t k = 1; k < charge.size(); ++k) {
    const double dt_s = pack.time_s[k] - pack.time_s[k - 1];
    const double mean_a = mean_current_a(pack, k), current_a = std::isfinite(mean_a) ? mean_a : 0;
    charge[k] = charge[k - 1] + current_a * dt_s / (3'600 * track.capacity_ah);
  }
  return charge;
}

std::vector<double> warmer_than_at_start(const PackRecording& pack) {
  std::vector<double> warmer(pack.rows(), 0.0);
  const double at_start_c = temperature_of(pack, 0);
  for (std::size_t k = 0; k < warmer.size(); ++k) {
    const double warmer_k = temperature_of(pack, k) - at_start_c;
    if (std::isfinite(warmer_k)) warmer[k] = warmer_k;
  }
  return warmer;
}

std::string reason_not_to_test(const Track& t, const PackRecording& pack) {
  if (!pack.charge_unknown.empty()) return "Not tested: " + pack.charge_unknown + ".";
  for (std::size_t k = 1; k < pack.rows(); ++k) {
    if (pack.time_s[k] - pack.time_s[k - 1] > limits.shared.longest_gap_s)
      return "Not tested: the recording has gaps, in which the charge is unknown.";
  }
  if (pack.time_s.back() - pack.time_s.front() < limits.shared.least_hours * 3'600)
    return "Not tested: the recording is too short.";
  if (t.step_s > limits.shared.longest_step_s) return "Not tested: the rows are too far apart.";
  std::size_t finite = 0;
  for (const double v : t.neighbours_v) finite += std::isfinite(v) ? 1 : 0;
  if (2 * finite < pack.rows()) return "Not tested: most readings are missing or held.";
  return "";
}

}  // namespace bms::diagnosis::pack
