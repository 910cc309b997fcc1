// Table 9, figures 12 to 14.
#include <algorithm>
#include <cmath>
#include <limits>

#include "study/study_tables.hpp"
#include "study/table_cells.hpp"

namespace bms::study {

namespace {

constexpr const char* swept_experiment = "high_1m_low_30s";
constexpr int claimed_from_tenth = 3, claimed_to_tenth = 8;  ///< the OCV of the plant has rounded corners at the ends
constexpr int charted_tenth = 4;
constexpr double largest_r0_error = 0.01, largest_rc_error = 0.05;  ///< relative

void add_charts(const StudyData& part, const id::Identification& found, StudyResult& result) {
  files::PageChart voltage{"1 min HIGH, 30 s LOW at 40 %: measured and simulated (Fig. 12)",
                           {"measured, V", "simulated, V"},
                           part.data.time_s.copy(),
                           {part.data.voltage_v.copy(), {}}};
  files::PageChart error{"Its error (Fig. 13) and that one step ahead (Fig. 14), mV",
                         {"simulated", "one step ahead"},
                         part.data.time_s.copy(),
                         {{}, {std::numeric_limits<double>::quiet_NaN()}}};
  const Eigen::VectorXd& e = found.estimation.error_v;
  for (Eigen::Index k = 0; k < e.size(); ++k) {
    voltage.columns[1].push_back(part.data.voltage_v[static_cast<std::size_t>(k)] - e[k]);
    error.columns[0].push_back(1e3 * e[k]);
    if (k > 0) error.columns[1].push_back(1e3 * (e[k] - found.fading * e[k - 1]));
  }
  result.charts.push_back(std::move(voltage));
  result.charts.push_back(std::move(error));
}

}  // namespace

void identify_over_soc(Fitter& fitter, std::uint64_t& seed, StudyResult& result) {
  files::PageTable table{"table9",
                         "Grey box from 1 min HIGH, 30 s LOW at ten states of charge",
                         {"soc", "R0 [ohm]", "R1 [ohm]", "C1 [F]", "RMSE"},
                         {},
                         ""};
  double worst_r0 = 0, worst_rc = 0;
  for (int tenth = 1; tenth <= 10; ++tenth) {
    // the pulses discharge from their start
    const StudyData part = run_on_plant(swept_experiment, std::min(1.0, tenth / 10.0 + 0.01), ++seed);
    const id::Identification found = fitter.grey_box(part);
    std::vector<files::PageCell> row = {label(fmt::format("{} %", 10 * tenth))};
    for (std::size_t k = 0; k < 3; ++k) {
      const id::Parameter& p = found.parameters[k];
      const double paper = paper_table(9).at(static_cast<std::size_t>(tenth - 1), k);
      row.push_back(uncertain_cell(p.value, p.std, paper));
      if (tenth < claimed_from_tenth || tenth > claimed_to_tenth) continue;
      double& worst = k == 0 ? worst_r0 : worst_rc;
      worst = std::max(worst, std::abs(p.value / paper - 1));
    }
    row.push_back(millivolt_cell(found.estimation.rmse_v));
    table.rows.push_back(std::move(row));
    if (tenth == charted_tenth) add_charts(part, found, result);
  }
  table.note =
      "The plant is made from the paper's values, so here the paper's column is the truth. At 10 and 90 % the OCV of "
      "the "
      "plant has rounded corners where that of the model is sharp; the parameters compensate for it there.";
  result.tables.push_back(std::move(table));
  result.claims.push_back(
      {"The identified parameters are those of the plant",
       fmt::format("30 to 80 %: R0 within {:.1f} %, R1 and C1 within {:.1f} %", 100 * worst_r0, 100 * worst_rc),
       worst_r0 < largest_r0_error && worst_rc < largest_rc_error});
}

}  // namespace bms::study
