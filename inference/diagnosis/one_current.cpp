#include "diagnosis/one_current.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <iterator>
#include <limits>
#include <utility>

#include "diagnosis/testability.hpp"
#include "diagnosis/thresholds.hpp"
#include "measurement/statistics.hpp"

namespace bms::diagnosis {

namespace {

constexpr const Thresholds::Facts& current_limits = thresholds.facts;

template <class... M>
constexpr std::array<std::size_t, sizeof...(M)> indices = {model::mechanism_index_of<M>...};

/// What changes the counted charge, and what changes the drop of the voltage alone.
constexpr auto of_charge =
    indices<model::CurrentGain, model::CurrentOffset, model::CurrentClipping, model::CapacityChange>;
constexpr auto of_drop =
    indices<model::ResistanceGrowth, model::PolarisationGrowth, model::SlowPolarisation, model::TemperatureResistance>;

template <class List>
bool contains(const List& list, std::size_t m) {
  return std::find(list.begin(), list.end(), m) != list.end();
}

/// What the sensor may read in rests, which its offset moves, and the reading of the load to the other side: the median
/// of the small readings; and, for an offset that is no longer small compared with the load, those of the upper and of
/// the lower half of the range.
std::vector<double> rest_readings_a(std::span<const PreparedRecording> records, double largest_a, double capacity_ah) {
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
bool has_one_current(std::span<const PreparedRecording> records, double largest_a, double rest_a) {
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

/// others: may equal the finding. fits: with those of them that can be tested in its place, as the last mechanism;
/// behind: of such a fit, as in weight_behind().
void add_alike(Finding& f, std::vector<std::size_t> others, std::vector<HypothesisFit> fits,
               const std::function<double(const HypothesisFit&)>& behind) {
  struct Fitted {
    std::size_t mechanism;
    double behind;
    bool as_good() const { return behind < thresholds.decision.tie_inseparable; }
  };
  std::vector<Fitted> fitted;
  for (const HypothesisFit& fit : fits) fitted.push_back({fit.hypothesis.settings.back().index, behind(fit)});
  const std::size_t m = f.setting.index;
  const auto stands = [&](const auto& kind) {
    return contains(kind, m) || std::any_of(fitted.begin(), fitted.end(), [&](const Fitted& other) {
             return other.as_good() && contains(kind, other.mechanism);
           });
  };
  const bool charge = stands(of_charge), drop = stands(of_drop);
  double weights = thresholds.probability.at_most / f.probability;
  for (std::size_t k = 0; k < fits.size(); ++k) {
    const std::size_t other = fitted[k].mechanism;
    std::erase(others, other);
    if (!(contains(of_charge, other) ? charge : fitted[k].as_good())) continue;
    weights += contains(of_charge, other) && contains(of_charge, m) ? 1 : weight_behind(fitted[k].behind);
    f.equivalent_to.push_back(other);
    f.rivals.push_back({std::move(fits[k].hypothesis), std::move(fits[k].covariance)});
  }
  // without a fit, as these recordings cannot test it: it does what others of its kind do
  for (const std::size_t other : others) {
    if (!(contains(of_charge, other) ? charge : drop)) continue;
    weights += 1;
    f.equivalent_to.push_back(other);
  }
  f.probability = thresholds.probability.at_most / weights;
}

}  // namespace

bool has_one_current(std::span<const PreparedRecording> records, double capacity_ah) {
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
                              const HealthyGain& healthy_gain, std::vector<Finding>& findings) {
  if (!likelihood.facts().one_current) return;
  const Hypothesis base = likelihood.base();
  std::vector<std::size_t> found;
  for (const Finding& f : findings) found.push_back(f.setting.index);
  for (Finding& f : findings) {
    const std::size_t m = f.setting.index;
    if (!contains(of_charge, m) && !contains(of_drop, m)) continue;
    std::vector<std::size_t> others;
    const auto add = [&](const auto& kind) {
      std::copy_if(kind.begin(), kind.end(), std::back_inserter(others), [&](std::size_t other) {
        return !contains(found, other) && !contains(f.equivalent_to, other) && base.find(other) == nullptr &&
               !reads_trusted(likelihood.facts().trusted_current, likelihood.facts().trusted_voltage, other);
      });
    };
    add(of_charge);
    add(of_drop);
    const double times = model_error_times(healthy_gain, m);
    add_alike(f, others, search.replaced(best, m, others),
              [&](const HypothesisFit& fit) { return std::max(search.score(fit) - search.score(best), 0.0) / times; });
  }
}

}  // namespace bms::diagnosis
