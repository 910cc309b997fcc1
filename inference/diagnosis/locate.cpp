#include "diagnosis/locate.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "diagnosis/charge_count.hpp"
#include "diagnosis/thresholds.hpp"
#include "measurement/statistics.hpp"

namespace bms::diagnosis {

namespace {

constexpr const Thresholds::Location& location_limits = thresholds.location;

/// Measured less predicted, of the usable readings.
measurement::MeanSquare error_v(const LikelihoodModel& likelihood, const HypothesisFit& fit) {
  measurement::MeanSquare error;
  for (std::size_t r = 0; r < likelihood.records().size(); ++r) {
    const std::vector<double> v = likelihood.voltage(fit.hypothesis, fit.calibration, r);
    for (std::size_t k = 0; k < v.size(); ++k) {
      if (likelihood.usable(r)[k] != 0) error.add(likelihood.records()[r].voltage_v[k] - v[k]);
    }
  }
  return error;
}

struct Axis {
  std::string name;
  std::vector<double> value;  ///< by row of all records, NaN: unknown
};

std::vector<Axis> axes_of(const LikelihoodModel& likelihood, const HypothesisFit& fit, std::size_t records) {
  Axis soc_axis{"soc", {}}, current{"current_c", {}}, temperature{"temperature_c", {}}, since_edge{"since_edge_s", {}};
  const double capacity_ah = likelihood.cell().capacity_ah;
  for (std::size_t n = 0; n < records; ++n) {
    const PreparedRecording& r = likelihood.records()[n];
    std::vector<double> soc;
    likelihood.voltage(fit.hypothesis, fit.calibration, n, &soc);
    double edge_s = r.time_s.front();
    for_each_row(r, capacity_ah, [&](const CountedRow& row) {
      if (std::abs(row.current_a - row.previous_a) > location_limits.edge_c * capacity_ah) edge_s = r.time_s[row.k];
      soc_axis.value.push_back(soc[row.k]);
      current.value.push_back(row.current_a / capacity_ah);
      temperature.value.push_back(r.temperature_c.empty() ? std::nan("") : r.temperature_c[row.k]);
      since_edge.value.push_back(r.time_s[row.k] - edge_s);
    });
  }
  return {soc_axis, current, temperature, since_edge};
}

/// The largest energy, but for single outliers.
double peak_of(std::vector<double> energy) {
  if (energy.empty()) return 0;
  return measurement::order_statistic(energy, energy.size() - 1 - energy.size() / location_limits.rows_per_outlier);
}

/// The range of an axis in which the energy is most concentrated.
std::optional<Regime> sharpest_range(const Axis& axis, const std::vector<double>& weight, double total) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const double v : axis.value) {
    if (!std::isfinite(v)) continue;
    low = std::min(low, v);
    high = std::max(high, v);
  }
  if (!(high > low)) return std::nullopt;
  constexpr std::size_t bins = numerics.grid.regime_bins;
  std::array<double, bins> energy{}, time{};
  for (std::size_t k = 0; k < weight.size(); ++k) {
    if (!std::isfinite(axis.value[k])) continue;
    const auto bin = static_cast<std::size_t>(std::min((axis.value[k] - low) / (high - low) * bins, bins - 1.0));
    energy[bin] += weight[k] / total;
    time[bin] += 1.0 / static_cast<double>(weight.size());
  }
  Regime best{axis.name, low, high, 1, 1};
  double sharpest = 1;
  for (std::size_t a = 0; a < bins; ++a) {
    double share = 0, usual = 0;
    for (std::size_t b = a; b < bins; ++b) {
      share += energy[b];
      usual += time[b];
      if (share < location_limits.regime_share) continue;
      if (usual > 0 && share / usual > sharpest) {
        sharpest = share / usual;
        best = {axis.name, low + (high - low) * static_cast<double>(a) / bins,
                low + (high - low) * static_cast<double>(b + 1) / bins, share, usual};
      }
      break;
    }
  }
  return sharpest > location_limits.regime_sharper ? std::optional(best) : std::nullopt;
}

}  // namespace

double explained_share(double error_v, double remaining_v, double white_v) {
  const double visible_v2 = error_v * error_v - white_v * white_v;
  return visible_v2 > 0 ? std::clamp((error_v * error_v - remaining_v * remaining_v) / visible_v2, 0.0, 1.0) : 0;
}

Contributions contributions(const LikelihoodModel& likelihood, const HypothesisFit& base, const HypothesisFit& fit) {
  Contributions c;
  const measurement::MeanSquare before = error_v(likelihood, base), after = error_v(likelihood, fit);
  c.explained_share = explained_share(before.root(), after.root(), likelihood.noise().white_v);
  c.remaining_rmse_v = after.root();
  const std::vector<std::size_t> added = fit.hypothesis.added();
  if (added.empty()) return c;
  Hypothesis none = fit.hypothesis;
  for (const std::size_t m : added) none = without(none, m);
  for (std::size_t r = 0; r < likelihood.records().size(); ++r) {
    const std::vector<double> with_all = likelihood.voltage(fit.hypothesis, fit.calibration, r),
                              with_none = likelihood.voltage(none, fit.calibration, r);
    std::vector<double>& energy = c.energy.emplace_back(with_all.size());
    for (std::size_t k = 0; k < with_all.size(); ++k)
      energy[k] = (with_all[k] - with_none[k]) * (with_all[k] - with_none[k]);
    for (const std::size_t m : added) {
      const std::vector<double> less = likelihood.voltage(without(fit.hypothesis, m), fit.calibration, r);
      for (std::size_t k = 0; k < less.size(); ++k) c.rms_v[m] += (with_all[k] - less[k]) * (with_all[k] - less[k]);
    }
  }
  for (auto& [m, sum] : c.rms_v) sum = std::sqrt(sum / static_cast<double>(likelihood.readings()));
  c.spans = strongest_spans(likelihood.records().front(), c.energy.front());
  return c;
}

std::vector<model::Span> strongest_spans(const PreparedRecording& r, const std::vector<double>& energy) {
  if (energy.empty() || !(*std::max_element(energy.begin(), energy.end()) > 0)) return {};
  const double enough = peak_of(energy) / location_limits.peak_over_energy,
               apart_s = location_limits.spans_apart * r.duration_s();
  std::vector<model::Span> spans;
  for (std::size_t k = 0; k < r.size(); ++k) {
    if (energy[k] < enough) continue;
    if (!spans.empty() && r.time_s[k] - spans.back().end_s <= apart_s)
      spans.back().end_s = r.time_s[k];
    else
      spans.push_back({r.time_s[k], r.time_s[k]});
  }
  return spans;
}

std::vector<Regime> regimes(const LikelihoodModel& likelihood, const HypothesisFit& fit,
                            const std::vector<std::vector<double>>& energy) {
  std::vector<double> weight;
  double total = 0;
  for (const std::vector<double>& of_record : energy) {
    for (const double e : of_record) {
      weight.push_back(e);
      total += e;
    }
  }
  std::vector<Regime> found;
  if (!(total > 0)) return found;
  for (const Axis& axis : axes_of(likelihood, fit, energy.size())) {
    if (auto regime = sharpest_range(axis, weight, total)) found.push_back(std::move(*regime));
  }
  std::stable_sort(found.begin(), found.end(),
                   [](const Regime& a, const Regime& b) { return a.share / a.usual > b.share / b.usual; });
  return found;
}

}  // namespace bms::diagnosis
