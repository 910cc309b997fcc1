#include "diagnosis/pack/current_sign.hpp"

#include <algorithm>
#include <cmath>

#include "diagnosis/pack/pack_recording.hpp"
#include "diagnosis/pack/pack_thresholds.hpp"
#include "measurement/statistics.hpp"

namespace bms::diagnosis::pack {

namespace {

constexpr const PackThresholds::Sign& of_sign = limits.sign;

struct Relation {
  double correlation = 0;  ///< of changes of the voltage and of the current
  double against = 0;      ///< share of changes in which they have different signs
  std::size_t changes = 0;
};

/// v: of a cell, `late` rows after the current.
Relation changes_of(std::span<const double> current_a, const std::vector<double>& v, std::size_t late, double quiet_a) {
  double product = 0, vv = 0, ii = 0, against = 0;
  Relation r;
  for (std::size_t k = 1; k + late < v.size(); ++k) {
    const double di = current_a[k] - current_a[k - 1], dv = v[k + late] - v[k + late - 1];
    if (!(std::abs(di) > quiet_a) || !std::isfinite(dv)) continue;
    product += di * dv;
    vv += dv * dv;
    ii += di * di;
    against += di * dv < 0 ? 1 : 0;
    ++r.changes;
  }
  if (vv > 0 && ii > 0) r.correlation = product / std::sqrt(vv * ii);
  if (r.changes > 0) r.against = against / static_cast<double>(r.changes);
  return r;
}

/// At the delay with the closest relation, up to so many rows.
Relation closest_changes(std::span<const double> current_a, const std::vector<double>& v, std::size_t most_rows_late,
                         double quiet_a) {
  Relation best;
  for (std::size_t late = 0; late <= most_rows_late; ++late) {
    const Relation r = changes_of(current_a, v, late, quiet_a);
    if (std::abs(r.correlation) > std::abs(best.correlation)) best = r;
  }
  return best;
}

/// Means of so many rows, of those that are known.
std::vector<double> joined(std::span<const double> column, std::size_t rows) {
  std::vector<double> means;
  for (std::size_t from = 0; from + rows <= column.size(); from += rows) {
    double sum = 0, count = 0;
    for (const double value : column.subspan(from, rows)) {
      if (!std::isfinite(value)) continue;
      sum += value;
      ++count;
    }
    means.push_back(count > 0 ? sum / count : no_value);
  }
  return means;
}

/// A load that is switched within a row goes up where its mean goes down as often as not. So the relation must hold for
/// slow changes as well: of the means of some rows.
Relation relation_of(std::span<const double> current_a, const std::vector<double>& v, double quiet_a) {
  Relation relation = closest_changes(current_a, v, of_sign.most_rows_late, quiet_a);
  for (const std::size_t rows : of_sign.joined_rows) {
    if (relation.correlation >= 0) break;
    const Relation slow =
        closest_changes(joined(current_a, rows), joined(v, rows), of_sign.most_rows_late / rows, quiet_a);
    relation.correlation = std::max(relation.correlation, slow.correlation);
  }
  return relation;
}

}  // namespace

std::optional<PackFinding> reversed_current(std::span<const double> current_a,
                                            const std::vector<std::vector<double>>& cell_v, double quiet_a) {
  std::vector<double> correlations, shares;
  for (const std::vector<double>& v : cell_v) {
    const Relation r = relation_of(current_a, v, quiet_a);
    if (r.changes < of_sign.least_changes) continue;
    correlations.push_back(r.correlation);
    shares.push_back(r.against);
  }
  if (2 * correlations.size() < cell_v.size() || correlations.empty()) return std::nullopt;
  // a quarter of the cells may have faulty channels
  if (measurement::quantile(correlations, of_sign.share_of_cells) > -of_sign.least_correlation) return std::nullopt;
  PackFinding f;
  f.cause = Cause::current_sign;
  f.value = measurement::median(shares);
  f.probability = 1;
  return f;
}

}  // namespace bms::diagnosis::pack
