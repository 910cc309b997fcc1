#include "diagnosis/locate.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace bms::diagnosis {

namespace {

double squared_error(const LikelihoodModel& evidence, const Hypothesis& h, const Eigen::VectorXd& u,
                     std::size_t& count) {
  double sum = 0;
  count = 0;
  for (std::size_t r = 0; r < evidence.records().size(); ++r) {
    const std::vector<double> v = evidence.voltage(h, u, r);
    for (std::size_t k = 0; k < v.size(); ++k) {
      if (evidence.usable(r)[k] == 0) continue;
      const double e = evidence.records()[r].voltage_v[k] - v[k];
      sum += e * e;
      ++count;
    }
  }
  return sum;
}

}  // namespace

Contributions contributions(const LikelihoodModel& evidence, const HypothesisFit& base, const HypothesisFit& fit) {
  Contributions c;
  const std::vector<std::size_t> added = fit.hypothesis.added();
  std::size_t count = 0;
  const double before = squared_error(evidence, base.hypothesis, base.calibration, count),
               after = squared_error(evidence, fit.hypothesis, fit.calibration, count);
  const double white = evidence.noise().white_v * evidence.noise().white_v * static_cast<double>(count);
  c.explained_share = before > white ? std::clamp((before - after) / (before - white), 0.0, 1.0) : 0;
  c.remaining_rmse_v = count > 0 ? std::sqrt(after / static_cast<double>(count)) : 0;
  if (added.empty()) return c;
  Hypothesis none = fit.hypothesis;
  for (const std::size_t m : added) none = without(none, m);
  for (std::size_t r = 0; r < evidence.records().size(); ++r) {
    const std::vector<double> with_all = evidence.voltage(fit.hypothesis, fit.calibration, r),
                              with_none = evidence.voltage(none, fit.calibration, r);
    std::vector<double>& energy = c.energy.emplace_back(with_all.size());
    for (std::size_t k = 0; k < with_all.size(); ++k)
      energy[k] = (with_all[k] - with_none[k]) * (with_all[k] - with_none[k]);
    for (const std::size_t m : added) {
      const std::vector<double> less = evidence.voltage(without(fit.hypothesis, m), fit.calibration, r);
      for (std::size_t k = 0; k < less.size(); ++k) c.rms_v[m] += (with_all[k] - less[k]) * (with_all[k] - less[k]);
    }
  }
  for (auto& [m, sum] : c.rms_v) sum = std::sqrt(sum / static_cast<double>(evidence.readings()));
  c.spans = strongest_spans(evidence.records().front(), c.energy.front());
  return c;
}

std::vector<model::Span> strongest_spans(const PreparedRecording& r, const std::vector<double>& energy) {
  std::vector<double> sorted = energy;
  std::sort(sorted.begin(), sorted.end());
  if (sorted.empty() || !(sorted.back() > 0)) return {};
  const double most = sorted[sorted.size() - 1 - sorted.size() / 500];
  const double enough = most / 25, apart_s = 0.1 * r.duration_s();
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

std::vector<Regime> regimes(const LikelihoodModel& evidence, const HypothesisFit& fit,
                            const std::vector<std::vector<double>>& energy) {
  struct Axis {
    std::string name;
    std::vector<double> value;
  };
  std::vector<Axis> axes = {{"soc", {}}, {"current_c", {}}, {"temperature_c", {}}, {"since_edge_s", {}}};
  std::vector<double> weight;
  for (std::size_t n = 0; n < energy.size(); ++n) {
    const PreparedRecording& r = evidence.records()[n];
    std::vector<double> soc;
    evidence.voltage(fit.hypothesis, fit.calibration, n, &soc);
    double known_a = 0, edge_s = r.time_s.front();
    for (std::size_t k = 0; k < r.size(); ++k) {
      const double before_a = known_a;
      if (std::isfinite(r.current_a[k])) known_a = r.current_a[k];
      if (std::abs(known_a - before_a) > 0.1 * evidence.cell().capacity_ah) edge_s = r.time_s[k];
      axes[0].value.push_back(soc[k]);
      axes[1].value.push_back(known_a / evidence.cell().capacity_ah);
      axes[2].value.push_back(r.temperature_c.empty() ? std::nan("") : r.temperature_c[k]);
      axes[3].value.push_back(r.time_s[k] - edge_s);
      weight.push_back(energy[n][k]);
    }
  }
  std::vector<Regime> found;
  double total = 0;
  for (const double w : weight) total += w;
  if (!(total > 0)) return found;
  for (const Axis& axis : axes) {
    double low = 1e300, high = -1e300;
    for (const double v : axis.value) {
      if (std::isfinite(v)) low = std::min(low, v), high = std::max(high, v);
    }
    if (!(high > low)) continue;
    constexpr std::size_t bins = 40;
    std::array<double, bins> part{}, time{};
    for (std::size_t k = 0; k < weight.size(); ++k) {
      if (!std::isfinite(axis.value[k])) continue;
      const auto bin = static_cast<std::size_t>(std::min((axis.value[k] - low) / (high - low) * bins, bins - 1.0));
      part[bin] += weight[k] / total;
      time[bin] += 1.0 / static_cast<double>(weight.size());
    }
    Regime best{axis.name, low, high, 1, 1};
    double sharpest = 1;
    for (std::size_t a = 0; a < bins; ++a) {
      double share = 0, usual = 0;
      for (std::size_t b = a; b < bins; ++b) {
        share += part[b];
        usual += time[b];
        if (share < 0.7) continue;
        if (usual > 0 && share / usual > sharpest) {
          sharpest = share / usual;
          best = {axis.name, low + (high - low) * static_cast<double>(a) / bins,
                  low + (high - low) * static_cast<double>(b + 1) / bins, share, usual};
        }
        break;
      }
    }
    if (sharpest > 1.25) found.push_back(best);
  }
  std::stable_sort(found.begin(), found.end(),
                   [](const Regime& a, const Regime& b) { return a.share / a.usual > b.share / b.usual; });
  return found;
}

}  // namespace bms::diagnosis
