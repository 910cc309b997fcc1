// Tables 4 to 6, figures 5 to 8.
#include <algorithm>
#include <limits>

#include "numerics/in_parallel.hpp"
#include "study/study_tables.hpp"
#include "study/table_cells.hpp"

namespace bms::study {

namespace {

using ModelFits = std::array<ModelFit, models>;

/// By optimiser.
using AllFits = std::array<ModelFits, methods.size()>;

AllFits every_fit(Fitter& fitter, const StudyData& estimation, const StudyData& validation, Start start) {
  AllFits fits;
  numerics::in_parallel(models * methods.size(), [&](std::size_t k) {
    const std::size_t m = k % methods.size(), model = models - 1 - k / methods.size();  // the slow ones first
    fits[m][model] = fitter.fit(model, estimation, methods[m], validation, start);
  });
  return fits;
}

std::string without_id(const std::string& warning) {
  const std::size_t colon = warning.find(": ");
  return colon == std::string::npos ? warning : warning.substr(colon + 2);
}

/// Table 4; sets for each model the fit with the smallest error, and the observations.
files::PageTable optimiser_table(Fitter& fitter, const StudyData& estimation, const StudyData& validation,
                                 bool with_paper, ModelFits& best, Observations& observed) {
  files::PageTable table{"table4",
                         fmt::format("Fit to the estimation data ({}), from the paper's start with {} iterations",
                                     estimation.name, paper_iterations),
                         {"optimiser", model_names[0], model_names[1], model_names[2], model_names[3]},
                         {},
                         ""};
  AllFits fits = every_fit(fitter, estimation, validation, Start::paper);
  for (std::size_t m = 0; m < methods.size(); ++m) {
    std::vector<files::PageCell> row = {label(method_names[m])};
    for (std::size_t k = 0; k < models; ++k) {
      ModelFit& fit = fits[m][k];
      const auto paper = paper_number(with_paper, 4, m, k);
      if (!fit.usable) {
        row.push_back(failed("no result: " + fit.why_not, paper));
        observed.no_model[k] = fit.why_not;
        continue;
      }
      row.push_back(percent_cell(fit.estimation.fit_percent, paper));
      if (!fit.optimum.converged) row.back().text += " (not converged)";
      observed.table4[m][k] = fit.estimation.fit_percent;
      if (!best[k].usable || fit.estimation.rmse_v < best[k].estimation.rmse_v) best[k] = std::move(fit);
    }
    table.rows.push_back(std::move(row));
  }
  for (std::size_t k = 0; k < models; ++k) {
    if (best[k].usable) observed.model[k] = observation_of(best[k]);
  }
  table.note =
      "Every search begins with R0, R1, C1 and b1 of section 3.2.4, through Eq. 12 to 16 for the linear models; "
      "Hammerstein-Wiener begins with the output error model that this start leads to. The paper does not state its "
      "limit of iterations; 20 is the default of the toolbox whose optimisers it names. Its recordings and currents "
      "are "
      "not published, so the pattern can be compared, not the digits.";
  return table;
}

/// The same from start values found in the data.
files::PageTable long_table(Fitter& fitter, const StudyData& estimation, const StudyData& validation) {
  files::PageTable table{
      "table4_search",
      "The same fits from start values found in the data, with 200 iterations",
      {"optimiser", model_names[0], model_names[1], model_names[2], model_names[3]},
      {},
      "Start values: the equation error refined by Steiglitz and McBride and a grid of poles for the "
      "linear models, the rests for the grey box. What differs from the table above is the start, "
      "not the model."};
  const AllFits fits = every_fit(fitter, estimation, validation, Start::search);
  for (std::size_t m = 0; m < methods.size(); ++m) {
    std::vector<files::PageCell> row = {label(method_names[m])};
    for (const ModelFit& fit : fits[m]) {
      row.push_back(fit.usable ? percent_cell(fit.estimation.fit_percent) : failed("no result: " + fit.why_not));
      if (fit.usable && !fit.optimum.converged) row.back().text += " (not converged)";
    }
    table.rows.push_back(std::move(row));
  }
  return table;
}

/// Table 5.
files::PageTable fit_table(const ModelFits& best, const StudyData& validation, bool with_paper) {
  files::PageTable table{
      "table5",
      fmt::format("Fit of each model with its best optimiser: estimation and validation ({})", validation.name),
      {"model", "estimation", "validation", "estimation RMSE", "validation RMSE", "one step ahead, validation",
       "one step ahead with the last error added", "bias on estimation data", "bias on validation data"},
      {},
      ""};
  const auto bias = [](const id::FitStatistics& f) {
    const id::ResidualAnalysis& r = f.residuals;
    return label(
        fmt::format("{:.2f} mV, band {:.2f} mV{}", 1e3 * r.mean_v, 1e3 * r.mean_band_v, r.biased() ? ": biased" : ""));
  };
  for (std::size_t k = 0; k < models; ++k) {
    const ModelFit& fit = best[k];
    if (!fit.usable) {
      table.rows.push_back({label(model_names[k]), failed("no result: " + fit.why_not), failed("no result"), label(""),
                            label(""), label(""), label(""), label(""), label("")});
      continue;
    }
    table.rows.push_back(
        {label(model_names[k]), percent_cell(fit.estimation.fit_percent, paper_number(with_paper, 5, k, 0)),
         percent_cell(fit.validation.fit_percent, paper_number(with_paper, 5, k, 1)),
         millivolt_cell(fit.estimation.rmse_v), millivolt_cell(fit.validation.rmse_v),
         percent_cell(fit.validation.one_step_fit_percent), percent_cell(fit.validation.corrected_one_step_fit_percent),
         bias(fit.estimation), bias(fit.validation)});
  }
  table.note =
      "RMSE is given next to the fit because fits of different recordings cannot be compared. The free response of the "
      "linear models is fitted on the validation data, which gives them its level. The grey box receives the state of "
      "charge; the voltage of its RC branch at the start is fitted on the validation data. All four structures have "
      "white noise on the output only, so their one-step prediction is their simulation; a prediction that adds the "
      "last "
      "error uses a disturbance model that the structures lack.";
  return table;
}

/// Table 6.
files::PageTable parameter_table(const ModelFits& best, bool with_paper) {
  files::PageTable table{
      "table6", "Parameters of each model", {"model", "b1 [V]", "R0 [ohm]", "R1 [ohm]", "C1 [F]", "remarks"}, {}, ""};
  constexpr std::array names = {"b1_v", "r0_ohm", "r1_ohm", "c1_f"};
  constexpr std::array<std::size_t, names.size()> columns = {3, 0, 1, 2};
  for (std::size_t k = 0; k < models; ++k) {
    const ModelFit& fit = best[k];
    if (!fit.usable) continue;
    std::vector<files::PageCell> row = {label(model_names[k])};
    for (std::size_t n = 0; n < names.size(); ++n) {
      const auto p = std::find_if(fit.parameters.begin(), fit.parameters.end(),
                                  [&](const id::Parameter& q) { return q.name == names[n]; });
      if (p == fit.parameters.end()) {
        row.push_back(label("given: the OCV pieces"));
        continue;
      }
      row.push_back(uncertain_cell(p->value, p->std, paper_number(with_paper, 6, k, columns[n])));
    }
    std::string remarks;
    for (const std::string& w : fit.warnings) remarks += (remarks.empty() ? "" : "; ") + without_id(w);
    row.push_back(label(remarks));
    table.rows.push_back(std::move(row));
  }
  table.note =
      "The paper gives C1 of the grey box as 3841.25 F in the text and 5841.25 F in its table. Its parameters of the "
      "linear models do not follow from its polynomials: see the errata.";
  return table;
}

/// Eq. 17, 21, 22.
files::PageTable polynomial_table(const ModelFits& best, bool with_paper) {
  files::PageTable table{
      "polynomials",
      "Polynomials of the linear models (Eq. 17, 21, 22)",
      {"model", "first", "second", "third", "first of the denominator", "second of the denominator"},
      {},
      "Transfer function: c0, c1, c2, a1, a2 of Eq. 11. Output error and Hammerstein-Wiener: b_1, b_2, "
      "b_3, f_1, f_2 of Eq. 19 and 20. They depend on the sampling time, which the paper does not "
      "state; here it is 1 s."};
  constexpr std::array<std::array<double, 5>, 2> printed = {
      {{0.01317, -0.02263, 0.00946, -1.82, 0.8203}, {0.009828, -0.01508, 0.005254, -1.835, 0.835}}};
  for (std::size_t k = 0; k < linear_models; ++k) {
    if (!best[k].usable) continue;
    std::vector<files::PageCell> row = {label(model_names[k])};
    for (std::size_t n = 0; n < best[k].polynomials.size(); ++n) {
      const id::Parameter& p = best[k].polynomials[n];
      const bool compare = with_paper && k < printed.size();
      row.push_back(uncertain_cell(p.value, p.std, compare ? std::optional(printed[k][n]) : std::nullopt));
    }
    table.rows.push_back(std::move(row));
  }
  return table;
}

/// Current and voltage of a data set with every model's simulation, and the error of each model.
void add_charts(const ModelFits& best, const StudyData& part, id::FitStatistics ModelFit::*statistics,
                const std::string& which, StudyResult& result) {
  files::PageChart overlay{
      fmt::format("{} ({}): current and voltage (Fig. 5), and each model (Fig. 6)", which, part.name),
      {"measured, V"},
      part.data.time_s.copy(),
      {part.data.voltage_v.copy()}};
  files::PageChart error{fmt::format("{}: error of each model, measured minus simulated, mV (Fig. 7)", which),
                         {},
                         part.data.time_s.copy(),
                         {}};
  for (std::size_t k = 0; k < models; ++k) {
    const Eigen::VectorXd& e = (best[k].*statistics).error_v;
    // data that were resampled for a model have other samples
    if (!best[k].usable || e.size() != static_cast<Eigen::Index>(part.data.size())) continue;
    overlay.labels.push_back(std::string(model_names[k]) + ", V");
    overlay.columns.emplace_back();
    error.labels.push_back(model_names[k]);
    error.columns.emplace_back();
    for (Eigen::Index row = 0; row < e.size(); ++row) {
      overlay.columns.back().push_back(part.data.voltage_v[static_cast<std::size_t>(row)] - e[row]);
      error.columns.back().push_back(1e3 * e[row]);
    }
  }
  overlay.labels.push_back("current, A");
  overlay.columns.push_back(part.data.current_a.copy());
  overlay.right = {"current, A"};
  result.charts.push_back(std::move(overlay));
  result.charts.push_back(std::move(error));
}

/// Fig. 8: what the last error adds to the one-step prediction of the structure.
void add_one_step_chart(const ModelFits& best, const StudyData& part, StudyResult& result) {
  files::PageChart chart{
      "Validation data: error one step ahead if the last error is added, mV (Fig. 8)", {}, part.data.time_s.copy(), {}};
  for (std::size_t k = 0; k < models; ++k) {
    const Eigen::VectorXd& e = best[k].validation.error_v;
    if (!best[k].usable || e.size() != static_cast<Eigen::Index>(part.data.size())) continue;
    const double decay = id::fading(id::without_missing(best[k].estimation.error_v));
    chart.labels.push_back(model_names[k]);
    chart.columns.push_back({std::numeric_limits<double>::quiet_NaN()});
    for (Eigen::Index row = 1; row < e.size(); ++row)
      chart.columns.back().push_back(1e3 * (e[row] - decay * e[row - 1]));
  }
  result.charts.push_back(std::move(chart));
}

}  // namespace

void compare_models(Fitter& fitter, const StudyData& estimation, const StudyData& validation, bool with_paper,
                    Observations& observed, StudyResult& result) {
  ModelFits best;
  result.tables.push_back(optimiser_table(fitter, estimation, validation, with_paper, best, observed));
  result.tables.push_back(long_table(fitter, estimation, validation));
  result.tables.push_back(fit_table(best, validation, with_paper));
  result.tables.push_back(parameter_table(best, with_paper));
  result.tables.push_back(polynomial_table(best, with_paper));
  add_charts(best, estimation, &ModelFit::estimation, "Estimation data", result);
  add_charts(best, validation, &ModelFit::validation, "Validation data", result);
  add_one_step_chart(best, validation, result);
}

}  // namespace bms::study
