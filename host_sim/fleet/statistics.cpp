#include "fleet/statistics.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace bms::fleet {

namespace {

constexpr double far_sigmas = 2;  ///< from a line, from which on a reading counts less
constexpr std::size_t fewest_after =
    4;  ///< readings after an onset: of fewer, a single one that is far off would make a line
constexpr double own_share = 0.5;  ///< of the stated sigmas that is at least not common to all readings

double log_beta(double a, double b) { return std::lgamma(a) + std::lgamma(b) - std::lgamma(a + b); }

double log_choose(double n, double k) { return std::lgamma(n + 1) - std::lgamma(k + 1) - std::lgamma(n - k + 1); }

/// Straight line or constant through points after a day. A reading that is far off counts in proportion to its
/// distance, not to the square of it (Huber 1964): one bad day must not hide a change, nor make one.
struct HingeFit {
  double before = 0, per_day = 0, cost = std::numeric_limits<double>::infinity();
  double at(double since) const { return before + per_day * since; }
};

HingeFit weighted_hinge(const std::vector<Reading>& readings, const std::vector<double>& weight, double onset) {
  double w = 0, x = 0, y = 0, xx = 0, xy = 0;
  for (std::size_t k = 0; k < readings.size(); ++k) {
    const double since = std::max(0.0, readings[k].day - onset), value = readings[k].value;
    w += weight[k];
    x += weight[k] * since;
    y += weight[k] * value;
    xx += weight[k] * since * since;
    xy += weight[k] * since * value;
  }
  HingeFit fit;
  const double spread = xx - x * x / w;
  fit.per_day = spread > 0 ? (xy - x * y / w) / spread : 0;
  fit.before = (y - fit.per_day * x) / w;
  return fit;
}

HingeFit hinge_at(const std::vector<Reading>& readings, const std::vector<double>& weight, double onset) {
  constexpr int rounds = 12;
  std::vector<double> now = weight;
  HingeFit fit;
  for (int round = 0; round < rounds; ++round) {
    fit = weighted_hinge(readings, now, onset);
    fit.cost = 0;
    for (std::size_t k = 0; k < readings.size(); ++k) {
      const double since = std::max(0.0, readings[k].day - onset);
      const double sigmas = std::sqrt(weight[k]) * std::abs(readings[k].value - fit.at(since));
      const bool is_far = sigmas > far_sigmas;
      fit.cost += is_far ? far_sigmas * (2 * sigmas - far_sigmas) : sigmas * sigmas;
      now[k] = is_far ? weight[k] * far_sigmas / sigmas : weight[k];
    }
  }
  return fit;
}

double log_likelihood(std::size_t happened, std::size_t of) {
  const double n = static_cast<double>(of), k = static_cast<double>(happened);
  const double rate = (k + 0.1) / (n + 0.2);
  return k * std::log(rate) + (n - k) * std::log(1 - rate);
}

}  // namespace

double median(std::vector<double> values) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  if (values.size() % 2 == 1) return *middle;
  return (*middle + *std::max_element(values.begin(), middle)) / 2;
}

double false_alarm_probability(std::size_t count, std::size_t trials, double mean, double correlation) {
  if (count == 0) return 1;
  const double sum = (1 - correlation) / correlation, a = mean * sum, b = (1 - mean) * sum;
  const double n = static_cast<double>(trials);
  double tail = 0;
  for (std::size_t k = count; k <= trials; ++k) {
    const double x = static_cast<double>(k);
    tail += std::exp(log_choose(n, x) + log_beta(x + a, n - x + b) - log_beta(a, b));
  }
  return std::min(1.0, tail);
}

std::vector<double> false_discovery_rates(const std::vector<double>& p_values, std::size_t tests) {
  std::vector<std::size_t> order(p_values.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return p_values[a] < p_values[b]; });
  std::vector<double> rates(p_values.size(), 1);
  double least = 1;
  for (std::size_t rank = order.size(); rank-- > 0;) {
    least = std::min(least, p_values[order[rank]] * static_cast<double>(tests) / static_cast<double>(rank + 1));
    rates[order[rank]] = least;
  }
  return rates;
}

std::optional<Mean> mean_of(const std::vector<Reading>& readings) {
  if (readings.size() < fewest_readings) return std::nullopt;
  double w = 0, y = 0;
  for (const Reading& r : readings) {
    w += 1 / (r.sigma * r.sigma);
    y += r.value / (r.sigma * r.sigma);
  }
  const double mean = y / w;
  double cost = 0;
  for (const Reading& r : readings) cost += std::pow((r.value - mean) / r.sigma, 2);
  const double dispersion = std::max(own_share * own_share, cost / static_cast<double>(readings.size() - 1));
  return Mean{mean, std::sqrt(dispersion / w)};
}

std::optional<Trend> trend_of(const std::vector<Reading>& readings) {
  if (readings.size() < fewest_readings) return std::nullopt;
  double w = 0, x = 0, y = 0, least_sigma = std::numeric_limits<double>::infinity();
  for (const Reading& r : readings) {
    const double weight = 1 / (r.sigma * r.sigma);
    w += weight;
    x += weight * r.day;
    y += weight * r.value;
    least_sigma = std::min(least_sigma, r.sigma);
  }
  Trend trend{x / w, y / w, 0, 0, 0};
  double spread = 0, product = 0, first = trend.middle, last = trend.middle;
  for (const Reading& r : readings) {
    const double weight = 1 / (r.sigma * r.sigma), since = r.day - trend.middle;
    spread += weight * since * since;
    product += weight * since * r.value;
    first = std::min(first, r.day);
    last = std::max(last, r.day);
  }
  if (last - first < shortest_days) return std::nullopt;
  trend.per_day = product / spread;
  double cost = 0;
  for (const Reading& r : readings) cost += std::pow((r.value - trend.at(r.day)) / r.sigma, 2);
  const double dispersion = std::max(own_share * own_share, cost / static_cast<double>(readings.size() - 2));
  trend.per_day_sigma = std::sqrt(dispersion / spread);
  trend.level_sigma = std::max(least_sigma, std::sqrt(dispersion / w));
  return trend;
}

std::optional<Crossing> crossing_of(const Trend& t, double limit, double most_days) {
  const double left = limit - t.level;
  if (left <= 0 || t.per_day < 3 * t.per_day_sigma || t.per_day <= 0) return std::nullopt;
  const auto after = [&](double distance, double per_day) { return t.middle + std::max(0.0, distance) / per_day; };
  Crossing c;
  c.day = after(left, t.per_day);
  if (c.day > t.middle + most_days) return std::nullopt;
  c.earliest = after(left - t.level_sigma, t.per_day + t.per_day_sigma);
  const double latest = after(left + t.level_sigma, t.per_day - t.per_day_sigma);
  if (latest < t.middle + most_days) c.latest = latest;
  return c;
}

Outlook outlook_of(const std::vector<Reading>& readings, const std::optional<Trend>& trend, double limit,
                   double most_days) {
  const Reading& last = readings.back();
  if ((trend ? trend->at(last.day) : last.value) >= limit) return Outlook::reached;
  if (readings.size() < fewest_readings) return Outlook::few_readings;
  if (!trend) return Outlook::short_time;
  if (crossing_of(*trend, limit, most_days)) return Outlook::forecast;
  return trend->per_day > 0 && trend->per_day >= 3 * trend->per_day_sigma ? Outlook::far : Outlook::no_slope;
}

std::optional<Onset> onset_of(const std::vector<Reading>& readings, double scatter) {
  constexpr std::size_t fewest = 5;
  if (readings.size() < fewest) return std::nullopt;
  std::vector<double> weight;
  for (const Reading& r : readings) weight.push_back(1 / (scatter * scatter + r.sigma * r.sigma));
  const HingeFit constant = hinge_at(readings, weight, readings.back().day + 1);
  HingeFit best;
  Onset onset;
  for (std::size_t k = 0; k + fewest_after < readings.size(); ++k) {
    const HingeFit fit = hinge_at(readings, weight, readings[k].day - (k == 0 ? 1 : 0));
    if (fit.cost >= best.cost) continue;
    best = fit;
    onset = {readings[k + (k == 0 ? 0 : 1)].day, fit.per_day, fit.before, 1};
  }
  // what is left around the hinge may be more than the scatter: over-dispersion
  const double freedom = static_cast<double>(readings.size()) - 3;
  const double dispersion = std::max(1.0, best.cost / std::max(1.0, freedom));
  const double gain = (constant.cost - best.cost) / dispersion;
  onset.p_value = std::min(1.0, static_cast<double>(readings.size()) * std::erfc(std::sqrt(std::max(0.0, gain) / 2)));
  return onset;
}

std::size_t first_of_many(const std::vector<bool>& happened) {
  const auto all = static_cast<std::size_t>(std::count(happened.begin(), happened.end(), true));
  if (all == 0) return happened.size();
  std::size_t before = 0, best = 0;
  double most = -std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < happened.size(); ++k) {
    const std::size_t after = all - before, later = happened.size() - k;
    const bool more = after * happened.size() >= all * later;
    const double likelihood = log_likelihood(before, k) + log_likelihood(after, later);
    if (happened[k] && more && likelihood > most) {
      most = likelihood;
      best = k;
    }
    before += happened[k] ? 1 : 0;
  }
  return best;
}

double false_alarm_probability(const std::vector<bool>& happened, double mean, double correlation) {
  const std::size_t first = first_of_many(happened);
  if (first == happened.size()) return 1;
  const auto count = [](auto from, auto to) { return static_cast<std::size_t>(std::count(from, to, true)); };
  const double in_all =
      false_alarm_probability(count(happened.begin(), happened.end()), happened.size(), mean, correlation);
  const auto since = happened.begin() + static_cast<std::ptrdiff_t>(first);
  const double since_then =
      false_alarm_probability(count(since, happened.end()), happened.size() - first, mean, correlation);
  return std::min(1.0, 2 * std::min(in_all, static_cast<double>(happened.size()) * since_then));
}

}  // namespace bms::fleet
