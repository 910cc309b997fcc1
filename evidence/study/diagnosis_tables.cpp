// Tables of the diagnosis of the paper.
#include "study/diagnose_paper.hpp"
#include "study/paper_consistency.hpp"
#include "study/table_cells.hpp"

namespace bms::study {

namespace {

files::PageTable candidate_table(const PaperDiagnosis& d) {
  files::PageTable table{
      "candidates",
      "Candidates, fitted to Tables 5 to 8 and Appendix A at once",
      {"cell", "unknowns", "score", "weight", "Table 7: rank correlation", "without the diagonal",
       "median gap [points]"},
      {},
      "Score: minus the logarithm of the likelihood, with an unknown variance for each table and 36 figures that count "
      "as independent, plus the penalty of Schwarz for the unknowns; smaller is better. Weight: exp(-score), as a "
      "share."};
  for (const CandidateFit& c : d.candidates) {
    table.rows.push_back({label(c.effects.name()), label(fmt::format("{}", c.unknowns)), number_cell(c.score),
                          number_cell(c.weight), number_cell(c.table7.rank_correlation),
                          number_cell(c.table7.off_diagonal_rank_correlation),
                          number_cell(c.table7.median_gap_points)});
  }
  return table;
}

files::PageTable physics_table(const PaperDiagnosis& d) {
  files::PageTable table{
      "physics", "Unknowns of the best candidate", {"unknown", "value", "95 % interval", "unit"}, {}, ""};
  for (const PaperPhysics& p : d.physics)
    table.rows.push_back(
        {label(p.id), number_cell(p.value), label(fmt::format("{:.3g} to {:.3g}", p.low, p.high)), label(p.unit)});
  table.note =
      "Intervals count the figures that depend on each other once. A limit at a bound of the search says nothing.";
  return table;
}

files::PageTable held_out_table(const PaperDiagnosis& d) {
  files::PageTable table{"held_out",
                         "Prediction of figures that were not used in the fit",
                         {"predicted", "fitted", "rank correlation", "of the paper's equations", "median gap [points]",
                          "of the paper's equations", "typical factor", "of the paper's equations"},
                         {},
                         "Table 8: mean rank correlation of its four columns. Factor: of the error of a fit, or of the "
                         "figure itself."};
  const auto optional_cell = [](const std::optional<double>& v) { return v ? number_cell(*v) : label("-"); };
  for (std::size_t k = 0; k < d.held_out.size(); ++k) {
    const HeldOut &best = d.held_out[k], &plain = d.held_out_plain[k];
    table.rows.push_back({label(best.table == "A" ? "Appendix A" : "Table " + best.table), label(best.from),
                          optional_cell(best.rank_correlation), optional_cell(plain.rank_correlation),
                          optional_cell(best.median_gap_points), optional_cell(plain.median_gap_points),
                          number_cell(best.typical_ratio),
                          optional_cell(plain.typical_ratio > 0 ? std::optional(plain.typical_ratio) : std::nullopt)});
  }
  return table;
}

files::PageTable table7(const PaperDiagnosis& d) {
  files::PageTable table{
      "table7_diagnosed", "Table 7 of the best candidate", {"identified from"}, {}, "Fit in percent."};
  for (const char* name : experiment_names) table.head.emplace_back(name);
  for (std::size_t row = 0; row < paper_experiments; ++row) {
    std::vector<files::PageCell> cells = {label(experiment_names[row])};
    for (std::size_t k = 0; k < paper_experiments; ++k)
      cells.push_back(percent_cell(d.simulated[row * paper_experiments + k].value, paper_table(7).at(row, k)));
    table.rows.push_back(std::move(cells));
  }
  return table;
}

files::PageTable contradiction_table(const PaperDiagnosis& d) {
  files::PageTable table{
      "contradictions", "Figures that contradict the best candidate most", {"figure", "simulated"}, {}, ""};
  for (const Contradiction& c : d.contradictions)
    table.rows.push_back({label(c.figure), number_cell(c.simulated, c.published)});
  return table;
}

files::PageTable misfit_table(const PaperDiagnosis& d) {
  files::PageTable table{
      "misfits",
      "Tables against the best candidate",
      {"table", "in the fit", "from all other tables", "1 % limit", "largest difference", "meaning"},
      {},
      "In units of the difference that is expected between two such experiments. Single differences are limited."};
  for (const TableMisfit& m : d.misfits)
    table.rows.push_back({label(m.table), number_cell(m.used), m.left_out ? number_cell(*m.left_out) : label("-"),
                          number_cell(m.limit), label(fmt::format("{} ({:.1f})", m.worst_figure, m.worst)),
                          label(m.verdict())});
  return table;
}

files::PageTable consistency_table() {
  files::PageTable table{"consistency",
                         "Published figures that contradict each other, or the text",
                         {"figures", "they say", "meaning"},
                         {},
                         "From the published figures alone, without a simulation."};
  for (const Inconsistency& i : inconsistencies())
    table.rows.push_back({label(i.figures), label(i.observed), label(i.meaning)});
  return table;
}

}  // namespace

std::vector<files::PageTable> tables_of(const PaperDiagnosis& d) {
  return {consistency_table(), physics_table(d), candidate_table(d),    held_out_table(d),
          misfit_table(d),     table7(d),        contradiction_table(d)};
}

}  // namespace bms::study
