// Which base parameters may move, by how much, and a cell file's tables with the movement written into them.
#include "diagnosis/calibration.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "diagnosis/charge_count.hpp"
#include "diagnosis/numerics.hpp"
#include "model/cell.hpp"
#include "model/mechanisms/voltage_offset.hpp"

namespace bms::diagnosis {

namespace {

constexpr const Thresholds::Calibration& calibration_limits = thresholds.calibration;
constexpr const Thresholds::MovedTables& table_limits = thresholds.tables;

/// Knots over a range, and one step beyond.
std::vector<double> even_knots(double low, double high, double step) {
  std::vector<double> at;
  for (double soc = std::floor(low / step) * step; soc < high + step * numerics.grid.knots_margin; soc += step)
    at.push_back(soc);
  if (at.size() < 2) at.push_back(at.front() + step);
  return at;
}

/// Two ascending lists as one, at places at least `apart` from each other; those of `first` all stay. At most `most`.
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

template <class Column>
std::vector<double> values_of(const Column& column) {
  return {column.value.begin(), column.value.begin() + static_cast<std::ptrdiff_t>(column.size)};
}

}  // namespace

Calibration::SocRange Calibration::counted_range(const model::CellParameters<>& cell,
                                                 std::span<const PreparedRecording> records) {
  double low = 2, high = -1;
  for (const PreparedRecording& r : records) {
    for_each_row(r, cell.capacity_ah, [&](const CountedRow& row) {
      low = std::min(low, row.soc);
      high = std::max(high, row.soc);
    });
  }
  low = std::clamp(low, calibration_limits.soc_lowest, 1.0);
  return {low, std::clamp(high, low, calibration_limits.soc_highest)};
}

template <class Sigma>
HatFunctions Calibration::hat_functions(std::vector<double> knots, Sigma sigma) {
  HatFunctions made(std::move(knots), size_, sigma);
  size_ += made.size();
  return made;
}

void Calibration::add_ocv(const model::CellParameters<>& cell, SocRange range, const LearnedError& learned) {
  const double ocv_v = std::max(cell.tolerance.ocv_v, calibration_limits.ocv_at_least_v);
  ocv_ = hat_functions(even_knots(range.low, range.high, calibration_limits.ocv_knots_soc),
                       [&](double soc) { return learned.known() ? learned.at(soc) : ocv_v; });
  const auto& ocv = cell.ocv;
  for (std::size_t k = 1; k + 1 < ocv.soc.size; ++k) {
    const double bend = std::abs(ocv.b1_v[k] - ocv.b1_v[k - 1]),
                 between = std::min(ocv.soc[k + 1] - ocv.soc[k], ocv.soc[k] - ocv.soc[k - 1]);
    const double width = std::min(calibration_limits.corner_width_soc, between / 2),
                 sigma_v = bend * width / calibration_limits.corner_share;
    if (sigma_v > ocv_v / 2 && ocv.soc[k] > range.low - width && ocv.soc[k] < range.high + width)
      corners_.push_back({ocv.soc[k], width, sigma_v, size_++});
  }
}

namespace {

/// Returns true if the identification knew R0 and R1 so badly that only their sum is known.
bool known_as_sum(const model::CellParameters<>& cell) {
  const auto& rc = cell.rc;
  if (rc.r0_std_ohm.size == 0 || rc.r1_std_ohm.size == 0) return false;
  for (std::size_t k = 0; k < rc.soc.size; ++k) {
    if (rc.r0_std_ohm[k] > calibration_limits.known_alone * rc.r0_ohm[k] &&
        rc.r1_std_ohm[k] > calibration_limits.known_alone * rc.r1_ohm[k])
      return true;
  }
  return false;
}

}  // namespace

void Calibration::add_resistances(const model::CellParameters<>& cell, SocRange range) {
  const double fraction = std::max(cell.tolerance.resistance_fraction, calibration_limits.resistance_at_least);
  const double first_node = std::min(cell.rc.soc[0], calibration_limits.first_node_soc),
               last_node = std::max(cell.rc.soc[cell.rc.soc.size - 1], calibration_limits.last_node_soc);
  const auto tolerance_at = [&](double soc) {
    return fraction * (1 + std::max({0.0, first_node - soc, soc - last_node}) / calibration_limits.beyond_nodes_soc);
  };
  const auto identified = [&](const auto& value, const auto& deviation, double soc) {
    return deviation.size == 0 ? 0.0
                               : model::cell_detail::rc_value(cell.rc, deviation, soc) /
                                     model::cell_detail::rc_value(cell.rc, value, soc);
  };
  const bool sum_alone = known_as_sum(cell);
  // the tolerance, or the identification's own standard deviation if it is larger
  const auto sigma_of = [&](const auto& value, const auto& deviation, double times, bool in_sum = false) {
    return [&, times, in_sum](double soc) {
      return std::max(times * tolerance_at(soc), in_sum ? 0.0 : identified(value, deviation, soc));
    };
  };
  const auto knots = [&](double step) { return even_knots(range.low, range.high, step); };
  r0_ =
      hat_functions(knots(calibration_limits.r0_knots_soc), sigma_of(cell.rc.r0_ohm, cell.rc.r0_std_ohm, 1, sum_alone));
  r1_ = hat_functions(
      knots(calibration_limits.rc_knots_soc),
      sigma_of(cell.rc.r1_ohm, cell.rc.r1_std_ohm, sum_alone ? 1 : calibration_limits.r1_times, sum_alone));
  c1_ = hat_functions(knots(calibration_limits.rc_knots_soc),
                      sigma_of(cell.rc.c1_f, cell.rc.c1_std_f, calibration_limits.c1_times));
  if (!sum_alone) return;
  share_ = hat_functions(knots(calibration_limits.rc_knots_soc), [&](double soc) {
    const double r0 = identified(cell.rc.r0_ohm, cell.rc.r0_std_ohm, soc),
                 r1 = identified(cell.rc.r1_ohm, cell.rc.r1_std_ohm, soc);
    return std::min(std::hypot(r0, r1), calibration_limits.share_sigma_at_most);
  });
}

void Calibration::add_record(const model::CellParameters<>& cell, const PreparedRecording& r) {
  initial_soc_.push_back(size_++);
  const double every_s =
      std::max(cell.noise.current_offset_correlation_s, r.duration_s() / calibration_limits.offset_knots);
  std::vector<double> at;
  for (double s = r.time_s.front(); s < r.time_s.back() + every_s; s += every_s) at.push_back(s);
  if (at.size() < 2) at.push_back(at.front() + every_s);
  offset_.push_back(hat_functions(std::move(at), [&](double) { return offset_a_; }));
}

/// Two starts that are derived from the first voltage have the error of the OCV there in common, as far as they are
/// less than a knot of it apart. What is left to each is the error of the voltmeter that read it.
void Calibration::add_starts(const model::CellParameters<>& cell, std::span<const PreparedRecording> records) {
  const auto sigma = [](const PreparedRecording& r) {
    return std::max(r.initial_soc_sigma, calibration_limits.initial_soc_at_least);
  };
  const double of_voltmeter_v = model::VoltageOffset::parameters[0].usual, ocv_v = cell.tolerance.ocv_v,
               in_common = std::max(0.0, 1 - std::pow(of_voltmeter_v / ocv_v, 2));
  Eigen::MatrixXd covariance(at(records.size()), at(records.size()));
  for (std::size_t j = 0; j < records.size(); ++j) {
    for (std::size_t k = 0; k <= j; ++k) {
      const PreparedRecording &a = records[j], &b = records[k];
      const double apart = std::abs(a.initial_soc - b.initial_soc) / calibration_limits.ocv_knots_soc,
                   derived = a.initial_soc_given || b.initial_soc_given ? 0 : std::max(0.0, 1 - apart),
                   correlation = j == k ? 1 : in_common * derived;
      covariance(at(j), at(k)) = covariance(at(k), at(j)) = correlation * sigma(a) * sigma(b);
    }
  }
  start_ = covariance.llt().matrixL();
}

Calibration::Calibration(const model::CellParameters<>& cell, std::span<const PreparedRecording> records, bool branch,
                         const Loosened& loosened, const LearnedError& learned)
    : offset_a_(std::min(cell.noise.current_offset_a, calibration_limits.offset_at_most_c * cell.capacity_ah)) {
  const SocRange range = counted_range(cell, records);
  add_ocv(cell, range, learned);
  add_resistances(cell, range);
  ocv_.loosen(loosened.ocv);
  r0_.loosen(loosened.r0);
  r1_.loosen(loosened.rc);
  c1_.loosen(loosened.rc);
  capacity_ = size_++;
  gain_ = size_++;
  for (const PreparedRecording& r : records) {
    add_record(cell, r);
    if (branch) branch_.push_back(size_++);
  }
  add_starts(cell, records);
}

model::TablePoint<double> Calibration::change_at(double soc, const std::vector<double>& u, double r0_ohm,
                                                 double r1_ohm) const {
  model::TablePoint<double> point;
  point.ocv_v = 0;
  point.c1_f = 1;
  point.r0_ohm = r0_ohm;
  point.r1_ohm = r1_ohm;
  adjust(point, soc, u);
  point.r0_ohm /= r0_ohm;
  point.r1_ohm /= r1_ohm;
  return point;
}

model::OcvTable<double> Calibration::moved_ocv(const model::OcvTable<double>& ocv, const std::vector<double>& u) const {
  std::vector<double> wanted = ocv_.knots();
  for (const Corner& c : corners_) {
    if (std::abs(u[c.unknown]) > table_limits.corner_sigma)
      wanted.insert(wanted.end(), {c.soc - c.width, c.soc + c.width});
  }
  const std::vector<double> edges =
      merged(values_of(ocv.soc), wanted, table_limits.edges_apart_soc, model::max_ocv_edges);
  model::OcvTable<double> moved;
  moved.lean = ocv.lean;
  for (std::size_t k = 0; k < edges.size(); ++k) {
    const std::size_t here = model::cell_detail::ocv_piece(ocv, edges[k]);
    moved.soc.push_back(edges[k]);
    if (ocv.half_gap_v.size > 0) {
      const double t = (edges[k] - ocv.soc[here]) / (ocv.soc[here + 1] - ocv.soc[here]);
      moved.half_gap_v.push_back(ocv.half_gap_v[here] + t * (ocv.half_gap_v[here + 1] - ocv.half_gap_v[here]));
    }
    if (k + 1 == edges.size()) break;
    const double low_v = change_at(edges[k], u).ocv_v, high_v = change_at(edges[k + 1], u).ocv_v,
                 width = edges[k + 1] - edges[k];
    const double turn_v = std::max((high_v - low_v) / width, -table_limits.slope_share * ocv.b1_v[here]),
                 middle_v = (low_v + high_v) / 2, middle = (edges[k] + edges[k + 1]) / 2;
    moved.b1_v.push_back(ocv.b1_v[here] + turn_v);
    moved.b0_v.push_back(ocv.b0_v[here] + middle_v - turn_v * middle);
  }
  return moved;
}

model::RcTable<double> Calibration::moved_rc(const model::RcTable<double>& rc, const std::vector<double>& u) const {
  const auto value = [&](const auto& column, double soc) { return model::cell_detail::rc_value(rc, column, soc); };
  const auto resistance = [&](const auto& column, double soc, double times) {
    return std::clamp(value(column, soc) * times, table_limits.resistance_lowest_ohm,
                      table_limits.resistance_highest_ohm);
  };
  model::RcTable<double> moved;
  for (const double soc : merged(values_of(rc.soc), r0_.knots(), table_limits.nodes_apart_soc, model::max_rc_nodes)) {
    const model::TablePoint<double> by = change_at(soc, u, value(rc.r0_ohm, soc), value(rc.r1_ohm, soc));
    moved.soc.push_back(soc);
    moved.r0_ohm.push_back(resistance(rc.r0_ohm, soc, by.r0_ohm));
    moved.r1_ohm.push_back(resistance(rc.r1_ohm, soc, by.r1_ohm));
    moved.c1_f.push_back(value(rc.c1_f, soc) * by.c1_f);
  }
  return moved;
}

model::CellParameters<> Calibration::applied(const model::CellParameters<>& cell, const std::vector<double>& u) const {
  model::CellParameters<> moved = cell;
  moved.ocv = moved_ocv(cell.ocv, u);
  moved.rc = moved_rc(cell.rc, u);
  moved.capacity_ah = cell.capacity_ah * (1 - capacity_loss(u));
  return moved;
}

}  // namespace bms::diagnosis
