#include "reports/law_chart.hpp"

#include <cmath>

#include "diagnosis/law_change.hpp"
#include "diagnosis/texts.hpp"

namespace bms::reports {

namespace {

const char* title_of(const diagnosis::LawTerm& term) {
  if (term.law == "ocv") return "Change of the open-circuit voltage";
  return term.law == "ohmic" ? "Change of R0" : "Change of R1";
}

}  // namespace

nlohmann::json law_chart(const workflow::DiagnoseResult& r) {
  const std::optional<diagnosis::LawTerm>& term = r.diagnosis.law;
  if (!term) return nullptr;
  nlohmann::json curve = nlohmann::json::array();
  for (const diagnosis::LawChange& at : law_changes(r.diagnosis, r.cell.parameters))  // per cent, and mV or mOhm
    curve.push_back({std::round(1e4 * at.soc) / 1e2, std::round(1e6 * at.change) / 1e3});
  return {{"name", name_of_law(*term)},
          {"depends_on", term->depends_on},
          {"before_mv", 1e3 * term->left_out_before_v},
          {"after_mv", 1e3 * term->left_out_after_v},
          {"claim", term->mechanism ? diagnosis::claim(*term->mechanism) : ""},
          {"title", title_of(*term)},
          {"unit", term->law == "ocv" ? "mV" : "mΩ"},
          {"curve", std::move(curve)}};
}

}  // namespace bms::reports
