#include "reports/cell_charts.hpp"

namespace bms::reports {

namespace {

constexpr const char* soc_axis = "state of charge, %";

double ocv_at(const model::OcvTable<double>& ocv, std::size_t edge) {
  const std::size_t k = edge + 1 < ocv.soc.size ? edge : edge - 1;
  return ocv.b0_v[k] + ocv.b1_v[k] * ocv.soc[edge];
}

files::PageChart ocv_chart(const model::OcvTable<double>& ocv) {
  files::PageChart chart{"Open-circuit voltage", {"OCV, V"}, {}, {{}}, {}, soc_axis};
  const bool gap = ocv.half_gap_v.size > 0;
  if (gap) {
    chart.title += ", band from slow discharge to slow charge";
    chart.labels = {"middle, V"};
    chart.half_band = {{}};
  }
  for (std::size_t k = 0; k < ocv.soc.size; ++k) {
    chart.time_s.push_back(100 * ocv.soc[k]);
    chart.columns[0].push_back(ocv_at(ocv, k) - (gap ? ocv.lean * ocv.half_gap_v[k] : 0));
    if (gap) chart.half_band[0].push_back(ocv.half_gap_v[k]);
  }
  return chart;
}

/// One column of the circuit, in `scale` units.
void add(const model::Column<double, model::max_rc_nodes>& values,
         const model::Column<double, model::max_rc_nodes>& std, double scale, files::PageChart& chart) {
  chart.columns.emplace_back();
  chart.half_band.emplace_back();
  for (std::size_t k = 0; k < values.size; ++k) {
    chart.columns.back().push_back(scale * values[k]);
    chart.half_band.back().push_back(k < std.size ? 2 * scale * std[k] : 0);
  }
}

}  // namespace

std::vector<files::PageChart> cell_charts(const files::CellFile& cell) {
  const model::RcTable<double>& rc = cell.parameters.rc;
  const bool known = rc.r0_std_ohm.size > 0 || rc.r1_std_ohm.size > 0 || rc.c1_std_f.size > 0;
  const char* band = known ? ", band of two standard deviations" : "";
  files::PageChart resistance{std::string("Resistances") + band, {"R0, mOhm", "R1, mOhm"}, {}, {}, {}, soc_axis},
      capacitance{std::string("C1") + band, {"C1, F"}, {}, {}, {}, soc_axis};
  for (std::size_t k = 0; k < rc.soc.size; ++k) {
    resistance.time_s.push_back(100 * rc.soc[k]);
    capacitance.time_s.push_back(100 * rc.soc[k]);
  }
  add(rc.r0_ohm, rc.r0_std_ohm, 1e3, resistance);
  add(rc.r1_ohm, rc.r1_std_ohm, 1e3, resistance);
  add(rc.c1_f, rc.c1_std_f, 1, capacitance);
  return {ocv_chart(cell.parameters.ocv), resistance, capacitance};
}

}  // namespace bms::reports
