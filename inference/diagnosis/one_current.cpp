#include "diagnosis/one_current.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "diagnosis/testability.hpp"
#include "diagnosis/thresholds.hpp"
#include "measurement/statistics.hpp"

namespace bms::diagnosis {

namespace {

constexpr const Thresholds::Facts& current_limits = thresholds.facts;

template <class... M>
constexpr std::array<std::size_t, sizeof...(M)> indices = {model::mechanism_index_of<M>...};

/// Each changes the charge that is counted, the drop of the voltage, or both.
constexpr auto alike_at_one_current =
    indices<model::CurrentGain, model::CurrentOffset, model::CurrentClipping, model::CapacityChange,
            model::ResistanceGrowth, model::PolarisationGrowth, model::SlowPolarisation, model::TemperatureResistance,
            model::ChargeTransfer>;

bool contains(const std::vector<std::size_t>& list, std::size_t m) {
  return std::find(list.begin(), list.end(), m) != list.end();
}

/// What the sensor may read in rests, which its offset moves, and the reading of the load to the other side: the median
/// of the small readings; and, for an offset that is no longer small compared with the load, those of the upper and of
/// the lower half of the range.
std::vector<double> rest_readings_a(const std::vector<PreparedRecording>& records, double largest_a,
                                    double capacity_ah) {
  double low_a = std::numeric_limits<double>::infinity(), high_a = -low_a;
  for (const PreparedRecording& r : records) {
    for (const double a : r.current_a) {
      if (!std::isfinite(a)) continue;
      low_a = std::min(low_a, a);
      high_a = std::max(high_a, a);
    }
  }
  std::vector<double> small_a, upper_a, lower_a;
  for (const PreparedRecording& r : records) {
    for (const double a : r.current_a) {
      if (std::abs(a) < rest_at_one_current * largest_a) small_a.push_back(a);
      if (std::isfinite(a)) (a > (low_a + high_a) / 2 ? upper_a : lower_a).push_back(a);
    }
  }
  std::vector<double> rests_a = {small_a.empty() ? 0 : measurement::upper_median(small_a)};
  const double most_a = model::CurrentOffset::parameters[0].upper(capacity_ah);
  for (const std::vector<double>* half_a : {&upper_a, &lower_a}) {
    if (half_a->empty()) continue;
    const double rest_a = measurement::upper_median(*half_a);
    if (std::abs(rest_a) <= most_a) rests_a.push_back(rest_a);
  }
  return rests_a;
}

/// Returns true if all load has one current, if the sensor reads this much in rests.
bool has_one_current(const std::vector<PreparedRecording>& records, double largest_a, double rest_a) {
  std::vector<double> loaded_a;
  for (const PreparedRecording& r : records) {
    for (const double a : r.current_a) {
      if (std::abs(a - rest_a) > loaded_at_one_current * largest_a) loaded_a.push_back(a);
    }
  }
  if (loaded_a.empty()) return false;
  const double usual_a = measurement::upper_median(loaded_a);
  const auto near = std::count_if(loaded_a.begin(), loaded_a.end(), [&](double a) {
    return std::abs(a - usual_a) <= current_limits.one_current_within * std::abs(usual_a - rest_a);
  });
  return static_cast<double>(near) >= current_limits.one_current_share * static_cast<double>(loaded_a.size());
}

}  // namespace

bool has_one_current(const std::vector<PreparedRecording>& records, double capacity_ah) {
  double largest_a = current_limits.moving_c * capacity_ah / loaded_at_one_current;
  for (const PreparedRecording& r : records) {
    for (const double a : r.current_a) largest_a = std::isfinite(a) ? std::max(largest_a, std::abs(a)) : largest_a;
  }
  std::size_t edges = 0;
  for (const PreparedRecording& r : records) {
    for (std::size_t k = 1; k < r.size(); ++k)
      edges += std::abs(r.current_a[k] - r.current_a[k - 1]) > current_limits.edge_c * capacity_ah ? 1 : 0;
  }
  if (edges > current_limits.one_current_edges) return false;
  const std::vector<double> rests_a = rest_readings_a(records, largest_a, capacity_ah);
  return std::any_of(rests_a.begin(), rests_a.end(),
                     [&](double rest_a) { return has_one_current(records, largest_a, rest_a); });
}

void add_alike_at_one_current(Search& search, const LikelihoodModel& likelihood, const HypothesisFit& best,
                              std::vector<Finding>& findings) {
  if (!has_one_current(likelihood.records(), likelihood.cell().capacity_ah)) return;
  const Hypothesis base = likelihood.base();
  std::vector<std::size_t> found;
  for (const Finding& f : findings) found.push_back(f.setting.index);
  for (Finding& f : findings) {
    if (std::find(alike_at_one_current.begin(), alike_at_one_current.end(), f.setting.index) ==
        alike_at_one_current.end())
      continue;
    std::vector<std::size_t> alike;
    for (const std::size_t m : alike_at_one_current) {
      if (!contains(found, m) && !contains(f.equivalent_to, m) && base.find(m) == nullptr &&
          !reads_trusted(likelihood.facts().trusted_current, likelihood.facts().trusted_voltage, m))
        alike.push_back(m);
    }
    f.probability /= static_cast<double>(1 + alike.size());  // none is more probable than another
    for (HypothesisFit& fit : search.replaced(best, f.setting.index, alike)) {
      const std::size_t m = fit.hypothesis.settings.back().index;
      std::erase(alike, m);
      f.equivalent_to.push_back(m);
      f.rivals.push_back({std::move(fit.hypothesis), std::move(fit.covariance)});
    }
    // those that these recordings cannot test have no fit
    f.equivalent_to.insert(f.equivalent_to.end(), alike.begin(), alike.end());
  }
}

}  // namespace bms::diagnosis
