#include "reports/identify_page.hpp"

#include <fmt/format.h>

#include "reports/cell_charts.hpp"
#include "reports/report_page.hpp"

namespace bms::reports {

namespace id = identification;

namespace {

std::string file_name(const std::string& path) { return path.substr(path.rfind('/') + 1); }

const char* remark(const id::Parameter& p) {
  if (!p.identifiable) return "not identifiable";
  return p.at_bound ? "at its bound" : "";
}

files::PageTable parameter_table(const id::Identification& found) {
  files::PageTable table{
      "parameters",
      "Parameters",
      {"name", "SOC", "value", "standard deviation", "for white residuals", "effect of the OCV tolerance", "remarks"},
      {},
      ""};
  std::vector<id::Parameter> all = found.parameters;
  all.insert(all.end(), found.polynomials.begin(), found.polynomials.end());
  for (const id::Parameter& p : all) {
    table.rows.push_back({files::text_cell(p.name), files::text_cell(fmt::format("{:.0f} %", 100 * p.soc)),
                          files::text_cell(fmt::format("{:.5g}", p.value)),
                          files::text_cell(fmt::format("{:.2g}", p.std)),
                          files::text_cell(fmt::format("{:.2g}", p.std_white)),
                          files::text_cell(fmt::format("{:.2g}", p.by_ocv_tolerance)), files::text_cell(remark(p))});
  }
  return table;
}

std::vector<files::PageCell> fit_row(const std::string& name, const id::FitStatistics& f) {
  std::string ahead;
  for (const id::FitStatistics::PredictionError& a : f.ahead)
    ahead += fmt::format("{}{:.2f}", ahead.empty() ? "" : ", ", 1e3 * a.rmse_v);
  const id::ResidualAnalysis& r = f.residuals;
  return {files::text_cell(name),
          files::text_cell(fmt::format("{:.2f} mV", 1e3 * f.rmse_v)),
          files::text_cell(fmt::format("{:.2f} mV", 1e3 * f.largest_v)),
          files::text_cell(fmt::format("{:.1f} %", f.fit_percent)),
          files::text_cell(ahead + " mV"),
          files::text_cell(fmt::format("{:.2f}, {:.2f} mV", 1e3 * r.mean_v, 1e3 * r.mean_band_v)),
          files::text_cell(fmt::format("{:.0f} % autocorrelation, {:.0f} % correlation with the current",
                                       100 * r.autocorrelated, 100 * r.input_correlated))};
}

files::PageTable fit_table(const workflow::IdentifyResult& r) {
  files::PageTable table{"fits",
                         "Error of the simulated voltage, open loop",
                         {"recording", "RMS", "largest", "fit", "1, 10 and 60 steps ahead, RMS", "mean and its band",
                          "lags outside the white-noise band"},
                         {},
                         ""};
  table.rows.push_back(fit_row("identification data", r.identification.estimation));
  for (const auto& [path, fit] : r.validations) table.rows.push_back(fit_row(file_name(path), fit));
  return table;
}

void add_charts(const std::string& name, const id::Data& data, const id::FitStatistics& f, files::PageContent& page) {
  files::PageChart voltage{
      name + ": voltage", {"measured, V", "simulated, V"}, data.time_s.copy(), {data.voltage_v.copy(), {}}};
  files::PageChart error{name + ": measured minus simulated voltage, mV", {"mV"}, data.time_s.copy(), {{}}};
  for (Eigen::Index k = 0; k < f.error_v.size(); ++k) {
    voltage.columns[1].push_back(data.voltage_v[static_cast<std::size_t>(k)] - f.error_v[k]);
    error.columns[0].push_back(1e3 * f.error_v[k]);
  }
  page.charts.push_back(std::move(voltage));
  page.charts.push_back(std::move(error));
}

}  // namespace

std::string identify_report(const workflow::IdentifyResult& r) {
  const id::Identification& found = r.identification;
  files::PageContent page{
      "Identification by " + r.model + " and " + r.optimizer,
      fmt::format("{} samples, {:.2f} mV RMS open loop, fit {:.1f} %. {}", found.estimation.samples,
                  1e3 * found.estimation.rmse_v, found.estimation.fit_percent, found.optimum.reason),
      {},
      {parameter_table(found), fit_table(r)},
      {}};
  for (const measurement::Warning& w : r.warnings) page.warnings.push_back(w.text);
  if (r.cell_file) page.charts = cell_charts(*r.cell_file);
  add_charts("Identification data", r.data.front(), found.estimation, page);
  for (std::size_t k = 0; k < r.validations.size(); ++k)
    add_charts(file_name(r.validations[k].first), r.data[k + 1], r.validations[k].second, page);
  return page_of(page);
}

}  // namespace bms::reports
