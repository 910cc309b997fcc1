// A cell prepared for stepping with one scalar: the tables of its file merged into one row of SOC intervals, with
// everything that a step needs, and the noise figures in the units of the filter.
//
//   soc in [start of interval k, start of k + 1):  t = (soc - start) * per_width, value = value at start + t * delta
//
// per_width is the smallest power of two not below 1 / width: a shift in integers. t is below 2; delta is the change of
// a value while t goes from 0 to 1.
//
// The edges of the OCV table and the nodes of the RC table share one search. Outside 0 .. 1 the end lines of the OCV
// continue, and R0, R1, C1 stay constant. (A clamped OCV would have slope 0, and an estimate that has overshot needs a
// slope to return.) An edge belongs to the interval above it, and so does the slope there.
//
// prepare() is constexpr: the compiler runs it for the firmware, the host runs it at run time, with the same operations
// in the same order. Cost of look_up: part of the step in estimator/README.md.
#pragma once

#include <algorithm>
#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>

#include "arithmetic/scalar.hpp"
#include "model/cell_parameters.hpp"
#include "model/filter_noise.hpp"
#include "model/temperature.hpp"

namespace bms::model {

using namespace arithmetic;  // the physics uses these number types and functions

/// The tables in one interval of SOC.
template <class S>
struct Interval {
  Soc<S> start{};
  PerSoc<S> per_width{};  ///< 1 / width, rounded up to a power of two
  Voltage<S> ocv_v{}, ocv_delta_v{};
  Resistance<S> r0_ohm{}, r0_delta_ohm{};
  Resistance<S> r1_ohm{}, r1_delta_ohm{};
  Capacitance<S> c1_f{}, c1_delta_f{};
  /// Distance between charge and discharge curve (ocv.half_gap_v), relative to that in the middle of the curve.
  Factor<S> gap{1}, gap_delta{};
  /// Variance of the persistent voltage error: noise.model_v, and the slope times the uncertainty of the SOC axis
  /// (tolerance.initial_soc).
  Variance<S> error_v2{};
};

/// Charge is counted in microampere-microseconds [1e-12 A s] in 64-bit integers. It is read in counts of 2^shift of
/// this unit: one count is below 4e-9 of the capacity, and the range needs 32 bits.
template <class S>
struct ChargeScale {
  std::int64_t capacity_uaus = 0;
  std::int64_t lowest_uaus = 0;   ///< lower limit of the counter: min_soc
  std::int64_t highest_uaus = 0;  ///< upper limit: max_soc
  int shift = 0;
  Soc<S> soc_per_count{};   ///< fixed point: per 2^27 counts (the raw value of 1), 0.25 .. 0.5
  Soc<S> counts_per_soc{};  ///< its inverse; fixed point: in 2^27 counts
};

/// A reading outside this range is not a measurement.
struct PlausibleRange {
  std::int32_t voltage_min_uv = 0, voltage_max_uv = 0;
  std::int32_t current_max_ua = 0;       ///< either way
  std::int32_t current_possible_ua = 0;  ///< either way; beyond it, no cell with these resistances keeps its voltage
};

/// Limits of use, and the SOC per charge.
template <class S>
struct OperatingLimits {
  Voltage<S> voltage_min_v{}, voltage_max_v{};
  Current<S> charge_max_a{}, discharge_max_a{};  ///< > 0
  Fraction<S> soc_per_as{};                      ///< 1 / (3600 capacity)
};

template <class S, std::size_t Max>
struct Cell {
  using Scalar = S;

  std::array<Interval<S>, Max> interval{};
  std::array<Soc<S>, Max + 1> edge{};  ///< interval k is [edge k, edge k + 1); the outermost are out of reach
  ChargeScale<S> charge;
  FilterNoise<S> noise;
  PlausibleRange plausible;
  OperatingLimits<S> limits;
  std::size_t size = 0;  ///< intervals in use
  ReferenceTemperature<S> reference;
};

/// The tables at one SOC, with the change of each value over the interval: d / d soc = delta * per_width.
template <class S>
struct TablePoint {
  PerSoc<S> per_width;
  Voltage<S> ocv_v, ocv_delta_v;
  Resistance<S> r0_ohm, r0_delta_ohm;
  Resistance<S> r1_ohm, r1_delta_ohm;
  Capacitance<S> c1_f, c1_delta_f;
  Variance<S> error_v2{};
  Factor<S> gap{1}, gap_delta{};
  Factor<S> activation{1};                  ///< temperature factor of resistances that are not in the tables
  VoltagePerSoc<S> shifted_ocv_slope_v{0};  ///< slope of the OCV at the SOC where the laws read it
};

namespace cell_detail {

/// OCV edges and RC nodes, ascending, without duplicates.
template <class Real>
constexpr auto merged_edges(const CellParameters<Real>& p) {
  Column<double, max_ocv_edges + max_rc_nodes + 2> merged;
  std::size_t o = 0, r = 0;
  while (o < p.ocv.soc.size || r < p.rc.soc.size) {
    const bool take_ocv = r >= p.rc.soc.size || (o < p.ocv.soc.size && p.ocv.soc[o] <= p.rc.soc[r]);
    const double edge = take_ocv ? p.ocv.soc[o++] : p.rc.soc[r++];
    if (merged.size == 0 || edge - merged[merged.size - 1] > 1e-9) merged.push_back(edge);
  }
  return merged;
}

/// A column of the RC table at soc: linear between nodes, constant outside.
template <class Real, std::size_t Max>
constexpr Real rc_value(const RcTable<Real>& rc, const Column<Real, Max>& column, double soc) {
  if (soc <= rc.soc[0]) return column[0];
  for (std::size_t k = 1; k < rc.soc.size; ++k) {
    if (soc <= rc.soc[k]) {
      const double t = (soc - rc.soc[k - 1]) / (rc.soc[k] - rc.soc[k - 1]);
      return column[k - 1] + (column[k] - column[k - 1]) * t;
    }
  }
  return column[rc.soc.size - 1];
}

template <class Real>
constexpr double plain(const Real& x) {
  if constexpr (std::floating_point<Real>)
    return x;
  else
    return x.a;  // a dual number
}

template <class Real>
constexpr std::size_t ocv_piece(const OcvTable<Real>& ocv, double soc) {
  std::size_t k = 0;
  while (k + 2 < ocv.soc.size && soc >= ocv.soc[k + 1]) ++k;
  return k;
}

}  // namespace cell_detail

/// The plateau of a lithium iron phosphate cell, in SOC. Outside, slow charge and slow discharge differ by the position
/// of their knees.
inline constexpr double plateau_from_soc = 0.2, plateau_to_soc = 0.9;

/// Mean half gap between the charge and the discharge curve on the plateau [V]; 0 if unknown.
template <class Real>
constexpr double plateau_half_gap_v(const OcvTable<Real>& ocv) {
  double area = 0, width = 0;
  for (std::size_t k = 0; k + 1 < ocv.half_gap_v.size; ++k) {
    const double from = ocv.soc[k] > plateau_from_soc ? ocv.soc[k] : plateau_from_soc,
                 to = ocv.soc[k + 1] < plateau_to_soc ? ocv.soc[k + 1] : plateau_to_soc;
    if (!(to > from)) continue;
    const double slope = (ocv.half_gap_v[k + 1] - ocv.half_gap_v[k]) / (ocv.soc[k + 1] - ocv.soc[k]);
    area += (to - from) * (ocv.half_gap_v[k] + slope * ((from + to) / 2 - ocv.soc[k]));
    width += to - from;
  }
  return width > 0 && area > 0 ? area / width : 0;
}

namespace cell_detail {

/// Half gap relative to that of the plateau, 0 .. 2. At the ends it depends more on the current of the measurement than
/// on the cell.
template <class Real>
constexpr double gap_at(const OcvTable<Real>& ocv, double plateau_gap_v, double soc) {
  if (!(plateau_gap_v > 0)) return 1;
  const std::size_t k = ocv_piece(ocv, soc);
  double t = 0;
  if (soc >= 1)
    t = 1;
  else if (soc > 0)
    t = (soc - ocv.soc[k]) / (ocv.soc[k + 1] - ocv.soc[k]);
  const double gap = (ocv.half_gap_v[k] + t * (ocv.half_gap_v[k + 1] - ocv.half_gap_v[k])) / plateau_gap_v;
  return std::clamp(gap, 0.0, 2.0);
}

}  // namespace cell_detail

/// Number of intervals that prepare() makes: two outside, and one between each pair of neighbouring edges or nodes.
template <class Real>
constexpr std::size_t interval_count(const CellParameters<Real>& p) {
  return cell_detail::merged_edges(p).size + 1;
}

/// Largest variance of a voltage error [V^2]; a less accurate voltage contains no information.
inline constexpr double max_error_v2 = 0.04;

/// Width of the two intervals outside 0 .. 1, in SOC.
inline constexpr double outer_width = 0.125;

/// Limits of the counted charge, in SOC.
inline constexpr double min_soc = -0.25, max_soc = 1.25;

inline constexpr std::size_t max_intervals = max_ocv_edges + max_rc_nodes + 3;

namespace cell_detail {

/// The tables between two neighbouring edges or nodes. plateau_gap_v: see gap_at().
template <class S, class Real>
constexpr Interval<S> interval_between(const CellParameters<Real>& p, double from, double to, double plateau_gap_v) {
  Interval<S> i;
  double width = 1;  // of t from 0 to 1
  while (width > to - from) width /= 2;
  const double part = width / (to - from);
  const std::size_t piece = ocv_piece(p.ocv, from);
  const auto line = [&]<class Value>(const auto& column, Value& at_start, Value& delta) {
    const Real start = rc_value(p.rc, column, from);
    at_start = Value(start);
    delta = Value((rc_value(p.rc, column, to) - start) * part);
  };
  i.start = Soc<S>(from);
  i.per_width = PerSoc<S>(1.0 / width);
  i.ocv_v = Voltage<S>(p.ocv.b0_v[piece] + p.ocv.b1_v[piece] * from);
  i.ocv_delta_v = Voltage<S>(p.ocv.b1_v[piece] * width);
  line(p.rc.r0_ohm, i.r0_ohm, i.r0_delta_ohm);
  line(p.rc.r1_ohm, i.r1_ohm, i.r1_delta_ohm);
  line(p.rc.c1_f, i.c1_f, i.c1_delta_f);
  const double gap = gap_at(p.ocv, plateau_gap_v, from);
  i.gap = Factor<S>(gap);
  i.gap_delta = Factor<S>((gap_at(p.ocv, plateau_gap_v, to) - gap) * part);
  const double axis_v = plain(p.ocv.b1_v[piece]) * p.tolerance.initial_soc,
               model_v2 = p.noise.model_v * p.noise.model_v, error_v2 = model_v2 + axis_v * axis_v;
  const double most_v2 =
      model_v2 > max_error_v2 ? model_v2 : max_error_v2;  // never less than the part that does not depend on the SOC
  i.error_v2 = Variance<S>(error_v2 < most_v2 ? error_v2 : most_v2);
  return i;
}

template <class S>
constexpr ChargeScale<S> charge_scale(double capacity_as) {
  ChargeScale<S> c;
  c.capacity_uaus = static_cast<std::int64_t>(capacity_as * 1e12 + 0.5);
  while ((c.capacity_uaus >> c.shift) >= (std::int64_t{1} << 29)) ++c.shift;
  static_assert(min_soc == -0.25 && max_soc == 1.25);
  c.lowest_uaus = -(c.capacity_uaus / 4);
  c.highest_uaus = c.capacity_uaus + c.capacity_uaus / 4;
  const double per_soc =
      static_cast<double>(c.capacity_uaus) / (0x1p28 * static_cast<double>(std::int64_t{1} << c.shift));
  double unit = 0x1p28;
  if constexpr (is_q<Soc<S>>) unit /= static_cast<double>(std::int32_t{1} << Soc<S>::fraction_bits);
  c.counts_per_soc = Soc<S>(per_soc * unit);
  c.soc_per_count = Soc<S>(1 / (per_soc * unit));
  return c;
}

template <class Real>
constexpr PlausibleRange plausible_range(const CellParameters<Real>& p) {
  const Limits& l = p.limits;
  PlausibleRange r;
  // half a volt and ten times the current beyond the limits of use: a reading there can still be right
  r.voltage_min_uv = static_cast<std::int32_t>((l.voltage_min_v - 0.5) * 1e6);
  r.voltage_max_uv = static_cast<std::int32_t>((l.voltage_max_v + 0.5) * 1e6);
  const double larger =
      l.charge_current_max_a > l.discharge_current_max_a ? l.charge_current_max_a : l.discharge_current_max_a;
  r.current_max_ua = micro_a(10 * larger);
  double least_r0_ohm = plain(p.rc.r0_ohm[0]);
  for (std::size_t k = 1; k < p.rc.r0_ohm.size; ++k)
    least_r0_ohm = plain(p.rc.r0_ohm[k]) < least_r0_ohm ? plain(p.rc.r0_ohm[k]) : least_r0_ohm;
  // twice the whole range of voltages over R0, which is smaller in the heat
  r.current_possible_ua = micro_a(2e-6 * (r.voltage_max_uv - r.voltage_min_uv) / least_r0_ohm);
  return r;
}

}  // namespace cell_detail

/// Prepares p for scalar S. p has been accepted by first_fault(); Max >= interval_count(p).
template <class S, std::size_t Max, class Real>
constexpr Cell<S, Max> prepare(const CellParameters<Real>& p) {
  namespace d = cell_detail;
  Cell<S, Max> cell;
  const auto edges = d::merged_edges(p);
  const double plateau_gap_v = plateau_half_gap_v(p.ocv);
  const auto add = [&](double from, double to) {
    cell.interval[cell.size] = d::interval_between<S>(p, from, to, plateau_gap_v);
    cell.edge[cell.size] = cell.interval[cell.size].start;
    ++cell.size;
  };
  // the outer intervals have no outer edge: t continues beyond 0 and 1
  add(-outer_width, 0);
  for (std::size_t k = 0; k + 1 < edges.size; ++k) add(edges[k], edges[k + 1]);
  add(1, 1 + outer_width);
  // out of reach: the soc of a simulation may have any value, the estimator's is clamped to -1/4 .. 5/4
  const double out_of_reach = is_q<Soc<S>> ? 7.9 : 1e30;
  cell.edge[0] = Soc<S>(-out_of_reach);
  cell.edge[cell.size] = Soc<S>(out_of_reach);

  const double capacity_as = p.capacity_ah * 3'600;
  cell.charge = d::charge_scale<S>(capacity_as);
  cell.noise = d::filter_noise<S>(p, capacity_as);
  cell.limits = {Voltage<S>(p.limits.voltage_min_v), Voltage<S>(p.limits.voltage_max_v),
                 Current<S>(p.limits.charge_current_max_a), Current<S>(p.limits.discharge_current_max_a),
                 Fraction<S>(1 / capacity_as)};
  cell.plausible = d::plausible_range(p);
  cell.reference = ReferenceTemperature<S>::of(p.reference_temperature_c);
  return cell;
}

/// Interval that contains soc (fixed point: within +-7.9). The search starts at `from`, because a step moves soc by
/// little; the result does not depend on it.
template <class S, std::size_t Max>
constexpr std::size_t interval_of(const Cell<S, Max>& cell, const Soc<S>& soc, std::size_t from) {
  std::size_t k = from;
  while (soc >= cell.edge[k + 1]) ++k;
  while (soc < cell.edge[k]) --k;
  return k;
}

/// The tables at soc, which is in interval i.
template <class S>
constexpr TablePoint<S> point_in(const Interval<S>& i, const Soc<S>& soc) {
  const Soc<S> t = (soc - i.start) * i.per_width;
  return {.per_width = i.per_width,
          .ocv_v = i.ocv_v + Voltage<S>(t * i.ocv_delta_v),
          .ocv_delta_v = i.ocv_delta_v,
          .r0_ohm = i.r0_ohm + Resistance<S>(t * i.r0_delta_ohm),
          .r0_delta_ohm = i.r0_delta_ohm,
          .r1_ohm = i.r1_ohm + Resistance<S>(t * i.r1_delta_ohm),
          .r1_delta_ohm = i.r1_delta_ohm,
          .c1_f = i.c1_f + Capacitance<S>(t * i.c1_delta_f),
          .c1_delta_f = i.c1_delta_f,
          .error_v2 = i.error_v2,
          .gap = i.gap + Factor<S>(t * i.gap_delta),
          .gap_delta = i.gap_delta};
}

/// interval: result of the last look-up, 0 at first; updated.
template <class S, std::size_t Max>
constexpr TablePoint<S> look_up(const Cell<S, Max>& cell, const Soc<S>& soc, std::uint8_t& interval) {
  const std::size_t k = interval_of(cell, soc, interval);
  interval = static_cast<std::uint8_t>(k);
  return point_in(cell.interval[k], soc);
}

template <class S, std::size_t Max>
constexpr TablePoint<S> look_up(const Cell<S, Max>& cell, const Soc<S>& soc) {
  std::uint8_t interval = 0;
  return look_up(cell, soc, interval);
}

}  // namespace bms::model
