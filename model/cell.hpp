// A cell prepared for stepping with one scalar: the tables of its file merged into one row of intervals over soc, each
// with what a step needs, and the noise figures turned into the units of the filter.
//
//   soc in [start of interval k, start of interval k + 1):  t = (soc - start) * per_width,  value = value at start + t
//   * delta
//
// per_width is the power of two next to 1 / width, not below it: a shift in integers. t ends below 2, delta is what a
// value changes by while t goes from 0 to 1.
//
// The edges of the OCV table and the nodes of the RC table share one search. Beyond 0 and 1 the OCV's end lines go on
// (a clamp would have slope 0 just where an estimate that has overshot needs one to find back) and R0, R1, C1 stay
// constant. An edge belongs to the interval above it, so does the slope there.
//
// prepare() is constexpr: firmware runs it in the compiler, the host at run time, with the same digits in the same
// order. Cost of look_up: in estimator/README.md with the step.
#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>

#include "arithmetic/scalar.hpp"
#include "model/cell_parameters.hpp"

namespace bms::model {

using namespace arithmetic;  // physics is written in its number types and functions

/// All that the tables say about one interval of soc.
template <class S>
struct Interval {
  Soc<S> start{};
  PerSoc<S> per_width{};  ///< 1 / width, rounded up to a power of two
  Voltage<S> ocv_v{}, ocv_delta_v{};
  Resistance<S> r0_ohm{}, r0_delta_ohm{};
  Resistance<S> r1_ohm{}, r1_delta_ohm{};
  Capacitance<S> c1_f{}, c1_delta_f{};
  Factor<S> gap{1}, gap_delta{};  ///< of the distance between charge and discharge (ocv.half_gap_v): over what it is in
                                  ///< the middle of the curve
  Variance<S> error_v2{};  ///< of the voltage there, lasting: noise.model_v, and the slope times what the soc axis is
                           ///< good to (tolerance.initial_soc)
};

/// Charge is counted in microampere-microseconds [1e-12 A s], in 64-bit integers, and read in counts of 2^shift of
/// them: fine enough that nothing is lost (one count is below 4e-9 of the capacity), coarse enough for 32 bits.
template <class S>
struct ChargeScale {
  std::int64_t capacity_uaus = 0;
  std::int64_t lowest_uaus = 0;   ///< where counting stops: min_soc
  std::int64_t highest_uaus = 0;  ///< max_soc
  int shift = 0;
  Soc<S> soc_per_count{};   ///< fixed point: per 2^27 counts (what Soc holds as 1), 0.25 .. 0.5
  Soc<S> counts_per_soc{};  ///< its inverse; fixed point: in 2^27 counts
};

/// A current reading that rests (estimator/current_at_rest.hpp).
struct RestingCurrent {
  std::int32_t largest_ua = 0, still_ua = 0;
};

/// Noise as the filter uses it, in its own units.
template <class S>
struct FilterNoise {
  Variance<S> voltage_v2{};           ///< white, per sample
  Variance<S> model_v2{};             ///< of all that Interval::error_v2 holds, what is the same everywhere
  Duration<S> model_correlation_s{};  ///< how long Interval::error_v2 and the resistances' error last
  Fraction<S> resistance_error{};     ///< of R0 + R1
  Variance<S> v_rc_v2{};              ///< in the steady state
  Variance<S> rest_v2{};
  Soc<S> white_soc_per_s{};       ///< current_a over the capacity
  Variance<S> walk_soc2_per_s{};  ///< slow current error: 2 offset^2 correlation / capacity^2
  Variance<S>
      offset_per_h2{};  ///< the same as a state of the filter: current_offset_a over the capacity in Ah, squared
  Duration<S> current_offset_correlation_s{};
  Variance<S> at_rest_per_h2{};  ///< current_at_rest_a over the capacity in Ah, squared; 0: not known
  RestingCurrent at_rest;
  Fraction<S> gain{};          ///< current_gain
  Current<S> one_c_a{};        ///< the capacity in one hour
  Soc<S> unknown_soc_per_s{};  ///< current_unknown_a over the capacity
  Current<S> unknown_a{};
};

/// A reading outside is not a measurement.
struct PlausibleRange {
  std::int32_t voltage_min_uv = 0, voltage_max_uv = 0;
  std::int32_t current_max_ua = 0;  ///< either way
};

/// Limits of use, and what a current makes of soc.
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
};

/// What the tables say at one soc, and how much it changes over the interval: d / d soc = delta * per_width.
template <class S>
struct TablePoint {
  PerSoc<S> per_width;
  Voltage<S> ocv_v, ocv_delta_v;
  Resistance<S> r0_ohm, r0_delta_ohm;
  Resistance<S> r1_ohm, r1_delta_ohm;
  Capacitance<S> c1_f, c1_delta_f;
  Variance<S> error_v2{};
  Factor<S> gap{1}, gap_delta{};
  Factor<S> activation{1};  ///< by how much resistances that the tables do not hold differ with the temperature
  VoltagePerSoc<S> shifted_ocv_slope_v{0};  ///< of the OCV, by the soc at which laws read it elsewhere
};

namespace cell_detail {

/// OCV edges and RC nodes, ascending, each once.
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

/// Column of the RC table at soc: linear between nodes, constant outside.
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

/// The middle of the curve: where a lithium iron phosphate cell's voltage hardly moves, in soc. Beyond, slow charge and
/// discharge part by their knees.
inline constexpr double plateau_from_soc = 0.2, plateau_to_soc = 0.9;

/// Half the distance between charge and discharge in the middle of the curve [V]; 0: not known.
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

/// The half gap over that of the middle; at the ends it is more of the current that it was measured with than of the
/// cell.
template <class Real>
constexpr double gap_at(const OcvTable<Real>& ocv, double middle_v, double soc) {
  if (!(middle_v > 0)) return 1;
  const std::size_t k = ocv_piece(ocv, soc);
  const double t = soc <= 0 ? 0 : soc >= 1 ? 1 : (soc - ocv.soc[k]) / (ocv.soc[k + 1] - ocv.soc[k]);
  const double gap = (ocv.half_gap_v[k] + t * (ocv.half_gap_v[k + 1] - ocv.half_gap_v[k])) / middle_v;
  return gap < 0 ? 0 : gap > 2 ? 2 : gap;
}

}  // namespace cell_detail

/// Number of intervals that prepare() will make: two outside and one between each pair of edges or nodes.
template <class Real>
constexpr std::size_t interval_count(const CellParameters<Real>& p) {
  return cell_detail::merged_edges(p).size + 1;
}

/// A voltage that is known no better says nothing.
inline constexpr double max_error_v2 = 0.04;

/// A sensor of more is not there: of what is plausible, and of what may have flowed unseen.
inline constexpr double max_current_a = 2'000;

inline constexpr double outer_width = 0.125;

/// Where counting stops, in soc.
inline constexpr double min_soc = -0.25, max_soc = 1.25;

inline constexpr std::size_t max_intervals = max_ocv_edges + max_rc_nodes + 3;

/// Prepares p, which first_fault() has found good, for scalar S. Max >= interval_count(p).
template <class S, std::size_t Max, class Real>
constexpr Cell<S, Max> prepare(const CellParameters<Real>& p) {
  namespace d = cell_detail;
  Cell<S, Max> cell;

  const auto edges = d::merged_edges(p);
  const double middle_gap_v = plateau_half_gap_v(p.ocv);
  const auto add = [&](double from, double to) {
    double width = 1;  // that t = 1 stands for
    while (width > to - from) width /= 2;
    const double part = width / (to - from);
    const std::size_t piece = d::ocv_piece(p.ocv, from);
    Interval<S>& i = cell.interval[cell.size];
    const auto line = [&]<class Value>(const auto& column, Value& at_start, Value& delta) {
      const Real start = d::rc_value(p.rc, column, from);
      at_start = Value(start);
      delta = Value((d::rc_value(p.rc, column, to) - start) * part);
    };
    i.start = Soc<S>(from);
    cell.edge[cell.size] = i.start;
    i.per_width = PerSoc<S>(1.0 / width);
    i.ocv_v = Voltage<S>(p.ocv.b0_v[piece] + p.ocv.b1_v[piece] * from);
    i.ocv_delta_v = Voltage<S>(p.ocv.b1_v[piece] * width);
    line(p.rc.r0_ohm, i.r0_ohm, i.r0_delta_ohm);
    line(p.rc.r1_ohm, i.r1_ohm, i.r1_delta_ohm);
    line(p.rc.c1_f, i.c1_f, i.c1_delta_f);
    const double gap = d::gap_at(p.ocv, middle_gap_v, from);
    i.gap = Factor<S>(gap);
    i.gap_delta = Factor<S>((d::gap_at(p.ocv, middle_gap_v, to) - gap) * part);
    const double axis_v = d::plain(p.ocv.b1_v[piece]) * p.tolerance.initial_soc,
                 model_v2 = p.noise.model_v * p.noise.model_v, error_v2 = model_v2 + axis_v * axis_v;
    const double most_v2 =
        model_v2 > max_error_v2 ? model_v2 : max_error_v2;  // never less than what is the same everywhere
    i.error_v2 = Variance<S>(error_v2 < most_v2 ? error_v2 : most_v2);
    ++cell.size;
  };
  // outside, a width stands for "from there on": t goes on beyond 0 and 1
  add(-outer_width, 0);
  for (std::size_t k = 0; k + 1 < edges.size; ++k) add(edges[k], edges[k + 1]);
  add(1, 1 + outer_width);
  // out of reach: a simulation's soc may be anywhere, the estimator's is held within -1/4 .. 5/4
  const double nowhere = is_q<Soc<S>> ? 7.9 : 1e30;
  cell.edge[0] = Soc<S>(-nowhere);
  cell.edge[cell.size] = Soc<S>(nowhere);

  const double capacity_as = p.capacity_ah * 3'600;
  cell.charge.capacity_uaus = static_cast<std::int64_t>(capacity_as * 1e12 + 0.5);
  while ((cell.charge.capacity_uaus >> cell.charge.shift) >= (std::int64_t{1} << 29)) ++cell.charge.shift;
  static_assert(min_soc == -0.25 && max_soc == 1.25);
  cell.charge.lowest_uaus = -(cell.charge.capacity_uaus / 4);
  cell.charge.highest_uaus = cell.charge.capacity_uaus + cell.charge.capacity_uaus / 4;
  const double per_soc = static_cast<double>(cell.charge.capacity_uaus) /
                         (268'435'456.0 * static_cast<double>(std::int64_t{1} << cell.charge.shift));
  double unit = 268'435'456.0;
  if constexpr (is_q<Soc<S>>) unit /= static_cast<double>(std::int32_t{1} << Soc<S>::fraction_bits);
  cell.charge.counts_per_soc = Soc<S>(per_soc * unit);
  cell.charge.soc_per_count = Soc<S>(1 / (per_soc * unit));

  const Noise& n = p.noise;
  const auto square = [](double v) { return v * v; };
  cell.noise.voltage_v2 = Variance<S>(square(n.voltage_v));
  cell.noise.model_v2 = Variance<S>(square(n.model_v));
  cell.noise.model_correlation_s = Duration<S>(n.model_correlation_s);
  cell.noise.resistance_error = Fraction<S>(p.tolerance.resistance_fraction);
  cell.noise.v_rc_v2 = Variance<S>(square(n.v_rc_v));
  cell.noise.rest_v2 = Variance<S>(square(n.rest_v));
  cell.noise.white_soc_per_s = Soc<S>(n.current_a / capacity_as);
  cell.noise.walk_soc2_per_s =
      Variance<S>(2 * square(n.current_offset_a / capacity_as) * n.current_offset_correlation_s);
  cell.noise.offset_per_h2 = Variance<S>(square(n.current_offset_a / p.capacity_ah));
  cell.noise.current_offset_correlation_s =
      Duration<S>(n.current_offset_correlation_s < 131'000 ? n.current_offset_correlation_s : 131'000);
  cell.noise.at_rest_per_h2 = Variance<S>(square(n.current_at_rest_a / p.capacity_ah));
  const auto micro = [](double a) { return static_cast<std::int32_t>(1e6 * (a < max_current_a ? a : max_current_a)); };
  cell.noise.at_rest = {micro(3 * (n.current_offset_a + n.current_at_rest_a)), micro(n.current_offset_a)};
  cell.noise.gain = Fraction<S>(n.current_gain);
  cell.noise.one_c_a = Current<S>(p.capacity_ah);
  cell.noise.unknown_soc_per_s = Soc<S>(n.current_unknown_a / capacity_as);
  cell.noise.unknown_a = Current<S>(n.current_unknown_a < max_current_a ? n.current_unknown_a : max_current_a);

  cell.limits = {Voltage<S>(p.limits.voltage_min_v), Voltage<S>(p.limits.voltage_max_v),
                 Current<S>(p.limits.charge_current_max_a), Current<S>(p.limits.discharge_current_max_a),
                 Fraction<S>(1 / capacity_as)};

  // half a volt and ten times the current beyond the limits of use: a sensor still tells the truth there, a fault does
  // not
  cell.plausible.voltage_min_uv = static_cast<std::int32_t>((p.limits.voltage_min_v - 0.5) * 1e6);
  cell.plausible.voltage_max_uv = static_cast<std::int32_t>((p.limits.voltage_max_v + 0.5) * 1e6);
  const double larger = p.limits.charge_current_max_a > p.limits.discharge_current_max_a
                            ? p.limits.charge_current_max_a
                            : p.limits.discharge_current_max_a;
  cell.plausible.current_max_ua = micro(10 * larger);
  return cell;
}

/// Interval that holds soc (fixed point: within +-7.9), found from a nearby one: a step moves soc by little. The result
/// does not depend on `from`.
template <class S, std::size_t Max>
constexpr std::size_t interval_of(const Cell<S, Max>& cell, const Soc<S>& soc, std::size_t from) {
  std::size_t k = from;
  while (soc >= cell.edge[k + 1]) ++k;
  while (soc < cell.edge[k]) --k;
  return k;
}

/// interval: where the last look-up ended, 0 at first; updated.
template <class S, std::size_t Max>
constexpr TablePoint<S> look_up(const Cell<S, Max>& cell, const Soc<S>& soc, std::uint8_t& interval) {
  const std::size_t k = interval_of(cell, soc, interval);
  interval = static_cast<std::uint8_t>(k);
  const Interval<S>& i = cell.interval[k];
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

template <class S, std::size_t Max>
constexpr TablePoint<S> look_up(const Cell<S, Max>& cell, const Soc<S>& soc) {
  std::uint8_t interval = 0;
  return look_up(cell, soc, interval);
}

}  // namespace bms::model
