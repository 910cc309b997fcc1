// Initial states, errata, and the verdicts on one run.
#include "study/statements.hpp"
#include "study/study_tables.hpp"
#include "study/table_cells.hpp"

namespace bms::study {

void show_initial_states(const Fitter& fitter, const StudyData& from_test, const StudyData& from_bursts,
                         Observations& observed, StudyResult& result) {
  files::PageTable table{
      "initial_states",
      "Initial states with the circuit of Appendix A fixed (3.2.4 and 4.2)",
      {"data", "v_rc [V]", "SOC [%]", "true SOC [%]", "fit"},
      {},
      "Only the two states are fitted, as in the paper. The paper finds 84.77 % for 80 % from the OCV "
      "test and 29.17 % for 40 % from the bursts."};
  const id::CircuitParameters circuit = appendix_a(from_test);
  struct Case {
    const StudyData& data;
    double paper_v_rc_v, paper_soc, paper_fit;
  };
  InitialSocObservation soc;
  for (const Case& c : {Case{from_test, 0.0573, 84.77, 71}, Case{from_bursts, 0.06703, 29.17, 74.55}}) {
    const InitialStates found = initial_states(fitter.cell(), c.data, circuit);
    table.rows.push_back({label(c.data.name), number_cell(found.v_rc_v, c.paper_v_rc_v),
                          number_cell(100 * found.soc, c.paper_soc), number_cell(100 * c.data.soc_from),
                          percent_cell(found.fit_percent, c.paper_fit)});
    const bool test = &c.data == &from_test;
    (test ? soc.from_ocv_test : soc.from_bursts) = found.soc;
    (test ? soc.of_ocv_test : soc.of_bursts) = c.data.soc_from;
  }
  observed.initial_soc = soc;
  result.tables.push_back(std::move(table));
}

void show_errata(StudyResult& result) {
  files::PageTable table{"errata", "Mistakes of the paper", {"where", "printed", "right", "why"}, {}, ""};
  for (const auto& row : text_table("errata").rows()) {
    table.rows.emplace_back();
    for (const std::string& field : row) table.rows.back().push_back(label(field));
  }
  result.tables.push_back(std::move(table));
}

void show_audit(StudyResult& result) {
  files::PageTable table{"audit",
                         "Every equation, table, figure, algorithm and statement of the paper: what does it here",
                         {"item", "files", "tests", "result"},
                         {},
                         "A test of the project checks that every file and test of this table exists."};
  for (const auto& row : text_table("audit").rows()) {
    table.rows.emplace_back();
    for (const std::string& text : row) table.rows.back().push_back(label(text));
  }
  result.tables.push_back(std::move(table));
}

void judge_all(const Observations& observed, StudyResult& result) {
  for (const Statement& s : statements()) {
    const Verdict verdict = judge(s.id, observed);
    result.claims.push_back({s.text, verdict.why, verdict.holds});
  }
}

}  // namespace bms::study
