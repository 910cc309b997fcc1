// Tables 7 and 8.
#include <algorithm>
#include <cmath>

#include "study/study_tables.hpp"
#include "study/table_cells.hpp"

namespace bms::study {

namespace {

// places among the paper's seven experiments
constexpr std::size_t burst_experiment = 3, ocv_experiment = 6;

/// Row of table 7; returns the mean RMSE [V] on the other data sets.
double add_fit_row(const id::Identification& found, const std::vector<StudyData>& parts, std::size_t row_number,
                   bool with_paper, files::PageTable& table) {
  std::vector<files::PageCell> row = {label(parts[row_number].name)};
  double others_v = 0;
  for (std::size_t column = 0; column < parts.size(); ++column) {
    const bool itself = column == row_number;
    const id::FitStatistics fit = itself ? found.estimation : Fitter::validated(found, parts[column]);
    row.push_back(percent_cell(fit.fit_percent, paper_number(with_paper, 7, row_number, column)));
    if (!itself) others_v += fit.rmse_v / static_cast<double>(parts.size() - 1);
  }
  row.push_back(millivolt_cell(others_v));
  table.rows.push_back(std::move(row));
  return others_v;
}

/// Row of table 8; returns true if C1 has the largest relative standard deviation.
bool add_sigma_row(const id::Identification& found, const std::string& name, std::size_t row_number, bool with_paper,
                   files::PageTable& table) {
  std::vector<files::PageCell> row = {label(name)};
  double relative[3] = {};
  for (std::size_t k = 0; k < 3; ++k) {
    const id::Parameter& p = found.parameters[k];
    const auto paper = paper_number(with_paper, 8, row_number, k);
    row.push_back(p.at_bound ? failed("at its bound", paper) : number_cell(p.std, paper));
    relative[k] = p.std / std::abs(p.value);
  }
  row.push_back(
      number_cell(std::sqrt(found.estimation.output_variance_v2), paper_number(with_paper, 8, row_number, 3)));
  row.push_back(number_cell(found.parameters[2].std_white));
  table.rows.push_back(std::move(row));
  return relative[2] >= relative[0] && relative[2] >= relative[1];
}

/// others_v: mean RMSE on the other experiments, for each of the paper's seven.
void add_paper_claims(const std::vector<double>& others_v, StudyResult& result) {
  std::vector<double> sorted = others_v;
  std::sort(sorted.begin(), sorted.end());
  const double ocv_v = others_v[ocv_experiment], burst_v = others_v[burst_experiment], median_v = sorted[3];
  result.claims.push_back(
      {"The OCV test identifies badly for a forklift",
       fmt::format("error on the others {:.2f} mV; the median experiment has {:.2f} mV", 1e3 * ocv_v, 1e3 * median_v),
       ocv_v >= sorted[5]});
  result.claims.push_back(
      {"1 min HIGH, 30 s LOW identifies well",
       fmt::format("error on the others {:.2f} mV; the best experiment has {:.2f} mV", 1e3 * burst_v, 1e3 * sorted[0]),
       burst_v <= median_v});
}

}  // namespace

void cross_validate(Fitter& fitter, const std::vector<StudyData>& parts, bool with_paper, StudyResult& result) {
  files::PageTable fits{"table7",
                        "Fit of the grey box, identified from the row and validated with the column",
                        {"identified from"},
                        {},
                        ""};
  files::PageTable sigmas{
      "table8",
      "Standard deviation of the parameters, and output variance",
      {"identified from", "R0 [ohm]", "R1 [ohm]", "C1 [F]", "output variance [V]", "if residuals were white: C1 [F]"},
      {},
      ""};
  for (const StudyData& p : parts) fits.head.push_back(p.name);
  fits.head.push_back("mean of the others, RMSE");
  std::vector<double> others_v;
  std::size_t c1_largest = 0;
  for (std::size_t k = 0; k < parts.size(); ++k) {
    const id::Identification found = fitter.grey_box(parts[k]);
    others_v.push_back(add_fit_row(found, parts, k, with_paper, fits));
    if (add_sigma_row(found, parts[k].name, k, with_paper, sigmas)) ++c1_largest;
  }
  fits.note =
      "On the diagonal the estimation data are also the validation data. Here the plant has one RC branch, as the "
      "model "
      "has, and the residuals are close to its noise. The paper's cell is richer than its model, so its fits are lower "
      "and differ more.";
  sigmas.note =
      "The paper calls its last column a variance and gives volts: it is compared as a standard deviation. The paper's "
      "standard deviations are about as large as the parameters themselves. Those here follow from residuals of a "
      "millivolt, where a run of correlated residuals counts once.";
  result.tables.push_back(std::move(fits));
  result.tables.push_back(std::move(sigmas));
  result.claims.push_back({"C1 has by far the largest relative standard deviation",
                           fmt::format("in {} of {} experiments", c1_largest, parts.size()),
                           2 * c1_largest > parts.size()});
  if (with_paper) add_paper_claims(others_v, result);
}

}  // namespace bms::study
