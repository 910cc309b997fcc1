#include "plant/monotone_curve.hpp"

#include <algorithm>
#include <cassert>
#include <cstddef>
#include <utility>

namespace bms::plant {

MonotoneCurve::MonotoneCurve(std::vector<Point> points) : points_(std::move(points)), slopes_(points_.size()) {
  assert(points_.size() >= 2);
  const auto width = [&](std::size_t k) { return points_[k + 1].x - points_[k].x; };
  const auto chord = [&](std::size_t k) { return (points_[k + 1].y - points_[k].y) / width(k); };
  const std::size_t last = points_.size() - 1;
  slopes_.front() = chord(0);
  slopes_.back() = chord(last - 1);
  for (std::size_t k = 1; k < last; ++k) {
    const double left = chord(k - 1), right = chord(k);
    if (left * right <= 0) continue;
    const double left_weight = width(k - 1) + 2 * width(k), right_weight = 2 * width(k - 1) + width(k);
    slopes_[k] = (left_weight + right_weight) / (left_weight / left + right_weight / right);
  }
}

double MonotoneCurve::at(double x) const {
  if (x <= points_.front().x) return points_.front().y + slopes_.front() * (x - points_.front().x);
  if (x >= points_.back().x) return points_.back().y + slopes_.back() * (x - points_.back().x);
  const auto right =
      std::upper_bound(points_.begin(), points_.end(), x, [](double value, const Point& p) { return value < p.x; });
  const auto k = static_cast<std::size_t>(right - points_.begin()) - 1;
  const Point &a = points_[k], &b = points_[k + 1];
  const double h = b.x - a.x, t = (x - a.x) / h, u = 1 - t;
  return u * u * ((1 + 2 * t) * a.y + t * h * slopes_[k]) + t * t * ((1 + 2 * u) * b.y - u * h * slopes_[k + 1]);
}

}  // namespace bms::plant
