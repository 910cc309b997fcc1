#include "reports/json_study.hpp"

#include "reports/json_parts.hpp"

namespace bms::reports {

namespace {

Json claim_of(const proof::ProofClaim& c) {
  Json claim = {
      {"id", c.id}, {"claim", c.claim}, {"said", c.claimed}, {"measured", c.measured}, {"tolerance", c.tolerance}};
  claim["number"] = nullptr;
  if (const auto& n = c.number) {
    claim["number"] = {{"said", optional(n->claimed)},    {"said_std", number(n->claimed_sigma)},
                       {"measured", number(n->measured)}, {"measured_std", number(n->measured_sigma)},
                       {"allowed", number(n->allowed)},   {"unit", n->unit}};
  }
  claim["errors"] = nullptr;
  if (c.errors) {
    claim["errors"] = {{"before_v", number(c.errors->before_v)},
                       {"after_v", number(c.errors->after_v)},
                       {"allowed_ratio", c.errors->allowed}};
  }
  claim["within_uncertainty"] = c.within_uncertainty ? Json(*c.within_uncertainty) : Json(nullptr);
  claim["holds"] = c.holds;
  claim["verdict"] = c.verdict();
  return claim;
}

}  // namespace

std::string json_of(const proof::ProofResult& r) {
  Json json;
  json["command"] = "proof";
  json["claims"] = r.claims();
  json["holding"] = r.holding();
  json["experiments"] = Json::array();
  for (const proof::ProofExperiment& e : r.experiments) {
    Json one = {{"id", e.id},
                {"title", e.title},
                {"method", e.method},
                {"holding", e.holding()},
                {"claims", Json::array()},
                {"notes", e.notes}};
    for (const proof::ProofClaim& c : e.claims) one["claims"].push_back(claim_of(c));
    json["experiments"].push_back(std::move(one));
  }
  json["diagnoses"] = Json::array();
  for (const proof::ProofDiagnosis& d : r.diagnoses) {
    json["diagnoses"].push_back({{"name", d.name},
                                 {"verdict", d.verdict},
                                 {"statement", d.statement},
                                 {"found", d.found},
                                 {"before_v", number(d.before_v)},
                                 {"after_v", number(d.after_v)},
                                 {"wall_s", d.wall_s}});
  }
  json["wall_s"] = r.wall_s;
  return text_of(json);
}

}  // namespace bms::reports
