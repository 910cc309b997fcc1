#include "diagnosis/calibration.hpp"

#include <algorithm>
#include <cmath>

#include "model/cell.hpp"

namespace bms::diagnosis {

namespace {

/// soc beyond the resistances' outermost node within which their error doubles.
constexpr double beyond_nodes = 0.1;

/// Knots over the soc that the records pass through, and one step beyond.
std::vector<double> knots(double low, double high, double step) {
  std::vector<double> at;
  for (double soc = std::floor(low / step) * step; soc < high + step * 0.999; soc += step) at.push_back(soc);
  if (at.size() < 2) at.push_back(at.front() + step);
  return at;
}

/// Two ascending lists as one, of places at least `apart` from each other; those of `first` all stay. At most `most`.
std::vector<double> merged(std::vector<double> first, const std::vector<double>& more, double apart, std::size_t most) {
  const auto far = [&](double x) {
    return std::none_of(first.begin(), first.end(), [&](double y) { return std::abs(x - y) < apart; });
  };
  for (const double x : more) {
    if (first.size() < most && x > 0 && x < 1 && far(x)) first.push_back(x);
  }
  std::sort(first.begin(), first.end());
  return first;
}

}  // namespace

Calibration::Calibration(const model::CellParameters<>& cell, std::span<const PreparedRecording> records) {
  double low = 2, high = -1;
  for (const PreparedRecording& r : records) {
    double soc = r.initial_soc, known_a = 0;
    for (std::size_t k = 0; k < r.size(); ++k) {
      if (std::isfinite(r.current_a[k])) known_a = r.current_a[k];
      if (k > 0) soc += known_a * (r.time_s[k] - r.time_s[k - 1]) / (3'600 * cell.capacity_ah);
      low = std::min(low, soc);
      high = std::max(high, soc);
    }
  }
  low = std::clamp(low, -0.1, 1.0);
  high = std::clamp(high, low, 1.1);

  const model::Tolerance& t = cell.tolerance;
  const double ocv_v = std::max(t.ocv_v, 2e-4), fraction = std::max(t.resistance_fraction, 2e-3);
  // a table of few nodes stands for the middle
  const double first_node = std::min(cell.rc.soc[0], 0.2), last_node = std::max(cell.rc.soc[cell.rc.soc.size - 1], 0.9);
  const auto fraction_at = [&](double soc) {
    return fraction * (1 + std::max({0.0, first_node - soc, soc - last_node}) / beyond_nodes);
  };
  offset_a_ = std::min(cell.noise.current_offset_a, 1e-3 * cell.capacity_ah);

  const auto hats = [&](std::vector<double> at, const auto& deviation) {
    Hats made(std::move(at), size_);
    size_ += made.size();
    return made.scaled(deviation);
  };
  ocv_ = hats(knots(low, high, 0.05), [&](double) { return ocv_v; });
  const auto& ocv = cell.ocv;
  for (std::size_t k = 1; k + 1 < ocv.soc.size; ++k) {
    const double bend = std::abs(ocv.b1_v[k] - ocv.b1_v[k - 1]),
                 between = std::min(ocv.soc[k + 1] - ocv.soc[k], ocv.soc[k] - ocv.soc[k - 1]);
    // a curve that follows both lines but for a quarter of the pieces beside the corner passes it at bend * width / 4
    const double width = std::min(0.025, between / 2), deviation_v = bend * width / 6;
    if (deviation_v > ocv_v / 2 && ocv.soc[k] > low - width && ocv.soc[k] < high + width)
      corners_.push_back({ocv.soc[k], width, deviation_v, size_++});
  }
  // what an identification says of itself counts where it is more
  const auto said = [&](const auto& value, const auto& deviation, double soc) {
    return deviation.size == 0 ? 0.0
                               : model::cell_detail::rc_value(cell.rc, deviation, soc) /
                                     model::cell_detail::rc_value(cell.rc, value, soc);
  };
  r0_ = hats(knots(low, high, 0.1),
             [&](double soc) { return std::max(fraction_at(soc), said(cell.rc.r0_ohm, cell.rc.r0_std_ohm, soc)); });
  r1_ = hats(knots(low, high, 0.2),
             [&](double soc) { return std::max(2 * fraction_at(soc), said(cell.rc.r1_ohm, cell.rc.r1_std_ohm, soc)); });
  c1_ = hats(knots(low, high, 0.2),
             [&](double soc) { return std::max(4 * fraction_at(soc), said(cell.rc.c1_f, cell.rc.c1_std_f, soc)); });
  capacity_ = size_++;
  gain_ = size_++;
  for (const PreparedRecording& r : records) {
    initial_soc_.push_back(size_++);
    initial_soc_sigma_.push_back(std::max(r.initial_soc_sigma, 1e-4));
    const double every_s = std::max(cell.noise.current_offset_correlation_s, r.duration_s() / 12);
    std::vector<double> at;
    for (double s = r.time_s.front(); s < r.time_s.back() + every_s; s += every_s) at.push_back(s);
    if (at.size() < 2) at.push_back(at.front() + every_s);
    offset_.push_back(hats(std::move(at), [&](double) { return offset_a_; }));
  }
}

model::CellParameters<> Calibration::applied(const model::CellParameters<>& cell, const std::vector<double>& u) const {
  model::CellParameters<> moved = cell;
  model::TablePoint<double> one;
  const auto at = [&](double soc) {
    one.ocv_v = 0;
    one.r0_ohm = one.r1_ohm = one.c1_f = 1;
    adjust(one, soc, u);
    return one;
  };

  std::vector<double> wanted = ocv_.knots();
  for (const Corner& c : corners_) {
    if (std::abs(u[c.unknown]) > 0.3) wanted.insert(wanted.end(), {c.soc - c.width, c.soc + c.width});
  }
  const model::OcvTable<double>& ocv = cell.ocv;
  const std::vector<double> edges =
      merged({ocv.soc.value.begin(), ocv.soc.value.begin() + static_cast<std::ptrdiff_t>(ocv.soc.size)}, wanted, 0.004,
             model::max_ocv_edges);
  moved.ocv = {};
  moved.ocv.lean = ocv.lean;
  for (std::size_t k = 0; k < edges.size(); ++k) {
    const std::size_t here = model::cell_detail::ocv_piece(ocv, edges[k]);
    moved.ocv.soc.push_back(edges[k]);
    if (ocv.half_gap_v.size > 0) {
      const double t = (edges[k] - ocv.soc[here]) / (ocv.soc[here + 1] - ocv.soc[here]);
      moved.ocv.half_gap_v.push_back(ocv.half_gap_v[here] + t * (ocv.half_gap_v[here + 1] - ocv.half_gap_v[here]));
    }
    if (k + 1 == edges.size()) break;
    const double low_v = at(edges[k]).ocv_v, high_v = at(edges[k + 1]).ocv_v, width = edges[k + 1] - edges[k];
    // the curve goes on rising
    const double turn_v = std::max((high_v - low_v) / width, -0.9 * ocv.b1_v[here]), middle_v = (low_v + high_v) / 2,
                 middle = (edges[k] + edges[k + 1]) / 2;
    moved.ocv.b1_v.push_back(ocv.b1_v[here] + turn_v);
    moved.ocv.b0_v.push_back(ocv.b0_v[here] + middle_v - turn_v * middle);
  }

  const model::RcTable<double>& rc = cell.rc;
  const std::vector<double> nodes =
      merged({rc.soc.value.begin(), rc.soc.value.begin() + static_cast<std::ptrdiff_t>(rc.soc.size)}, r0_.knots(), 0.02,
             model::max_rc_nodes);
  moved.rc = {};
  const auto value = [&](const auto& column, double soc) { return model::cell_detail::rc_value(rc, column, soc); };
  for (const double soc : nodes) {
    const model::TablePoint<double> by = at(soc);
    moved.rc.soc.push_back(soc);
    moved.rc.r0_ohm.push_back(std::clamp(value(rc.r0_ohm, soc) * by.r0_ohm, 1e-5, 0.5));
    moved.rc.r1_ohm.push_back(std::clamp(value(rc.r1_ohm, soc) * by.r1_ohm, 1e-5, 0.5));
    moved.rc.c1_f.push_back(value(rc.c1_f, soc) * by.c1_f);
  }
  moved.capacity_ah = cell.capacity_ah * (1 - capacity_loss(u));
  return moved;
}

}  // namespace bms::diagnosis
