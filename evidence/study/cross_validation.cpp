// Tables 7 and 8.
#include <cmath>

#include "study/study_tables.hpp"
#include "study/table_cells.hpp"

namespace bms::study {

namespace {

/// Row of table 7.
void add_fit_row(const id::Identification& found, const std::vector<StudyData>& parts, std::size_t row_number,
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
}

/// Row of table 8.
void add_sigma_row(const id::Identification& found, const std::string& name, std::size_t row_number, bool with_paper,
                   files::PageTable& table) {
  std::vector<files::PageCell> row = {label(name)};
  for (std::size_t k = 0; k < 3; ++k) {
    const id::Parameter& p = found.parameters[k];
    const auto paper = paper_number(with_paper, 8, row_number, k);
    row.push_back(p.at_bound ? failed("at its bound", paper) : number_cell(p.std, paper));
  }
  row.push_back(
      number_cell(std::sqrt(found.estimation.output_variance_v2), paper_number(with_paper, 8, row_number, 3)));
  for (std::size_t k = 0; k < 3; ++k) row.push_back(number_cell(found.parameters[k].std_white));
  table.rows.push_back(std::move(row));
}

}  // namespace

void cross_validate(Fitter& fitter, const std::vector<StudyData>& parts, bool with_paper, Observations& observed,
                    StudyResult& result) {
  files::PageTable fits{"table7",
                        "Fit of the grey box, identified from the row and validated with the column",
                        {"identified from"},
                        {},
                        ""};
  files::PageTable sigmas{"table8",
                          "Standard deviation of the parameters, and output variance",
                          {"identified from", "R0 [ohm]", "R1 [ohm]", "C1 [F]", "output variance [V]",
                           "for white residuals: R0 [ohm]", "R1 [ohm]", "C1 [F]"},
                          {},
                          ""};
  for (const StudyData& p : parts) fits.head.push_back(p.name);
  fits.head.push_back("mean of the others, RMSE");
  std::vector<id::Identification> identified;
  for (std::size_t k = 0; k < parts.size(); ++k) {
    identified.push_back(fitter.grey_box(parts[k], id::Method::trust_region_reflective, Start::paper));
    add_fit_row(identified.back(), parts, k, with_paper, fits);
    add_sigma_row(identified.back(), parts[k].name, k, with_paper, sigmas);
  }
  if (with_paper) observed.cross = observation_of(identified, parts);
  fits.note =
      "On the diagonal the estimation data are also the validation data. Here the plant has one RC branch, as the "
      "model "
      "has, and the residuals are close to its noise; the paper's cell is richer than its model, so its fits are lower "
      "and differ more. The table of statements shows what changes on richer cells.";
  sigmas.note =
      "The paper calls its last column a variance and gives volts: it is compared as a standard deviation. The paper's "
      "standard deviations are about as large as the parameters themselves. Those here follow from residuals of a "
      "millivolt; a run of correlated residuals counts once, except in the last three columns. The paper's OCV test "
      "has "
      "the smallest standard deviations of its table; whether that holds here is in the table of statements.";
  result.tables.push_back(std::move(fits));
  result.tables.push_back(std::move(sigmas));
}

}  // namespace bms::study
