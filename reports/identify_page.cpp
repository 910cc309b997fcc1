#include "reports/identify_page.hpp"

#include <fmt/format.h>

#include "reports/report_page.hpp"

namespace bms::reports {

namespace id = identification;

std::string identify_report(const IdentifyResult& r, const std::vector<id::Data>& recordings) {
  const id::Identification& found = r.identification;
  files::PageContent content{
      "Identification by " + r.model + " and " + r.optimizer,
      fmt::format("{} samples, {:.2f} mV RMS open loop, fit {:.1f} %. {}", found.estimation.samples,
                  1e3 * found.estimation.rmse_v, found.estimation.fit_percent, found.optimum.reason),
      {},
      {},
      {}};
  for (const measurement::Warning& w : r.warnings) content.warnings.push_back(w.text);
  const auto cell = [](const std::string& text) { return files::PageCell{text, {}, {}}; };
  files::PageTable parameters{"parameters",
                              "Parameters",
                              {"name", "soc", "value", "standard deviation", "if residuals were white",
                               "if the OCV were off by its tolerance", "remarks"},
                              {},
                              ""};
  for (const id::Parameter& p : found.parameters) {
    parameters.rows.push_back({cell(p.name), cell(fmt::format("{:.0f} %", 100 * p.soc)),
                               cell(fmt::format("{:.5g}", p.value)), cell(fmt::format("{:.2g}", p.std)),
                               cell(fmt::format("{:.2g}", p.std_white)),
                               cell(fmt::format("{:.2g}", p.by_ocv_tolerance)),
                               cell(!p.identifiable ? "not seen"
                                    : p.at_bound    ? "at its bound"
                                                    : "")});
  }
  files::PageTable fits{"fits",
                        "How the voltage is followed, open loop",
                        {"recording", "RMSE", "largest", "fit", "1, 10 and 60 steps ahead, RMSE", "bias and its band",
                         "lags outside the white band"},
                        {},
                        ""};
  const auto add_fit = [&](const std::string& name, const id::FitStatistics& f) {
    std::string ahead;
    for (const id::FitStatistics::PredictionError& a : f.ahead)
      ahead += fmt::format("{}{:.2f}", ahead.empty() ? "" : ", ", 1e3 * a.rmse_v);
    ahead += " mV";
    fits.rows.push_back(
        {cell(name), cell(fmt::format("{:.2f} mV", 1e3 * f.rmse_v)), cell(fmt::format("{:.2f} mV", 1e3 * f.largest_v)),
         cell(fmt::format("{:.1f} %", f.fit_percent)), cell(ahead),
         cell(fmt::format("{:.2f}, {:.2f} mV", 1e3 * f.residuals.mean_v, 1e3 * f.residuals.mean_band_v)),
         cell(fmt::format("{:.0f} % of itself, {:.0f} % with the current", 100 * f.residuals.autocorrelated,
                          100 * f.residuals.input_correlated))});
  };
  add_fit("identified from", found.estimation);
  for (const auto& [path, fit] : r.validations) add_fit(path, fit);
  content.tables = {std::move(parameters), std::move(fits)};
  const auto add_charts = [&](const std::string& name, const id::Data& data, const id::FitStatistics& f) {
    files::PageChart voltage{name + ": voltage", {"measured, V", "simulated, V"}, data.time_s, {data.voltage_v, {}}},
        error{name + ": measured less simulated, mV", {"mV"}, data.time_s, {{}}};
    for (Eigen::Index k = 0; k < f.error_v.size(); ++k) {
      voltage.columns[1].push_back(data.voltage_v[static_cast<std::size_t>(k)] - f.error_v[k]);
      error.columns[0].push_back(1e3 * f.error_v[k]);
    }
    content.charts.push_back(std::move(voltage));
    content.charts.push_back(std::move(error));
  };
  add_charts("Identified from", recordings.front(), found.estimation);
  for (std::size_t k = 0; k < r.validations.size(); ++k)
    add_charts(r.validations[k].first, recordings[k + 1], r.validations[k].second);
  return page_of(content);
}

}  // namespace bms::reports
