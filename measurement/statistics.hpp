// Statistics of a list of values, for the host. NaN is a missing value and is left out.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <vector>

namespace bms::measurement {

/// Value of this rank; rank 0 is the smallest value, rank < values.size(). No NaN. Reorders the values. O(n).
inline double order_statistic(std::span<double> values, std::size_t rank) {
  const auto nth = values.begin() + static_cast<std::ptrdiff_t>(rank);
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

/// The element at index floor(fraction * n) of the n sorted values, 0 <= fraction < 1. NaN if there is no value.
template <class Real>
Real quantile(std::vector<Real> values, double fraction) {
  std::erase_if(values, [](Real v) { return std::isnan(v); });
  if (values.empty()) return std::numeric_limits<Real>::quiet_NaN();
  const auto index = static_cast<std::ptrdiff_t>(fraction * static_cast<double>(values.size()));
  std::nth_element(values.begin(), values.begin() + index, values.end());
  return values[static_cast<std::size_t>(index)];
}

/// The element at index n / 2 of the n sorted values: for an even n the larger one of the two in the middle. NaN if
/// there is no value.
template <class Real>
Real upper_median(const std::vector<Real>& values) {
  return quantile(values, 0.5);
}

/// For an even number of values the mean of the two in the middle. NaN if there is no value.
template <class Real>
Real median(std::vector<Real> values) {
  std::erase_if(values, [](Real v) { return std::isnan(v); });
  if (values.empty()) return std::numeric_limits<Real>::quiet_NaN();
  std::sort(values.begin(), values.end());
  const std::size_t half = values.size() / 2;
  return values.size() % 2 == 1 ? values[half] : (values[half - 1] + values[half]) / 2;
}

/// Mean of the finite values; NaN without any.
inline double mean(std::span<const double> values) {
  double sum = 0;
  std::size_t count = 0;
  for (const double v : values) {
    if (!std::isfinite(v)) continue;
    sum += v;
    ++count;
  }
  return count > 0 ? sum / static_cast<double>(count) : std::numeric_limits<double>::quiet_NaN();
}

/// Indices of the values in groups, ascending by value: a group contains what is at most `span` above its smallest
/// value. One group of all in their order if a value is missing.
inline std::vector<std::vector<std::size_t>> groups_within(std::span<const double> values, double span) {
  std::vector<std::size_t> order(values.size());
  for (std::size_t k = 0; k < order.size(); ++k) order[k] = k;
  if (std::any_of(values.begin(), values.end(), [](double v) { return std::isnan(v); })) return {order};
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return values[a] < values[b]; });
  std::vector<std::vector<std::size_t>> groups;
  for (const std::size_t k : order) {
    if (groups.empty() || values[k] - values[groups.back().front()] > span) groups.emplace_back();
    groups.back().push_back(k);
  }
  return groups;
}

/// Root mean square. 0 if there is no value.
inline double rms(std::span<const double> values) {
  double squares = 0;
  std::size_t count = 0;
  for (const double v : values) {
    if (std::isnan(v)) continue;
    squares += v * v;
    ++count;
  }
  return count > 0 ? std::sqrt(squares / static_cast<double>(count)) : 0;
}

/// Root mean square of values that are added one by one. No NaN.
class MeanSquare {
 public:
  void add(double value) {
    sum_ += value * value;
    ++count_;
  }
  std::size_t count() const { return count_; }
  double sum() const { return sum_; }  ///< of the squares
  /// 0 if there is no value.
  double root() const { return count_ > 0 ? std::sqrt(sum_ / static_cast<double>(count_)) : 0; }

 private:
  double sum_ = 0;
  std::size_t count_ = 0;
};

}  // namespace bms::measurement
