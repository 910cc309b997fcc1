#include "diagnosis/healthy_null.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include <unsupported/Eigen/SpecialFunctions>

#include "diagnosis/numerics.hpp"
#include "diagnosis/thresholds.hpp"
#include "measurement/normal_distribution.hpp"

namespace bms::diagnosis {

namespace {

constexpr const HealthyThresholds& healthy_limits = thresholds.healthy;

/// P(T > t) of Student's distribution.
double student_tail(double t, double freedom) {
  const double half = 0.5 * Eigen::numext::betainc(freedom / 2, 0.5, freedom / (freedom + t * t));
  return t > 0 ? half : 1 - half;
}

/// Probability that one more value of a normal sample of n lies so far above its mean. The standard deviation of the
/// sample, spread, has a prior that counts as so many more values; another normal part, elsewhere, is known.
double predictive_tail(double above, double spread, double elsewhere, double n) {
  const double freedom = n - 1 + healthy_limits.spread_counts, scale = spread * std::sqrt(1 + 1 / n);
  if (elsewhere <= 0) return student_tail(above / scale, freedom);
  double sum = 0, weights = 0;  // the mean over the known part, by the trapezoidal rule
  for (int k = -numerics.search.tail_points; k <= numerics.search.tail_points; ++k) {
    const double z = k * numerics.search.tail_step, weight = std::exp(-z * z / 2);
    sum += weight * student_tail((above - elsewhere * z) / scale, freedom);
    weights += weight;
  }
  return sum / weights;
}

/// ln of each block's gain over the usual level of the cause on the other blocks; the largest of all causes.
std::vector<double> largest_log_ratios(const std::vector<healthy_data::HealthyBlock>& blocks) {
  const double floor = thresholds.decision.detected;
  std::map<std::string, std::vector<double>> logs;  // by cause and block
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    for (const healthy_data::HealthyGain& e : blocks[b].gains) {
      std::vector<double>& of_cause = logs[e.cause];
      of_cause.resize(blocks.size(), std::log(floor));
      of_cause[b] = std::log(floor + e.gain);
    }
  }
  std::vector<double> largest(blocks.size(), 0);
  const double others = static_cast<double>(blocks.size()) - 1;
  for (const auto& [cause, of_cause] : logs) {
    const double sum = std::accumulate(of_cause.begin(), of_cause.end(), 0.0);
    for (std::size_t b = 0; b < blocks.size(); ++b) {
      const double usual = others > 0 ? (sum - of_cause[b]) / others : std::log(floor);
      largest[b] = std::max(largest[b], of_cause[b] - usual);
    }
  }
  return largest;
}

/// Blocks above which the rank alone is enough.
double most_blocks(double rate) { return std::ceil(1 / rate) - 1; }

}  // namespace

double hours_if_none_shows_any(double gain, double duration_h, double rate) {
  const double above = std::log1p(std::max(gain, 0.0) / thresholds.decision.detected);
  double blocks = 1;
  while (blocks < most_blocks(rate) && predictive_tail(above, healthy_limits.log_spread, 0, blocks) > rate) ++blocks;
  return blocks * duration_h;
}

HealthyNull::HealthyNull(const healthy_data::HealthyData& healthy, double rate, double duration_s)
    : blocks_(healthy.blocks), rate_(rate), hours_(healthy.hours()) {
  for (healthy_data::HealthyBlock& b : blocks_) {
    const double longer = b.duration_s > 0 ? std::max(1.0, duration_s / b.duration_s) : 1;
    for (healthy_data::HealthyGain& e : b.gains) e.gain *= longer;
  }
  level_of_block_ = largest_log_ratios(blocks_);
  const auto n = static_cast<double>(blocks());
  for (const double level : level_of_block_) mean_ += level / n;
  double squares = healthy_limits.spread_counts * healthy_limits.log_spread * healthy_limits.log_spread;
  for (const double level : level_of_block_) squares += (level - mean_) * (level - mean_);
  spread_ = std::sqrt(squares / (healthy_limits.spread_counts + std::max(n - 1, 0.0)));
}

bool HealthyNull::shows_a_cause() const {
  return std::any_of(blocks_.begin(), blocks_.end(), [](const healthy_data::HealthyBlock& b) {
    return std::any_of(b.gains.begin(), b.gains.end(),
                       [](const healthy_data::HealthyGain& e) { return e.gain >= thresholds.decision.detected; });
  });
}

double HealthyNull::gain_of(std::size_t block, const std::string& cause) const {
  for (const healthy_data::HealthyGain& e : blocks_[block].gains) {
    if (e.cause == cause) return e.gain;
  }
  return 0;
}

double HealthyNull::log_ratio(const std::string& cause, double gain) const {
  const double floor = thresholds.decision.detected;
  double sum = 0;
  for (std::size_t b = 0; b < blocks_.size(); ++b) sum += std::log(floor + gain_of(b, cause));
  // a single block had no other ones to be compared with: against its own level, what it shows would count twice
  const double usual = blocks_.size() < 2 ? std::log(floor) : sum / static_cast<double>(blocks_.size());
  return std::log(floor + gain) - usual;
}

double log_spread_beyond(double covered) { return (1 - covered) * healthy_limits.log_spread_beyond; }

double error_factor(double covered, double rate) {
  return std::exp(0.5 * measurement::normal_quantile(1 - rate) * log_spread_beyond(covered));
}

HealthyComparison HealthyNull::compare(const std::string& cause, double gain, double covered) const {
  HealthyComparison c;
  for (std::size_t b = 0; b < blocks_.size(); ++b) c.healthy_gain = std::max(c.healthy_gain, gain_of(b, cause));
  const auto n = static_cast<double>(blocks());
  const double ratio = log_ratio(cause, gain);
  const double elsewhere = log_spread_beyond(covered);
  double as_extreme = 0;  // expected number of blocks that would be, there
  bool exceeds_all = true;
  for (const double level : level_of_block_) {
    exceeds_all = exceeds_all && level < ratio;
    as_extreme +=
        elsewhere > 0 ? measurement::normal_tail((ratio - level) / elsewhere) : static_cast<double>(level >= ratio);
  }
  c.false_alarm = (1 + as_extreme) / (n + 1);
  if (exceeds_all && n > 0)
    c.false_alarm = std::min(c.false_alarm, predictive_tail(ratio - mean_, spread_, elsewhere, n));
  c.stands_out = c.false_alarm <= rate_;
  if (c.stands_out || !exceeds_all || (n > 0 && gain <= c.healthy_gain)) return c;
  // by rank alone, unless fewer blocks like these would do
  double needed = most_blocks(rate_);
  for (double more = n; n > 0 && more < needed; ++more) {
    if (predictive_tail(ratio - mean_, spread_, 0, more) <= rate_) needed = more;
  }
  const double block_h = n > 0 ? hours_ / n : healthy_limits.block_h;
  c.hours_needed = std::max(needed, n + 1) * block_h;
  return c;
}

std::optional<double> HealthyNull::gain_needed(const std::string& cause, double covered) const {
  double low = 0, high = std::log1p(numerics.search.most_gain);
  if (!compare(cause, std::expm1(high), covered).stands_out) return std::nullopt;
  while (high - low > numerics.search.gain_step) {
    const double middle = (low + high) / 2;
    (compare(cause, std::expm1(middle), covered).stands_out ? high : low) = middle;
  }
  return std::expm1(high);
}

}  // namespace bms::diagnosis
