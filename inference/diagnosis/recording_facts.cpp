#include "diagnosis/recording_facts.hpp"

#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

#include "diagnosis/charge_count.hpp"
#include "diagnosis/one_current.hpp"
#include "diagnosis/thresholds.hpp"
#include "measurement/spans.hpp"
#include "measurement/statistics.hpp"

namespace bms::diagnosis {

namespace {

constexpr const Thresholds::Facts& fact_limits = thresholds.facts;

/// Smallest and largest value.
struct Range {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  void add(double x) {
    low = std::min(low, x);
    high = std::max(high, x);
  }
  double span() const { return high > low ? high - low : 0; }
};

/// Counts how often the charge turns: it has gone back by turn_soc from its farthest point.
class Turns {
 public:
  explicit Turns(double soc) : start_(soc), farthest_(soc) {}
  /// Returns true if the charge has turned in this row.
  bool turned(double soc) {
    if (heading_ > 0) farthest_ = std::max(farthest_, soc);
    if (heading_ < 0) farthest_ = std::min(farthest_, soc);
    const bool begins = heading_ == 0 && std::abs(soc - start_) > fact_limits.turn_soc,
               turns = heading_ != 0 && (farthest_ - soc) * heading_ > fact_limits.turn_soc;
    if (begins) heading_ = soc > start_ ? 1 : -1;
    if (turns) heading_ = -heading_;
    if (begins || turns) farthest_ = soc;
    return turns;
  }

 private:
  double start_, farthest_;
  int heading_ = 0;
};

/// Is the largest current reached often enough, in visits apart from each other?
std::optional<double> rail_a(double largest_a, double capacity_ah, std::span<const PreparedRecording> records) {
  if (largest_a < fact_limits.rail_c * capacity_ah) return std::nullopt;
  std::size_t near = 0, visits = 0;
  for (const PreparedRecording& r : records) {
    const auto at_rail = [&](std::size_t k) {
      return std::isfinite(r.current_a[k]) && std::abs(r.current_a[k]) > fact_limits.rail_share * largest_a;
    };
    for (const measurement::Rows& visit : measurement::consecutive_rows(r.size(), at_rail)) {
      near += visit.size();
      ++visits;
    }
  }
  return near >= fact_limits.rail_rows && visits >= fact_limits.rail_runs ? std::optional(largest_a) : std::nullopt;
}

/// All that follows from the counted charge of one recording.
void count_charge(const PreparedRecording& r, RecordingFacts& facts, Range& soc, std::set<int>& rates,
                  std::vector<double>& steps_s) {
  Turns turns(r.initial_soc);
  double rested_s = 0;
  for_each_row(r, facts.capacity_ah, [&](const CountedRow& row) {
    if (row.k > 0) {
      steps_s.push_back(row.duration_s);
      facts.throughput_soc += std::abs(row.moved_soc);
      facts.charged_soc += std::max(row.moved_soc, 0.0);
      if (std::abs(row.current_a - row.previous_a) > fact_limits.edge_c * facts.capacity_ah) ++facts.edges;
    }
    soc.add(row.soc);
    const double c_rate = std::abs(row.current_a) / facts.capacity_ah;
    rested_s = c_rate < fact_limits.rest_c ? rested_s + row.duration_s : 0;
    facts.longest_rest_s = std::max(facts.longest_rest_s, rested_s);
    if (c_rate > fact_limits.rate_c)
      rates.insert(static_cast<int>(std::lround(std::log(c_rate) / std::log(fact_limits.rate_ratio))));
    if (turns.turned(row.soc)) ++facts.reversals;
  });
}

/// Mean error of the current sensor where no current flows, in its standard deviations.
double zero_error_sigmas(const PreparedRecording& r, double capacity_ah) {
  double sum = 0, weight = 0;
  for (const Check& c : r.checks) {
    if (c.channel != Check::Channel::current || std::abs(c.reference) > fact_limits.rest_c * capacity_ah) continue;
    const double deviation = c.deviation();
    sum += (c.read - c.reference) / (deviation * deviation);
    weight += 1 / (deviation * deviation);
  }
  return weight > 0 ? std::abs(sum) / std::sqrt(weight) : 0;
}

}  // namespace

RecordingFacts recording_facts(const model::CellParameters<>& cell, std::span<const PreparedRecording> records) {
  RecordingFacts facts;
  const double capacity_ah = cell.capacity_ah;
  facts.capacity_ah = capacity_ah;
  facts.reference_c = cell.reference_temperature_c;
  Range soc, read_a, temperature_c;
  std::set<int> rates;
  std::vector<double> steps_s, away_k;
  facts.trusted_current = std::all_of(records.begin(), records.end(), [](const auto& r) { return r.trusted_current; });
  facts.trusted_voltage = std::all_of(records.begin(), records.end(), [](const auto& r) { return r.trusted_voltage; });
  if (!records.empty() && records.front().other_initial_soc)
    facts.start_shift = *records.front().other_initial_soc - records.front().initial_soc;
  for (const PreparedRecording& r : records) {
    facts.duration_s += r.duration_s();
    facts.duration_h += r.duration_s() / 3'600;
    facts.start_given = facts.start_given || r.initial_soc_given;
    facts.trusted_instruments = facts.trusted_instruments || std::any_of(r.checks.begin(), r.checks.end(),
                                                                         [](const Check& c) { return !c.assumed; });
    facts.zero_error_sigmas = std::max(facts.zero_error_sigmas, zero_error_sigmas(r, capacity_ah));
    count_charge(r, facts, soc, rates, steps_s);
    for (const double a : r.current_a) {
      if (!std::isfinite(a)) continue;
      read_a.add(a);
      facts.loaded_rows += std::abs(a) > fact_limits.moving_c * capacity_ah ? 1 : 0;
      facts.largest_a = std::max(facts.largest_a, std::abs(a));
    }
    for (const double c : r.temperature_c) {
      if (!std::isfinite(c)) continue;
      temperature_c.add(c);
      facts.temperature = true;
      away_k.push_back(std::abs(c - facts.reference_c));
      facts.away_k = std::max(facts.away_k, away_k.back());
    }
  }
  if (!away_k.empty()) facts.mostly_away_k = measurement::upper_median(away_k);
  if (!steps_s.empty()) facts.step_s = measurement::upper_median(steps_s);
  facts.soc_span = soc.span();
  facts.read_span_a = read_a.span();
  facts.temperature_span_k = temperature_c.span();
  facts.rates = rates.size();
  facts.one_current = has_one_current(records, capacity_ah);
  facts.rail_a = rail_a(facts.largest_a, capacity_ah, records);
  return facts;
}

}  // namespace bms::diagnosis
