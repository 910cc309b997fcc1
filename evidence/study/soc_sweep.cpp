// Table 9, figures 12 to 14.
#include <algorithm>
#include <cmath>

#include "study/study_tables.hpp"
#include "study/table9_fit.hpp"
#include "study/table_cells.hpp"

namespace bms::study {

namespace {

constexpr const char* swept_experiment = "high_1m_low_30s";
constexpr int charted_tenth = 4;

void add_charts(Fitter& fitter, const StudyData& part, StudyResult& result) {
  const id::Identification found = fitter.grey_box(part);
  files::PageChart voltage{"1 min HIGH, 30 s LOW at 40 %: measured and simulated voltage (Fig. 12)",
                           {"measured, V", "simulated, V", "current, A"},
                           part.data.time_s.copy(),
                           {part.data.voltage_v.copy(), {}, part.data.current_a.copy()}};
  voltage.right = {"current, A"};
  files::PageChart error{"Its error (Fig. 13); one step ahead the structure predicts its simulation (Fig. 14)",
                         {"error, mV"},
                         part.data.time_s.copy(),
                         {{}}};
  const Eigen::VectorXd& e = found.estimation.error_v;
  for (Eigen::Index k = 0; k < e.size(); ++k) {
    voltage.columns[1].push_back(part.data.voltage_v[static_cast<std::size_t>(k)] - e[k]);
    error.columns[0].push_back(1e3 * e[k]);
  }
  result.charts.push_back(std::move(voltage));
  result.charts.push_back(std::move(error));
}

}  // namespace

void identify_over_soc(Fitter& fitter, const Bench& bench, std::uint64_t& seed, StudyResult& result) {
  constexpr double start_above = 0.01;  // the pulses discharge from their start
  std::vector<StudyData> parts;
  for (int tenth = 1; tenth <= 10; ++tenth)
    parts.push_back(run_on_bench(swept_experiment, std::min(1.0, tenth / 10.0 + start_above), bench, ++seed));
  add_charts(fitter, parts[charted_tenth - 1], result);
  const Table9Fit fit = fit_table9(fitter.cell(), parts);
  files::PageTable table{"table9",
                         "Grey box and OCV pieces in one fit, from 1 min HIGH, 30 s LOW at ten states of charge",
                         {"soc", "b0 [V]", "b1 [V]", "R0 [ohm]", "R1 [ohm]", "C1 [F]"},
                         {},
                         ""};
  for (std::size_t k = 0; k < fit.rows.size(); ++k) {
    const Table9Row& row = fit.rows[k];
    const auto paper = [&](std::size_t column) { return paper_table(9).at(k, column); };
    table.rows.push_back(
        {label(fmt::format("{:.0f} %", 100 * row.soc)), uncertain_cell(row.b0_v, row.b0_std_v, paper(3)),
         uncertain_cell(row.b1_v, row.b1_std_v, paper(4)), uncertain_cell(row.r0.value, row.r0.std, paper(0)),
         uncertain_cell(row.r1.value, row.r1.std, paper(1)), uncertain_cell(row.c1.value, row.c1.std, paper(2))});
  }
  table.note = fmt::format(
      "The plant is made from the paper's values, so here the paper's column is the truth, except near 10 and 90 %, "
      "where the OCV of the plant has rounded corners. The pieces meet at their corners by construction. R0, R1, C1 "
      "are "
      "the values at the SOC of the row and straight in between, so the row of 100 % uses data from 98 to 100 %. The "
      "piece from 0 to 10 % is seen only near its upper end. RMSE {:.2f} mV.",
      1e3 * fit.rmse_v);
  result.tables.push_back(std::move(table));
}

}  // namespace bms::study
