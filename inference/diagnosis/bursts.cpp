#include "diagnosis/bursts.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "diagnosis/numerics.hpp"
#include "diagnosis/thresholds.hpp"

namespace bms::diagnosis {

namespace {

constexpr const Thresholds::Bursts& burst_limits = thresholds.bursts;

/// A stretch of rows and what the residual says of a resistance in it: gain of r is 2 r toward - r^2 size.
struct Stretch {
  std::size_t first = 0, end = 0;
  double toward = 0, size = 0;
  double gain(double ohm) const { return 2 * ohm * toward - ohm * ohm * size; }
};

/// Stretches that do not touch each other, one resistance for all.
struct Selection {
  std::vector<Stretch> stretches;
  double ohm = 0;
  double gain = 0;  ///< of all, less the price of each
};

/// The best stretches that do not touch, each worth its price at this resistance.
Selection chosen(std::vector<Stretch> all, double ohm, std::size_t rows) {
  std::erase_if(all, [&](const Stretch& s) { return s.gain(ohm) <= thresholds.decision.per_burst; });
  std::sort(all.begin(), all.end(), [&](const Stretch& a, const Stretch& b) { return a.gain(ohm) > b.gain(ohm); });
  std::vector<char> taken(rows + 1, 0);
  Selection best{{}, ohm, 0};
  for (const Stretch& s : all) {
    const auto from = taken.begin() + static_cast<std::ptrdiff_t>(s.first),
               to = taken.begin() + static_cast<std::ptrdiff_t>(s.end + 1);
    if (std::any_of(from, to, [](char t) { return t != 0; })) continue;
    std::fill(from, to, 1);
    best.gain += s.gain(ohm) - thresholds.decision.per_burst;
    best.stretches.push_back(s);
  }
  return best;
}

/// Probability that at least `hits` of `of` fall where a share of all is (binomial).
double probability_of_at_least(std::size_t hits, std::size_t of, double share) {
  double sum = 0;
  for (std::size_t k = hits; k <= of; ++k) {
    const double n = static_cast<double>(of), h = static_cast<double>(k);
    sum += std::exp(std::lgamma(n + 1) - std::lgamma(h + 1) - std::lgamma(n - h + 1)) * std::pow(share, h) *
           std::pow(1 - share, n - h);
  }
  return sum;
}

/// The search in one recording.
class BurstFinder {
 public:
  BurstFinder(const PreparedRecording& record, const std::vector<double>& residual_v, const Whitener& whitener)
      : record_(record), whitener_(whitener), residual_(residual_v) {
    for (double& v : residual_) v = std::abs(v) < runaway_v ? v : 0;
    whitener.whiten(0, residual_);
    for (std::size_t k = 0; k < rows(); ++k) largest_a_ = std::max(largest_a_, std::abs(current_a(k)));
    for (std::size_t k = 0; k < rows(); ++k) loaded_ += is_loaded(current_a(k)) ? 1 : 0;
  }

  std::size_t rows() const { return record_.size(); }

  /// Every stretch in which the residual asks for more (or for less) resistance by more than its price.
  std::vector<Stretch> stretches(bool more) {
    std::vector<Stretch> found;
    for (const std::size_t length : burst_limits.lengths_rows) {
      const std::size_t step = std::max<std::size_t>(1, length / burst_limits.overlap);
      for (std::size_t first = 0; first + length < rows(); first += step) {
        Stretch s = stretch(first, first + length);
        if (!more) s.toward = -s.toward;
        if (s.toward > 0 && s.toward * s.toward > thresholds.decision.per_burst * s.size) found.push_back(s);
      }
    }
    return found;
  }

  /// The selection that gains most, tried from several resistances.
  Selection best_of(const std::vector<Stretch>& all) const {
    std::vector<double> sizes_ohm;
    for (const Stretch& s : all) sizes_ohm.push_back(s.toward / s.size);
    std::sort(sizes_ohm.begin(), sizes_ohm.end());
    Selection best;
    for (const double share : burst_limits.resistance_quantiles) {
      double ohm = sizes_ohm[static_cast<std::size_t>(share * static_cast<double>(sizes_ohm.size() - 1))];
      for (int round = 0; round < numerics.bursts.resistance_rounds; ++round) {
        const Selection here = chosen(all, ohm, rows());
        if (here.gain > best.gain) best = here;
        double toward = 0, size = 0;
        for (const Stretch& s : here.stretches) {
          toward += s.toward;
          size += s.size;
        }
        if (!(size > 0)) break;
        ohm = toward / size;
      }
    }
    return best;
  }

  /// Where each begins and ends, to the row, and the resistance that then fits best.
  void refine(Selection& selection) {
    for (int round = 0; round < numerics.bursts.edge_rounds; ++round) {
      double toward = 0, size = 0;
      for (Stretch& s : selection.stretches) {
        while (improve_end(s, selection.ohm)) {
        }
        toward += s.toward;
        size += s.size;
      }
      selection.ohm = toward / size;
    }
  }

  /// More than a bad reading, less than a contact that is open most of the time.
  bool has_plausible_extent(const Selection& selection) const {
    std::size_t inside = 0;
    for (const Stretch& s : selection.stretches) inside += s.end - s.first;
    return inside >= burst_limits.fewest_rows &&
           static_cast<double>(inside) <= burst_limits.loaded_share * static_cast<double>(loaded_);
  }

  /// A contact opens at any time. What comes with the steps of the current is how the cell answers them.
  bool comes_with_edges(const Selection& selection) const {
    std::vector<char> near_edge(rows(), 0);
    constexpr std::size_t reach = burst_limits.near_edge_rows;
    for (std::size_t k = 1; k < rows(); ++k) {
      if (std::abs(current_a(k) - current_a(k - 1)) < burst_limits.edge_current * largest_a_) continue;
      for (std::size_t j = k > reach ? k - reach : 0; j < std::min(rows(), k + reach); ++j) near_edge[j] = 1;
    }
    double loaded_near = 0;
    for (std::size_t k = 0; k < rows(); ++k) loaded_near += near_edge[k] != 0 && is_loaded(current_a(k)) ? 1 : 0;
    std::size_t bursts_near = 0;
    for (const Stretch& s : selection.stretches) bursts_near += near_edge[(s.first + s.end) / 2] != 0 ? 1 : 0;
    const double share = loaded_near / static_cast<double>(std::max<std::size_t>(loaded_, 1));
    return probability_of_at_least(bursts_near, selection.stretches.size(), share) < burst_limits.edge_chance;
  }

  /// Takes the bursts out of the residual.
  void subtract(const Selection& selection) {
    column_.assign(rows(), 0);
    for (const Stretch& s : selection.stretches) {
      for (std::size_t k = s.first; k < s.end; ++k) column_[k] = selection.ohm * current_a(k);
    }
    whitener_.whiten(0, column_);
    for (std::size_t k = 0; k < rows(); ++k) residual_[k] -= column_[k];
  }

 private:
  double current_a(std::size_t k) const { return std::isfinite(record_.current_a[k]) ? record_.current_a[k] : 0.0; }
  bool is_loaded(double a) const { return std::abs(a) > burst_limits.loaded_current * largest_a_; }

  Stretch stretch(std::size_t first, std::size_t end) {
    Stretch s{first, end, 0, 0};
    column_.assign(std::min(end - first + burst_limits.tail_rows, rows() - first), 0);
    bool any = false;
    for (std::size_t k = 0; k < end - first; ++k) {
      column_[k] = current_a(first + k);
      any = any || is_loaded(column_[k]);
    }
    if (!any) return s;
    whitener_.whiten(first, column_);
    for (std::size_t k = 0; k < column_.size(); ++k) {
      s.toward += column_[k] * residual_[first + k];
      s.size += column_[k] * column_[k];
    }
    return s;
  }

  /// Moves an end of the stretch by one or two rows, each way in turn. Returns true if any move gained.
  bool improve_end(Stretch& s, double ohm) {
    bool moved = false;
    for (const auto& [by_first, by_end] :
         {std::pair{-1, 0}, {1, 0}, {0, -1}, {0, 1}, {-2, 0}, {2, 0}, {0, -2}, {0, 2}}) {
      const auto first = static_cast<std::ptrdiff_t>(s.first) + by_first,
                 end = static_cast<std::ptrdiff_t>(s.end) + by_end;
      if (first < 0 || end <= first || end >= static_cast<std::ptrdiff_t>(rows())) continue;
      const Stretch there = stretch(static_cast<std::size_t>(first), static_cast<std::size_t>(end));
      // not where there is no number: it would go to and fro for ever
      if (!(there.gain(ohm) > s.gain(ohm) + numerics.bursts.better)) continue;
      s = there;
      moved = true;
    }
    return moved;
  }

  const PreparedRecording& record_;
  const Whitener& whitener_;
  std::vector<double> residual_;  ///< white
  std::vector<double> column_;    ///< reused
  double largest_a_ = 0;
  std::size_t loaded_ = 0;  ///< rows with load
};

std::vector<model::Span> spans_of(Selection selection, std::span<const double> time_s) {
  std::sort(selection.stretches.begin(), selection.stretches.end(),
            [](const Stretch& a, const Stretch& b) { return a.first < b.first; });
  std::vector<model::Span> spans;
  for (const Stretch& s : selection.stretches) {
    if (!spans.empty() && time_s[s.first] <= spans.back().end_s)
      spans.back().end_s = std::max(spans.back().end_s, time_s[s.end - 1]);
    else
      spans.push_back({time_s[s.first], time_s[s.end - 1]});
  }
  return spans;
}

}  // namespace

std::vector<model::Span> find_bursts(const PreparedRecording& record, const std::vector<double>& residual_v,
                                     const Whitener& whitener, double& found_ohm) {
  BurstFinder finder(record, residual_v, whitener);
  const std::vector<Stretch> all = finder.stretches(true);
  if (all.empty()) return {};
  Selection best = finder.best_of(all);
  if (best.stretches.empty()) return {};
  finder.refine(best);
  if (!finder.has_plausible_extent(best) || finder.comes_with_edges(best)) return {};
  // the control: what then still asks for less resistance, as chance does as often for more
  finder.subtract(best);
  const Selection control = chosen(finder.stretches(false), best.ohm, finder.rows());
  if (best.gain < burst_limits.control_times * control.gain + thresholds.decision.detected) return {};
  found_ohm = best.ohm;
  return spans_of(std::move(best), record.time_s);
}

BurstSearch find_bursts(const LikelihoodModel& likelihood, const HypothesisFit& around) {
  const MechanismSetting* changed = around.hypothesis.find(Signature::contact_change);
  BurstSearch all;
  all.column = Columns::Zero(static_cast<Eigen::Index>(likelihood.samples()), 1);
  Eigen::Index row = 0;
  for (std::size_t r = 0; r < likelihood.records().size(); ++r) {
    const PreparedRecording& record = likelihood.records()[r];
    std::vector<double> error_v = likelihood.voltage(around.hypothesis, around.calibration, r);
    for (std::size_t k = 0; k < error_v.size(); ++k) error_v[k] = record.voltage_v[k] - error_v[k];
    double found_ohm = 0;
    std::vector<model::Span>& spans =
        all.spans.emplace_back(find_bursts(record, error_v, likelihood.whitener(r), found_ohm));
    // where a contact has changed for good, the rows around that moment are not a burst
    if (changed != nullptr) {
      const double onset_s = changed->value[contact_onset], near_s = thresholds.screening.near_onset_s;
      std::erase_if(spans,
                    [&](const model::Span& s) { return s.end_s > onset_s - near_s && s.start_s < onset_s + near_s; });
    }
    all.count += spans.size();
    all.resistance_ohm = std::max(all.resistance_ohm, found_ohm);
    std::size_t next = 0;
    for (std::size_t k = 0; k < record.size(); ++k, ++row) {
      while (next < spans.size() && record.time_s[k] > spans[next].end_s) ++next;
      if (next < spans.size() && record.time_s[k] >= spans[next].start_s && std::isfinite(record.current_a[k]))
        all.column(row, 0) = record.current_a[k];
    }
    for (const model::Span& s : spans) all.covered_s += s.end_s - s.start_s;
  }
  return all;
}

}  // namespace bms::diagnosis
