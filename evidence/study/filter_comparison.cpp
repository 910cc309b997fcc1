// Effect of filters on the current on the parameters (section 3.1).
#include "identification/prefilter.hpp"
#include "study/study_tables.hpp"
#include "study/table_cells.hpp"

namespace bms::study {

namespace {

void add_row(Fitter& fitter, const std::string& filter, const StudyData& part, files::PageTable& table) {
  const id::Identification found = fitter.grey_box(part);
  std::vector<files::PageCell> row = {label(filter)};
  for (std::size_t k = 0; k < 3; ++k) row.push_back(uncertain_cell(found.parameters[k].value, found.parameters[k].std));
  row.push_back(millivolt_cell(found.estimation.rmse_v));
  table.rows.push_back(std::move(row));
}

StudyData without_offset(StudyData part) {
  const id::Offset offset = id::offset_at_rest(part.data);
  for (double& i : part.data.current_a.edit()) i -= offset.current_a;
  return part;
}

StudyData filtered(StudyData part, const id::Prefilter& filter) {
  part.data = id::prefilter(part.data, filter).data;
  return part;
}

}  // namespace

void compare_filters(Fitter& fitter, const StudyData& without_any, StudyResult& result) {
  files::PageTable table{
      "filter",
      fmt::format("Filter on a current with an offset of 100 mA, and the parameters ({}, grey box)", without_any.name),
      {"filter", "R0 [ohm]", "R1 [ohm]", "C1 [F]", "RMSE"},
      {},
      ""};
  // the sensor of the paper has an offset (section 3.1)
  constexpr double offset_a = 0.1;
  StudyData part = without_any;
  for (double& i : part.data.current_a.edit()) i += offset_a;
  add_row(fitter, "none, current without offset", without_any, table);
  add_row(fitter, "none", part, table);
  add_row(fitter, "offset removed only", without_offset(part), table);
  add_row(fitter, "Butterworth 0.1 Hz, zero phase", filtered(part, {0.1, id::Phase::zero, true, {}}), table);
  add_row(fitter, "Butterworth 0.2 Hz, zero phase", filtered(part, {0.2, id::Phase::zero, true, {}}), table);
  add_row(fitter, "Butterworth 0.1 Hz, causal, voltage too", filtered(part, {0.1, id::Phase::causal, true, {}}), table);
  table.note =
      "A low-pass on the current alone smooths its edges, which the voltage still has: R0 and C1 become too large, R1 "
      "too small, and the residuals grow. If current and voltage pass the same filter, their relation is preserved, "
      "but "
      "the time of an edge is lost. The noise of this current changes the parameters by less than any of the filters. "
      "Nothing is therefore filtered unless the user asks for it.";
  result.tables.push_back(std::move(table));
}

}  // namespace bms::study
