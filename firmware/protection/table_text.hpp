// The table as Markdown, one line per protection, for README.md and its test. The firmware does not use it.
#pragma once

#include <cmath>
#include <cstdio>
#include <string>

#include "protection/table.hpp"

namespace bms::protection {

constexpr const char* text_of(Reaction r) {
  switch (r) {
    case Reaction::warn:
      return "warn";
    case Reaction::derate:
      return "derate";
    case Reaction::forbid_charge:
      return "forbid charge";
    case Reaction::forbid_discharge:
      return "forbid discharge";
    case Reaction::open:
      return "open";
    case Reaction::open_now:
      return "open now";
  }
  return "";
}
constexpr const char* text_of(Recovery r) {
  switch (r) {
    case Recovery::automatic:
      return "automatic";
    case Recovery::on_clear:
      return "clear command";
    case Recovery::service:
      return "service after a power cycle";
  }
  return "";
}

/// Name of a quantity, and its unit in the table.
struct QuantityText {
  const char* what = "";
  const char* unit = "";
  double scale = 1;  ///< integer units per unit
  int digits = 0;
};
/// Quantities of contactors, firmware and front end.
constexpr QuantityText text_of_event(Quantity q) {
  switch (q) {
    case Quantity::precharge_off_curve:
      return {"precharge below its curve"};
    case Quantity::welded:
      return {"a pole of the DC link stays connected, or current flows, while open"};
    case Quantity::not_closed:
      return {"DC link below the pack while closed"};
    case Quantity::sample_age_us:
      return {"time since the last sample", "s", 1e6, 1};
    case Quantity::integrity_error:
      return {"corrupted state, failed self-test, or watchdog reset"};
    case Quantity::storage_failed:
      return {"storage reports a failure"};
    case Quantity::second_line_trips:
      return {"a protection of the front end, other than short circuit, has opened"};
    case Quantity::second_line_broken:
      return {"the front end reports a permanent failure, or its enable pins do not follow"};
    case Quantity::current_difference_ua:
      return {"difference of the two current sensors that their gains do not explain", "A", 1e6, 1};
    case Quantity::temperatures_unknown:
      return {"no temperature of any sensor"};
    case Quantity::flows_unrequested:
      return {"current flows after the request has ended"};
    case Quantity::exceeds_allowed:
      return {"current above 1.1 times the allowed current plus the rest current"};
    case Quantity::charge_excess_us:
      return {"charge above the allowed charge current, as time of 1C or of a lower limit,", "s", 1e6, 1};
    case Quantity::discharge_excess_us:
      return {"charge above the allowed discharge current, as time of 1C or of a lower limit,", "s", 1e6, 1};
    case Quantity::largest_excess_us:
      return {"charge above the allowed current in the worse direction, as time of 1C or of a lower limit,", "s", 1e6,
              1};
    case Quantity::supply_dips:
      return {"supply of the controller has fallen below the detector's threshold"};
    case Quantity::temperatures_shorted:
      return {"thermistors shorted"};
    case Quantity::second_currents_missing:
      return {"second current sensor without a reading"};
    case Quantity::loop_open:
      return {"interlock loop open"};
    case Quantity::crashed:
      return {"crash or tilt sensor"};
    case Quantity::insulation_missing:
      return {"insulation monitor without a reading"};
    case Quantity::insulation_ohm:
      return {"insulation between battery and frame", "kohm", 1e3, 2};
    case Quantity::batteries_missing:
      return {"nothing arrives from a battery of the group, or no group is set"};
    default:
      return {};
  }
}
constexpr QuantityText text_of(Quantity q) {
  switch (q) {
    case Quantity::highest_cell_uv:
      return {"highest cell", "V", 1e6, 3};
    case Quantity::lowest_cell_uv:
      return {"lowest cell", "V", 1e6, 3};
    case Quantity::pack_uv:
      return {"pack", "V", 1e6, 2};
    case Quantity::charge_overload_i2t_us:
      return {"overload integral I²t of charging, above 1.05 of the limit", "s", 1e6, 0};
    case Quantity::discharge_overload_i2t_us:
      return {"overload integral I²t of discharging, above 1.05 of the limit", "s", 1e6, 0};
    case Quantity::current_magnitude_ua:
      return {"magnitude of the current", "A", 1e6, 1};
    case Quantity::highest_cdegc:
      return {"warmest sensor", "°C", 1e2, 0};
    case Quantity::lowest_cdegc:
      return {"coldest sensor", "°C", 1e2, 0};
    case Quantity::front_end_cdegc:
      return {"die of the measuring chip", "°C", 1e2, 0};
    case Quantity::opposite_shift_uv:
      return {"opposite shift of neighbours", "V", 1e6, 3};
    case Quantity::spread_uv:
      return {"highest minus lowest cell", "V", 1e6, 3};
    case Quantity::estimator_contradiction:
      return {"voltage rejected by the estimator"};
    case Quantity::sum_error_uv:
      return {"sum of cells minus pack", "V", 1e6, 3};
    case Quantity::voltages_missing:
      return {"voltages missing"};
    case Quantity::voltages_stuck:
      return {"cells stuck"};
    case Quantity::currents_missing:
      return {"current missing"};
    case Quantity::temperatures_missing:
      return {"sensors missing"};
    case Quantity::temperatures_stuck:
      return {"sensors stuck"};
    default:
      return text_of_event(q);
  }
}

/// The rows of a table with a header.
inline std::string markdown(const Table& table) {
  const auto number = [](double value, int digits) {
    char text[32];
    std::snprintf(text, sizeof text, "%.*f", digits, value);
    return std::string(text);
  };
  std::string out =
      "| bit | fault | raised when | for | released when | for | recovery | reaction | reason for the delay "
      "|\n|---|---|---|---|---|---|---|---|---|\n";
  for (std::size_t k = 0; k < fault_count; ++k) {
    const Rule& r = table[k].rule;
    const QuantityText q = text_of(r.quantity);
    const auto limit = [&](const char* sign, std::int32_t value) {
      return std::string(sign) + " " + number(value / q.scale, q.digits) +
             (*q.unit != '\0' ? std::string(" ") + q.unit : "");
    };
    const auto seconds = [&](std::uint32_t us) { return number(us / 1e6, us % 1'000'000 != 0 ? 1 : 0) + " s"; };
    const bool above = r.sense == Sense::above;
    out += "| " + std::to_string(k) + " | " + name_of(r.fault) + " | " + q.what + " " +
           limit(above ? ">" : "<", r.threshold) + " | " + seconds(r.delay_us) + " | " +
           limit(above ? "<=" : ">=", r.release) + " | " + seconds(r.recover_us) + " | " + text_of(r.recovery) + " | " +
           text_of(r.reaction) + " | " + table[k].why + " |\n";
  }
  return out;
}

}  // namespace bms::protection
