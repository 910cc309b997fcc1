#include "identification/ocv_pieces.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "model/cell_parameters.hpp"

namespace bms::identification {

namespace {

constexpr std::array<double, 7> heights = {-0.9, -0.6, -0.3, 0, 0.3, 0.6, 0.9};  // of a corner, in allowed errors
constexpr std::size_t levels = heights.size();
constexpr double flattest = 1e-4;                                        // V per unit of SOC
constexpr double steepest = (1 - 1e-6) * model::accepted::slope_v.high;  // of a cell file
constexpr std::size_t narrowest = 2;  // grid steps; a cell file requires one at least
constexpr double error_soc = 0.002;   // allowed horizontal error of a steep part

/// The curve where it is steeper than a cell file accepts, next to empty or full, as steep as that: it is followed from
/// the middle on.
OcvCurve as_steep_as_accepted(OcvCurve curve) {
  std::vector<double>& v = curve.ocv_v;
  const auto most_v = [&](std::size_t k) { return steepest * (curve.soc[k + 1] - curve.soc[k]); };
  const std::size_t middle = v.size() / 2;
  for (std::size_t k = middle; k-- > 0;) v[k] = std::max(v[k], v[k + 1] - most_v(k));
  for (std::size_t k = middle; k + 1 < v.size(); ++k) v[k + 1] = std::min(v[k + 1], v[k] + most_v(k));
  return curve;
}

/// Allowed error [V] at each grid point.
std::vector<double> allowed_errors(const OcvCurve& curve, double error_v) {
  const std::size_t points = curve.soc.size();
  std::vector<double> allowed_v(points, error_v);
  for (std::size_t k = 1; k + 1 < points; ++k)
    allowed_v[k] = std::max(
        error_v, error_soc * (curve.ocv_v[k + 1] - curve.ocv_v[k - 1]) / (curve.soc[k + 1] - curve.soc[k - 1]));
  return allowed_v;
}

/// Sums over the curve, so that the squared error of a piece costs no loop.
class CurveSums {
 public:
  explicit CurveSums(const OcvCurve& curve) {
    const std::size_t points = curve.soc.size();
    for (std::vector<double>* sum : {&v_, &vv_, &vs_, &s_, &ss_}) sum->assign(points + 1, 0);
    for (std::size_t k = 0; k < points; ++k) {
      const double s = curve.soc[k], v = curve.ocv_v[k];
      v_[k + 1] = v_[k] + v;
      vv_[k + 1] = vv_[k] + v * v;
      vs_[k + 1] = vs_[k] + v * s;
      s_[k + 1] = s_[k] + s;
      ss_[k + 1] = ss_[k] + s * s;
    }
  }

  /// Squared error of the line offset + slope soc over the points after `from` up to `to`.
  double squares(std::size_t from, std::size_t to, double offset, double slope) const {
    const auto span = [&](const std::vector<double>& sum) { return sum[to + 1] - sum[from + 1]; };
    const double n = static_cast<double>(to - from);
    return std::max(0.0, span(vv_) - 2 * offset * span(v_) - 2 * slope * span(vs_) + n * offset * offset +
                             2 * offset * slope * span(s_) + slope * slope * span(ss_));
  }

 private:
  std::vector<double> v_, vv_, vs_, s_, ss_;
};

/// Dynamic programming over corners: every second grid point, at seven heights within the allowed error. From each
/// corner a fan of lines reaches as far as some line stays within the error all the way (Imai and Iri, 1986). The
/// fewest pieces come first, the least squared error second.
class FewestPieces {
 public:
  FewestPieces(const OcvCurve& curve, double error_v)
      : curve_(curve),
        points_(curve.soc.size()),
        allowed_v_(allowed_errors(curve, error_v)),
        sums_(curve),
        best_(points_ * levels) {
    for (std::size_t level = 0; level < levels; ++level) best_[level] = {0, 0, 0};
    for (std::size_t from = 0; from + narrowest < points_ + 1 && from < points_; from += narrowest) {
      for (std::size_t level = 0; level < levels; ++level) extend(from, level);
    }
  }

  const std::vector<double>& allowed_v() const { return allowed_v_; }

  /// The corners of the best polyline; empty if none reaches the end.
  std::optional<OcvPieces> corners() const {
    const auto last = std::min_element(best_.end() - static_cast<std::ptrdiff_t>(levels), best_.end(),
                                       [](const Best& a, const Best& b) {
                                         return a.pieces != b.pieces ? a.pieces < b.pieces : a.squares < b.squares;
                                       });
    if (last->pieces == unreached) return std::nullopt;
    OcvPieces corner_points;
    for (auto at = static_cast<std::size_t>(last - best_.begin());; at = best_[at].from) {
      corner_points.soc.push_back(curve_.soc[at / levels]);
      corner_points.ocv_v.push_back(height(at / levels, at % levels));
      corner_points.half_gap_v.push_back(curve_.half_gap_v[at / levels]);
      if (at / levels == 0) break;
    }
    std::reverse(corner_points.soc.begin(), corner_points.soc.end());
    std::reverse(corner_points.ocv_v.begin(), corner_points.ocv_v.end());
    std::reverse(corner_points.half_gap_v.begin(), corner_points.half_gap_v.end());
    return corner_points;
  }

 private:
  static constexpr int unreached = std::numeric_limits<int>::max();

  /// The best way to a corner; corners are numbered point * levels + level.
  struct Best {
    int pieces = unreached;
    double squares = 0;
    std::size_t from = 0;
  };

  double height(std::size_t point, std::size_t level) const {
    return curve_.ocv_v[point] + heights[level] * allowed_v_[point];
  }

  /// Tries all pieces that begin at a corner.
  void extend(std::size_t from, std::size_t level) {
    if (best_[from * levels + level].pieces == unreached) return;
    double lowest = flattest, highest = steepest;
    for (std::size_t to = from + 1; to < points_ && lowest <= highest; ++to) {
      const double width = curve_.soc[to] - curve_.soc[from];
      lowest = std::max(lowest, (curve_.ocv_v[to] - allowed_v_[to] - height(from, level)) / width);
      highest = std::min(highest, (curve_.ocv_v[to] + allowed_v_[to] - height(from, level)) / width);
      if (to % narrowest != 0) continue;
      for (std::size_t end = 0; end < levels; ++end) {
        const double slope = (height(to, end) - height(from, level)) / width;
        if (slope >= lowest && slope <= highest) offer(from * levels + level, to * levels + end, slope);
      }
    }
  }

  void offer(std::size_t from, std::size_t to, double slope) {
    const Best& here = best_[from];
    const double offset = height(from / levels, from % levels) - slope * curve_.soc[from / levels];
    const double squares = here.squares + sums_.squares(from / levels, to / levels, offset, slope);
    Best& there = best_[to];
    if (here.pieces + 1 < there.pieces || (here.pieces + 1 == there.pieces && squares < there.squares))
      there = {here.pieces + 1, squares, from};
  }

  const OcvCurve& curve_;
  const std::size_t points_;
  const std::vector<double> allowed_v_;
  const CurveSums sums_;
  std::vector<Best> best_;
};

}  // namespace

std::optional<OcvPieces> fewest_pieces(const OcvCurve& taken, double error_v) {
  const OcvCurve curve = as_steep_as_accepted(taken);
  const FewestPieces search(curve, error_v);
  std::optional<OcvPieces> pieces = search.corners();
  if (!pieces) return std::nullopt;
  for (std::size_t k = 0, piece = 0; k < curve.soc.size(); ++k) {
    while (piece + 2 < pieces->soc.size() && curve.soc[k] > pieces->soc[piece + 1]) ++piece;
    const double t = (curve.soc[k] - pieces->soc[piece]) / (pieces->soc[piece + 1] - pieces->soc[piece]);
    const double off_v =
        std::abs(pieces->ocv_v[piece] + t * (pieces->ocv_v[piece + 1] - pieces->ocv_v[piece]) - curve.ocv_v[k]);
    pieces->largest_error_v = std::max(pieces->largest_error_v, off_v * error_v / search.allowed_v()[k]);
  }
  return pieces;
}

void add_gap_corners(OcvPieces& pieces, const OcvCurve& curve, double error_v, std::size_t most) {
  constexpr double lowest = 0.05, highest = 0.97;
  while (pieces.soc.size() < most) {
    // the place of the largest error
    double largest_v = error_v;
    std::size_t worst = 0, before = 0;
    for (std::size_t k = 0, piece = 0; k < curve.soc.size(); ++k) {
      const double soc = curve.soc[k];
      while (piece + 2 < pieces.soc.size() && soc > pieces.soc[piece + 1]) ++piece;
      if (soc < lowest || soc > highest) continue;
      const double from = pieces.soc[piece], to = pieces.soc[piece + 1], t = (soc - from) / (to - from);
      const double off_v =
          std::abs(pieces.half_gap_v[piece] + t * (pieces.half_gap_v[piece + 1] - pieces.half_gap_v[piece]) -
                   curve.half_gap_v[k]);
      constexpr double least_distance = 0.0025;
      if (off_v > largest_v && soc - from > least_distance && to - soc > least_distance) {
        largest_v = off_v;
        worst = k;
        before = piece;
      }
    }
    if (worst == 0) return;
    const double t = (curve.soc[worst] - pieces.soc[before]) / (pieces.soc[before + 1] - pieces.soc[before]);
    const auto here = static_cast<std::ptrdiff_t>(before + 1);
    pieces.ocv_v.insert(pieces.ocv_v.begin() + here,
                        pieces.ocv_v[before] + t * (pieces.ocv_v[before + 1] - pieces.ocv_v[before]));
    pieces.half_gap_v.insert(pieces.half_gap_v.begin() + here, curve.half_gap_v[worst]);
    pieces.soc.insert(pieces.soc.begin() + here, curve.soc[worst]);
  }
}

}  // namespace bms::identification
