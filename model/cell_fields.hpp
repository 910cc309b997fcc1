// All keys of a cell file, in their order in the file. Reader and writer both use this list.
#pragma once

#include "model/cell_parameters.hpp"

namespace bms::model {

/// Keys of an RC table: [rc] and each [[at_temperature]].
template <class Visitor, class Table>
void visit_rc(Visitor& visitor, Table& rc) {
  visitor.column("soc", rc.soc);
  visitor.column("r0_ohm", rc.r0_ohm);
  visitor.column("r1_ohm", rc.r1_ohm);
  visitor.column("c1_f", rc.c1_f);
  visitor.optional_column("r0_std_ohm", rc.r0_std_ohm);
  visitor.optional_column("r1_std_ohm", rc.r1_std_ohm);
  visitor.optional_column("c1_std_f", rc.c1_std_f);
}

/// Returns true if the range states anything.
inline bool is_known(const IdentifiedRange& r) {
  for (const double v :
       {r.temperature_min_c, r.temperature_max_c, r.soc_min, r.soc_max, r.current_max_a, r.duration_s}) {
    if (v != IdentifiedRange::unknown) return true;
  }
  return false;
}

/// Calls visitor.number(key, double&), .column(key, Column&), .optional_number (with the value of a file
/// without the key, 0 if not given), .optional_column, .optional_flag, .table(key) before the keys of a table, and
/// .optional_table(key, known), which returns true if the keys of that table follow.
template <class Visitor, class Parameters>
void visit_cell(Visitor& visitor, Parameters& p) {
  visitor.number("capacity_ah", p.capacity_ah);
  visitor.optional_number("reference_temperature_c", p.reference_temperature_c, default_reference_temperature_c);

  visitor.table("limits");
  visitor.number("voltage_min_v", p.limits.voltage_min_v);
  visitor.number("voltage_max_v", p.limits.voltage_max_v);
  visitor.number("charge_current_max_a", p.limits.charge_current_max_a);
  visitor.number("discharge_current_max_a", p.limits.discharge_current_max_a);
  visitor.number("temperature_min_c", p.limits.temperature_min_c);
  visitor.number("temperature_max_c", p.limits.temperature_max_c);

  visitor.table("ocv");
  visitor.column("soc", p.ocv.soc);
  visitor.column("b0_v", p.ocv.b0_v);
  visitor.column("b1_v", p.ocv.b1_v);
  visitor.optional_column("half_gap_v", p.ocv.half_gap_v);
  visitor.optional_number("lean", p.ocv.lean);

  visitor.table("rc");
  visit_rc(visitor, p.rc);

  visitor.table("noise");
  visitor.number("voltage_v", p.noise.voltage_v);
  visitor.number("model_v", p.noise.model_v);
  visitor.number("model_correlation_s", p.noise.model_correlation_s);
  visitor.number("v_rc_v", p.noise.v_rc_v);
  visitor.number("rest_v", p.noise.rest_v);
  visitor.number("current_a", p.noise.current_a);
  visitor.number("current_offset_a", p.noise.current_offset_a);
  visitor.number("current_offset_correlation_s", p.noise.current_offset_correlation_s);
  visitor.number("current_unknown_a", p.noise.current_unknown_a);
  visitor.optional_number("current_at_rest_a", p.noise.current_at_rest_a);
  visitor.optional_number("current_gain", p.noise.current_gain);
  visitor.optional_flag("errors_are_states", p.noise.errors_are_states);

  visitor.table("tolerance");
  visitor.number("ocv_v", p.tolerance.ocv_v);
  visitor.number("resistance_fraction", p.tolerance.resistance_fraction);
  visitor.number("initial_soc", p.tolerance.initial_soc);
  visitor.number("drift_v", p.tolerance.drift_v);
  visitor.optional_number("resistance_per_ev", p.tolerance.resistance_per_ev, default_resistance_per_ev);

  if (visitor.optional_table("range", is_known(p.range))) {
    constexpr double unknown = IdentifiedRange::unknown;
    visitor.optional_number("temperature_min_c", p.range.temperature_min_c, unknown);
    visitor.optional_number("temperature_max_c", p.range.temperature_max_c, unknown);
    visitor.optional_number("soc_min", p.range.soc_min, unknown);
    visitor.optional_number("soc_max", p.range.soc_max, unknown);
    visitor.optional_number("current_max_a", p.range.current_max_a, unknown);
    visitor.optional_number("duration_s", p.range.duration_s, unknown);
  }
}

}  // namespace bms::model
