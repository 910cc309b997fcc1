// Tables 4 to 6, figures 5 to 8.
#include <algorithm>
#include <tuple>

#include "study/study_tables.hpp"
#include "study/table_cells.hpp"

namespace bms::study {

namespace {

using ModelFits = std::array<ModelFit, models>;

std::string without_id(const std::string& warning) {
  const std::size_t colon = warning.find(": ");
  return colon == std::string::npos ? warning : warning.substr(colon + 2);
}

/// Table 4, and for each model the fit with the smallest error and the one by steepest descent.
files::PageTable optimiser_table(Fitter& fitter, const StudyData& estimation, const StudyData& validation,
                                 bool with_paper, ModelFits& best, ModelFits& steepest) {
  files::PageTable table{"table4",
                         fmt::format("Fit to the estimation data ({}), open loop", estimation.name),
                         {"optimiser", model_names[0], model_names[1], model_names[2], model_names[3]},
                         {},
                         ""};
  for (std::size_t m = 0; m < methods.size(); ++m) {
    std::vector<files::PageCell> row = {label(method_names[m])};
    for (std::size_t k = 0; k < models; ++k) {
      ModelFit fit = fitter.fit(k, estimation, methods[m], validation);
      const auto paper = paper_number(with_paper, 4, m, k);
      if (fit.usable) {
        row.push_back(percent_cell(fit.estimation.fit_percent, paper));
        if (!fit.optimum.converged) row.back().text += " (not converged)";
      } else {
        row.push_back(failed("no result", paper));
      }
      if (methods[m] == id::Method::steepest_descent) steepest[k] = fit;
      if (fit.usable && (!best[k].usable || fit.estimation.rmse_v < best[k].estimation.rmse_v))
        best[k] = std::move(fit);
    }
    table.rows.push_back(std::move(row));
  }
  table.note =
      "The optimisers start from values that need no search: from the rests as in Appendix A for the grey box, from "
      "the "
      "equation error refined by Steiglitz and McBride for the linear models. The Gauss-Newton methods therefore do "
      "better here than in the paper, and steepest descent does not end far below zero: it stays near its start.";
  return table;
}

/// Table 5.
files::PageTable fit_table(const ModelFits& best, const StudyData& validation, bool with_paper) {
  files::PageTable table{
      "table5",
      fmt::format("Fit of each model with its best optimiser: estimation and validation ({})", validation.name),
      {"model", "estimation", "validation", "estimation RMSE", "validation RMSE", "one step ahead, validation",
       "bias on validation"},
      {},
      ""};
  for (std::size_t k = 0; k < models; ++k) {
    const ModelFit& fit = best[k];
    if (!fit.usable) {
      table.rows.push_back({label(model_names[k]), failed("no result"), failed("no result"), label(""), label(""),
                            label(""), label("")});
      continue;
    }
    const id::ResidualAnalysis& r = fit.validation.residuals;
    table.rows.push_back({label(model_names[k]),
                          percent_cell(fit.estimation.fit_percent, paper_number(with_paper, 5, k, 0)),
                          percent_cell(fit.validation.fit_percent, paper_number(with_paper, 5, k, 1)),
                          number_cell(1e3 * fit.estimation.rmse_v), number_cell(1e3 * fit.validation.rmse_v),
                          percent_cell(fit.validation.one_step_fit_percent),
                          label(fmt::format("{:.2f} mV, band {:.2f} mV", 1e3 * r.mean_v, 1e3 * r.mean_band_v))});
    table.rows.back()[3].text += " mV";
    table.rows.back()[4].text += " mV";
  }
  table.note =
      "RMSE is given next to the fit because fits of different recordings cannot be compared. The free response of the "
      "linear models is fitted on the validation data, which gives them its level; the grey box receives only the "
      "state "
      "of charge.";
  return table;
}

/// Table 6.
files::PageTable parameter_table(const ModelFits& best, bool with_paper) {
  files::PageTable table{
      "table6", "Parameters of each model", {"model", "R0 [ohm]", "R1 [ohm]", "C1 [F]", "remarks"}, {}, ""};
  for (std::size_t k = 0; k < models; ++k) {
    const ModelFit& fit = best[k];
    if (!fit.usable) continue;
    std::vector<files::PageCell> row = {label(model_names[k])};
    std::size_t column = 0;
    for (const char* name : {"r0_ohm", "r1_ohm", "c1_f"}) {
      const auto p = std::find_if(fit.parameters.begin(), fit.parameters.end(),
                                  [&](const id::Parameter& q) { return q.name == name; });
      row.push_back(uncertain_cell(p->value, p->std, paper_number(with_paper, 6, k, column)));
      ++column;
    }
    std::string remarks;
    for (const std::string& w : fit.warnings) remarks += (remarks.empty() ? "" : "; ") + without_id(w);
    row.push_back(label(remarks));
    table.rows.push_back(std::move(row));
  }
  table.note =
      "The paper gives C1 of the grey box as 3841.25 F in the text and 5841.25 F in its table. R1 and C1 of its "
      "transfer "
      "function do not follow from its Eq. 17.";
  return table;
}

void add_claims(const ModelFits& best, const ModelFits& steepest, StudyResult& result) {
  const auto rmse_v = [&](std::size_t k) { return best[k].validation.rmse_v; };
  const double grey_v = rmse_v(grey_box_model);
  bool first = best[grey_box_model].usable;
  for (std::size_t k = 0; k < linear_models; ++k) first = first && (!best[k].usable || grey_v <= rmse_v(k));
  result.claims.push_back({"The grey box is the best model on validation data",
                           fmt::format("validation RMSE {:.2f}, {:.2f}, {:.2f} and {:.2f} mV", 1e3 * rmse_v(0),
                                       1e3 * rmse_v(1), 1e3 * rmse_v(2), 1e3 * grey_v),
                           first});
  result.claims.push_back(
      {"Transfer function and output error cannot follow the OCV curve",
       fmt::format(
           "their validation RMSE is {:.2f} and {:.2f} times that of the grey box. They receive their level and "
           "slope on the validation data; between 50 and 20 % the OCV has only one knee",
           rmse_v(0) / grey_v, rmse_v(1) / grey_v),
       rmse_v(0) > 2 * grey_v && rmse_v(1) > 2 * grey_v});
  const auto converged = [](const ModelFit& fit) { return fit.usable && fit.optimum.converged; };
  result.claims.push_back({"Steepest descent fails on the linear models",
                           "it does not converge within its iterations on either",
                           !converged(steepest[0]) && !converged(steepest[1])});
}

/// Current and voltage of a data set, and the error of each model.
void add_charts(const ModelFits& best, const StudyData& part, id::FitStatistics ModelFit::*statistics,
                const std::string& error_title, StudyResult& result) {
  files::PageChart voltage{fmt::format("{}: current and voltage", part.name),
                           {"voltage, V", "current / 10, A"},
                           part.data.time_s.copy(),
                           {part.data.voltage_v.copy(), {}}};
  for (const double i : part.data.current_a) voltage.columns[1].push_back(i / 10);
  files::PageChart error{error_title, {}, part.data.time_s.copy(), {}};
  for (std::size_t k = 0; k < models; ++k) {
    if (!best[k].usable) continue;
    const Eigen::VectorXd& e = (best[k].*statistics).error_v;
    error.labels.push_back(model_names[k]);
    error.columns.emplace_back();
    for (Eigen::Index row = 0; row < e.size(); ++row) error.columns.back().push_back(1e3 * e[row]);
  }
  result.charts.push_back(std::move(voltage));
  result.charts.push_back(std::move(error));
}

}  // namespace

void compare_models(Fitter& fitter, const StudyData& estimation, const StudyData& validation, bool with_paper,
                    StudyResult& result) {
  ModelFits best, steepest;
  result.tables.push_back(optimiser_table(fitter, estimation, validation, with_paper, best, steepest));
  result.tables.push_back(fit_table(best, validation, with_paper));
  result.tables.push_back(parameter_table(best, with_paper));
  add_claims(best, steepest, result);
  add_charts(best, estimation, &ModelFit::estimation,
             "Estimation data: error of each model (measured minus simulated, mV)", result);
  add_charts(best, validation, &ModelFit::validation,
             "Validation data: error of each model (measured minus simulated, mV)", result);
}

}  // namespace bms::study
