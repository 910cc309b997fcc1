// A cell as its file describes it: the tables of the paper and the figures around them, in SI units, before they are
// prepared for a scalar (model/cell.hpp). The host fills this structure from TOML at run time. For firmware, a
// generator writes the same structure as a constexpr header, so both start from the same digits.
//
//   Real: double, or ceres::Jet where a parameter is an unknown of a fit
//
// first_fault() is the only list of what a cell file may contain; host and build both use it.
#pragma once

#include <array>
#include <cstddef>

namespace bms::model {

/// Temperature at which the tables of a cell file are valid if the file does not state it [degrees C]: that of most
/// data sheets.
inline constexpr double default_reference_temperature_c = 25;

/// Up to Max values of one table column.
template <class Real, std::size_t Max>
struct Column {
  std::array<Real, Max> value{};
  std::size_t size = 0;

  constexpr const Real& operator[](std::size_t k) const { return value[k]; }
  constexpr Real& operator[](std::size_t k) { return value[k]; }
  constexpr void push_back(const Real& v) { value[size++] = v; }
};

/// Ranges that a cell file may contain: wide enough for any lithium cell from a coin cell to 1,000 Ah (Table 3 of the
/// paper bounds the fit of a cell of 6 Ah). model/fixed_ranges.hpp proves that fixed point has room for all of them.
namespace accepted {

struct Range {
  double low, high;
};
inline constexpr Range capacity_ah{0.01, 1'000};
inline constexpr Range reference_temperature_c{-40, 80};
inline constexpr Range voltage_v{0.5, 5};               ///< limits of use, and the OCV from SOC 0 to 1
inline constexpr Range current_a{1e-3, 2'000};          ///< limits of use; a reading ends at 2,147 A
inline constexpr Range slope_v{1e-6, 60};               ///< slope of the OCV, per unit of SOC
inline constexpr Range resistance_ohm{1e-5, 0.5};       ///< R0 and R1
inline constexpr Range capacitance_f{100, 1'000'000};   ///< C1; of a fast pair of 400 Ah: 500,000 F
inline constexpr double fixed_capacitance_f = 100'000;  ///< largest C1 in fixed point
inline constexpr Range time_constant_s{0.2, 50'000};    ///< R1 C1
inline constexpr double least_width = 0.0005;           ///< of SOC, between any two edges or nodes
inline constexpr Range lasts_s{0, 86'400};              ///< noise.model_correlation_s
inline constexpr Range unknown_c{1e-3, 10};             ///< noise.current_unknown_a over the 1C current
inline constexpr double most_gain = 0.2, most_resistance_error = 1, most_resistance_per_ev = 1;

}  // namespace accepted

inline constexpr std::size_t max_ocv_edges = 64;
inline constexpr std::size_t max_rc_nodes = 64;

/// Piecewise linear open-circuit voltage (Eq. 4): b0_v[k] + b1_v[k] * soc holds for soc[k] <= soc < soc[k + 1].
template <class Real>
struct OcvTable {
  Column<double, max_ocv_edges> soc;  ///< edges, ascending, first 0, last 1
  Column<Real, max_ocv_edges> b0_v;   ///< [V], one less than edges
  Column<Real, max_ocv_edges> b1_v;   ///< [V per unit of soc], > 0
  // hysteresis between slow charge and slow discharge, if it is known; the 1RC model does not use it
  Column<double, max_ocv_edges> half_gap_v{};  ///< [V] at the edges, half of charge minus discharge; or empty
  double lean = 0;  ///< branch position, -1..1: b0, b1 are the middle of both plus this times half_gap
};

/// Equivalent circuit at nodes of soc; linear in between, constant outside.
template <class Real>
struct RcTable {
  Column<double, max_rc_nodes> soc;  ///< nodes, ascending, within 0 .. 1
  Column<Real, max_rc_nodes> r0_ohm;
  Column<Real, max_rc_nodes> r1_ohm;
  Column<Real, max_rc_nodes> c1_f;
  Column<double, max_rc_nodes> r0_std_ohm{}, r1_std_ohm{},
      c1_std_f{};  ///< standard deviations from an identification, or empty
};

/// Limits of use, from the manufacturer.
struct Limits {
  double voltage_min_v = 0;
  double voltage_max_v = 0;
  double charge_current_max_a = 0;     ///< continuous, > 0
  double discharge_current_max_a = 0;  ///< continuous, > 0
  double temperature_min_c = 0;
  double temperature_max_c = 0;
};

/// Half of the model's error has the correlation time Noise::model_correlation_s, half has one this many times as long.
inline constexpr int persistent_error_correlations = 8;

/// Errors that the estimator expects, as standard deviations.
struct Noise {
  double voltage_v = 0;                     ///< voltage reading, white
  double model_v = 0;                       ///< the model's voltage error, correlated
  double model_correlation_s = 0;           ///< its correlation time
  double v_rc_v = 0;                        ///< error of the RC voltage in the steady state
  double rest_v = 0;                        ///< rested voltage relative to the OCV curve (hysteresis, relaxation)
  double current_a = 0;                     ///< current reading, white
  double current_offset_a = 0;              ///< slow error of the current reading
  double current_offset_correlation_s = 0;  ///< its correlation time
  double current_unknown_a = 0;             ///< expected current while the reading is missing
  /// Current that may flow while the reading rests; used if errors are states. 0: unknown, the reading is taken as it
  /// is.
  double current_at_rest_a = 0;
  /// Relative error of the current's gain and of the capacity; used if errors are states.
  double current_gain = 0;
  /// The filter estimates the current's offset and the model's persistent error; otherwise they only widen sigma.
  bool errors_are_states = false;
};

/// resistance_per_ev of a file that does not state it, measured on recordings at other temperatures than those of the
/// identification (estimator/README.md).
inline constexpr double default_resistance_per_ev = 0.15;

/// Accuracy of the calibration; only a larger difference is a mismatch.
struct Tolerance {
  double ocv_v = 0;
  double resistance_fraction = 0;  ///< of R0 and R1; increases the voltage noise of the estimator under current
  double initial_soc = 0;          ///< of the tables' SOC axis; increases the voltage noise where the OCV is steep
  double drift_v = 0;
  /// Increase of resistance_fraction outside of range.temperature_*, per |1 / kT - 1 / kT_edge| [eV].
  double resistance_per_ev = default_resistance_per_ev;
};

/// Where the parameters were identified. A value of `unknown` stands for a missing key.
struct IdentifiedRange {
  static constexpr double unknown = -1'000;

  double temperature_min_c = unknown, temperature_max_c = unknown;
  double soc_min = unknown, soc_max = unknown;
  double current_max_a = unknown;  ///< either sign
  double duration_s = unknown;     ///< longest time under load: slower processes were not seen
};

template <class Real = double>
struct CellParameters {
  double capacity_ah = 0;
  double reference_temperature_c = default_reference_temperature_c;  ///< at which `ocv` and `rc` are valid
  Limits limits;
  OcvTable<Real> ocv;
  RcTable<Real> rc;
  Noise noise;
  Tolerance tolerance;
  IdentifiedRange range{};
};

/// Why a set of parameters is refused; what is nullptr if it is accepted.
struct CellFault {
  const char* key = nullptr;   ///< as in the cell file, e.g. "ocv.b1_v"
  std::size_t index = 0;       ///< of the table entry
  const char* what = nullptr;  ///< what is expected
};

namespace parameters_detail {

/// Also true for NaN.
constexpr bool outside(double v, double low, double high) { return !(v >= low && v <= high); }
constexpr bool beyond(double v, accepted::Range range) { return outside(v, range.low, range.high); }

constexpr CellFault fault_of(const Limits& l) {
  if (beyond(l.voltage_min_v, accepted::voltage_v)) return {"limits.voltage_min_v", 0, "0.5 to 5 V"};
  if (outside(l.voltage_max_v, l.voltage_min_v + 0.1, accepted::voltage_v.high))
    return {"limits.voltage_max_v", 0, "voltage_min_v + 0.1 to 5 V"};
  constexpr const char* current = "0.001 to 2000 A, so that an overload is within a reading (2147 A)";
  if (beyond(l.charge_current_max_a, accepted::current_a)) return {"limits.charge_current_max_a", 0, current};
  if (beyond(l.discharge_current_max_a, accepted::current_a)) return {"limits.discharge_current_max_a", 0, current};
  if (outside(l.temperature_min_c, -60, 100)) return {"limits.temperature_min_c", 0, "-60 to 100 degrees C"};
  if (outside(l.temperature_max_c, l.temperature_min_c, 150))
    return {"limits.temperature_max_c", 0, "temperature_min_c to 150 degrees C"};
  return {};
}

constexpr CellFault fault_of(const OcvTable<double>& o) {
  if (o.soc.size < 2) return {"ocv.soc", 0, "two edges or more"};
  if (o.b0_v.size + 1 != o.soc.size) return {"ocv.b0_v", 0, "one value less than ocv.soc"};
  if (o.b1_v.size + 1 != o.soc.size) return {"ocv.b1_v", 0, "one value less than ocv.soc"};
  if (o.soc[0] != 0) return {"ocv.soc", 0, "0 as the first edge"};
  if (o.soc[o.soc.size - 1] != 1) return {"ocv.soc", o.soc.size - 1, "1 as the last edge"};
  for (std::size_t k = 0; k + 1 < o.soc.size; ++k) {
    if (outside(o.soc[k + 1] - o.soc[k], 0.001, 1)) return {"ocv.soc", k + 1, "edges that ascend by 0.001 or more"};
    if (beyond(o.b1_v[k], accepted::slope_v))
      return {"ocv.b1_v", k, "a curve that rises: 0.000001 to 60 V per unit of soc"};
    for (const double soc : {o.soc[k], o.soc[k + 1]}) {
      if (beyond(o.b0_v[k] + o.b1_v[k] * soc, accepted::voltage_v))
        return {"ocv.b0_v", k, "an open-circuit voltage of 0.5 to 5 V"};
    }
    if (k > 0 && outside(o.b0_v[k] + o.b1_v[k] * o.soc[k] - o.b0_v[k - 1] - o.b1_v[k - 1] * o.soc[k], -0.005, 0.005)) {
      return {"ocv.b0_v", k, "pieces that meet within 5 mV at their common edge"};
    }
  }

  if (o.half_gap_v.size != 0 && o.half_gap_v.size != o.soc.size)
    return {"ocv.half_gap_v", 0, "as many values as ocv.soc"};
  for (std::size_t k = 0; k < o.half_gap_v.size; ++k) {
    if (outside(o.half_gap_v[k], -0.5, 1)) return {"ocv.half_gap_v", k, "-0.5 to 1 V"};
  }
  if (outside(o.lean, -1, 1)) return {"ocv.lean", 0, "-1 to 1"};
  return {};
}

/// o: the nodes must keep a distance from its edges.
constexpr CellFault fault_of(const RcTable<double>& r, const OcvTable<double>& o) {
  if (r.soc.size < 1) return {"rc.soc", 0, "one node or more"};
  if (r.r0_ohm.size != r.soc.size) return {"rc.r0_ohm", 0, "as many values as rc.soc"};
  if (r.r1_ohm.size != r.soc.size) return {"rc.r1_ohm", 0, "as many values as rc.soc"};
  if (r.c1_f.size != r.soc.size) return {"rc.c1_f", 0, "as many values as rc.soc"};
  const auto deviations = [&](const auto& column) {
    if (column.size != 0 && column.size != r.soc.size) return false;
    for (std::size_t k = 0; k < column.size; ++k) {
      if (outside(column[k], 0, 1e9)) return false;
    }
    return true;
  };
  constexpr const char* as_many = "as many values as rc.soc, none negative";
  if (!deviations(r.r0_std_ohm)) return {"rc.r0_std_ohm", 0, as_many};
  if (!deviations(r.r1_std_ohm)) return {"rc.r1_std_ohm", 0, as_many};
  if (!deviations(r.c1_std_f)) return {"rc.c1_std_f", 0, as_many};
  for (std::size_t k = 0; k < r.soc.size; ++k) {
    if (outside(r.soc[k], 0, 1)) return {"rc.soc", k, "0 to 1"};
    for (std::size_t e = 0; e < o.soc.size; ++e) {
      const double apart = r.soc[k] < o.soc[e] ? o.soc[e] - r.soc[k] : r.soc[k] - o.soc[e];
      if (apart > 1e-9 && apart < accepted::least_width)
        return {"rc.soc", k, "nodes on an edge of ocv.soc or 0.0005 or more away from it"};
    }
    if (k > 0 && outside(r.soc[k] - r.soc[k - 1], 0.001, 1)) return {"rc.soc", k, "nodes that ascend by 0.001 or more"};
    if (beyond(r.r0_ohm[k], accepted::resistance_ohm)) return {"rc.r0_ohm", k, "0.00001 to 0.5 ohm"};
    if (beyond(r.r1_ohm[k], accepted::resistance_ohm)) return {"rc.r1_ohm", k, "0.00001 to 0.5 ohm"};
    if (beyond(r.c1_f[k], accepted::capacitance_f)) return {"rc.c1_f", k, "100 to 1000000 F"};
    if (beyond(r.r1_ohm[k] * r.c1_f[k], accepted::time_constant_s))
      return {"rc.c1_f", k, "a time constant r1 * c1 of 0.2 to 50000 s"};
  }
  return {};
}

/// c_rate_1_a: the 1C current.
constexpr CellFault fault_of(const Noise& n, double c_rate_1_a) {
  if (outside(n.voltage_v, 1e-5, 0.5)) return {"noise.voltage_v", 0, "0.00001 to 0.5 V"};
  if (outside(n.model_v, 1e-5, 0.5)) return {"noise.model_v", 0, "0.00001 to 0.5 V"};
  if (beyond(n.model_correlation_s, accepted::lasts_s)) return {"noise.model_correlation_s", 0, "0 to 86400 s"};
  if (outside(n.v_rc_v, 1e-5, 0.5)) return {"noise.v_rc_v", 0, "0.00001 to 0.5 V"};
  if (outside(n.rest_v, 1e-4, 0.5)) return {"noise.rest_v", 0, "0.0001 to 0.5 V"};
  if (outside(n.current_a, 1e-7 * c_rate_1_a, c_rate_1_a))
    return {"noise.current_a", 0, "1e-7 to 1 times the 1C current"};
  if (outside(n.current_offset_a, 1e-6 * c_rate_1_a, c_rate_1_a))
    return {"noise.current_offset_a", 0, "1e-6 to 1 times the 1C current"};
  if (outside(n.current_offset_correlation_s, 1, 1e6))
    return {"noise.current_offset_correlation_s", 0, "1 to 1000000 s"};
  if (outside(n.current_unknown_a, accepted::unknown_c.low * c_rate_1_a, accepted::unknown_c.high * c_rate_1_a))
    return {"noise.current_unknown_a", 0, "0.001 to 10 times the 1C current"};

  if (outside(n.current_at_rest_a, 0, 0.1 * c_rate_1_a))
    return {"noise.current_at_rest_a", 0, "0 to 0.1 times the 1C current"};
  if (outside(n.current_gain, 0, accepted::most_gain)) return {"noise.current_gain", 0, "0 to 0.2"};
  return {};
}

constexpr CellFault fault_of(const Tolerance& t) {
  if (outside(t.ocv_v, 0, 0.1)) return {"tolerance.ocv_v", 0, "0 to 0.1 V"};
  if (outside(t.resistance_fraction, 0, accepted::most_resistance_error))
    return {"tolerance.resistance_fraction", 0, "0 to 1"};
  if (outside(t.initial_soc, 0, 1)) return {"tolerance.initial_soc", 0, "0 to 1"};
  if (outside(t.drift_v, 0, 0.1)) return {"tolerance.drift_v", 0, "0 to 0.1 V"};
  if (outside(t.resistance_per_ev, 0, accepted::most_resistance_per_ev))
    return {"tolerance.resistance_per_ev", 0, "0 to 1 eV"};
  return {};
}

constexpr CellFault fault_of(const IdentifiedRange& r) {
  constexpr double unknown = IdentifiedRange::unknown;
  const auto bad = [](double v, double low, double high) { return v != unknown && outside(v, low, high); };
  if (bad(r.temperature_min_c, -60, 100)) return {"range.temperature_min_c", 0, "-60 to 100 degrees C"};
  if (bad(r.temperature_max_c, r.temperature_min_c == unknown ? -60 : r.temperature_min_c, 100))
    return {"range.temperature_max_c", 0, "temperature_min_c to 100 degrees C"};
  if (bad(r.soc_min, 0, 1)) return {"range.soc_min", 0, "0 to 1"};
  if (bad(r.soc_max, r.soc_min == unknown ? 0 : r.soc_min, 1)) return {"range.soc_max", 0, "soc_min to 1"};
  if (bad(r.current_max_a, 0, accepted::current_a.high)) return {"range.current_max_a", 0, "0 to 2000 A"};
  if (bad(r.duration_s, 0, 1e9)) return {"range.duration_s", 0, "0 to 1e9 s"};
  return {};
}

}  // namespace parameters_detail

/// The first parameter outside `accepted`.
constexpr CellFault first_fault(const CellParameters<double>& p) {
  namespace d = parameters_detail;
  if (d::beyond(p.capacity_ah, accepted::capacity_ah)) return {"capacity_ah", 0, "0.01 to 1000 Ah"};
  if (d::beyond(p.reference_temperature_c, accepted::reference_temperature_c))
    return {"reference_temperature_c", 0, "-40 to 80 degrees C"};
  for (const CellFault& fault : {d::fault_of(p.limits), d::fault_of(p.ocv), d::fault_of(p.rc, p.ocv),
                                 d::fault_of(p.noise, p.capacity_ah), d::fault_of(p.tolerance), d::fault_of(p.range)}) {
    if (fault.what != nullptr) return fault;
  }
  return {};
}

}  // namespace bms::model
