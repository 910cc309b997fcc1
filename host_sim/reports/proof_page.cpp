#include "reports/proof_page.hpp"

#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "reports/embedded_files.hpp"
#include "reports/report_page.hpp"

namespace bms::reports {

namespace {

using nlohmann::json;

/// More than a screen can show.
json six_digits(double value) {
  return std::isfinite(value) ? json(std::stod(fmt::format("{:.6g}", value))) : json(nullptr);
}

json claim_row(const proof::ProofClaim& c) {
  json one = {{"claim", c.claim},         {"said", c.claimed}, {"measured", c.measured},
              {"tolerance", c.tolerance}, {"holds", c.holds},  {"verdict", c.verdict()}};
  one["within"] = c.within_uncertainty ? json(*c.within_uncertainty) : json(nullptr);
  if (c.number) {
    const proof::ProofNumber& n = *c.number;
    one["number"] = {{"said", n.claimed ? six_digits(*n.claimed) : json(nullptr)},
                     {"said_sigma", six_digits(n.claimed_sigma)},
                     {"measured", six_digits(n.measured)},
                     {"measured_sigma", six_digits(n.measured_sigma)},
                     {"allowed", six_digits(n.allowed)}};
  }
  if (c.errors)
    one["errors"] = {{"before", six_digits(1e3 * c.errors->before_v)},
                     {"after", six_digits(1e3 * c.errors->after_v)},
                     {"allowed", six_digits(c.errors->allowed)}};
  return one;
}

json points_of(const std::vector<proof::ProofPoints::Point>& points) {
  json list = json::array();
  for (const proof::ProofPoints::Point& p : points)
    list.push_back({six_digits(p.x), six_digits(p.y), six_digits(p.sigma)});
  return list;
}

json experiment_of(const proof::ProofExperiment& e) {
  json one = {{"title", e.title},        {"method", e.method},     {"holding", e.holding()}, {"notes", e.notes},
              {"claims", json::array()}, {"lines", json::array()}, {"bars", json::array()},  {"points", json::array()}};
  for (const proof::ProofClaim& c : e.claims) one["claims"].push_back(claim_row(c));
  for (const proof::ProofLines& l : e.lines) {
    json rows = json::array();
    for (std::size_t k = 0; k < l.x.size(); ++k) {
      json row = {six_digits(l.x[k])};
      for (const auto& column : l.columns) row.push_back(six_digits(column[k]));
      rows.push_back(std::move(row));
    }
    one["lines"].push_back({{"title", l.title}, {"labels", l.labels}, {"unit", l.x_unit}, {"rows", std::move(rows)}});
  }
  for (const proof::ProofBars& b : e.bars) {
    json rows = json::array();
    for (const proof::ProofBars::Row& r : b.rows)
      rows.push_back({{"name", r.name}, {"before", six_digits(r.before)}, {"after", six_digits(r.after)}});
    one["bars"].push_back({{"title", b.title}, {"unit", b.unit}, {"rows", std::move(rows)}});
  }
  for (const proof::ProofPoints& p : e.points) {
    json predicted = json::array();
    for (const proof::ProofPoints::Curve& c : p.predicted)
      predicted.push_back({{"name", c.name}, {"points", points_of(c.points)}});
    one["points"].push_back({{"title", p.title},
                             {"x", p.x_title},
                             {"y", p.y_title},
                             {"measured", points_of(p.measured)},
                             {"predicted", std::move(predicted)},
                             {"names", p.names}});
  }
  return one;
}

}  // namespace

std::string proof_report(const proof::ProofResult& r) {
  json content = {
      {"claims", r.claims()}, {"holding", r.holding()}, {"experiments", json::array()}, {"diagnoses", json::array()}};
  for (const proof::ProofExperiment& e : r.experiments) content["experiments"].push_back(experiment_of(e));
  for (const proof::ProofDiagnosis& d : r.diagnoses) {
    content["diagnoses"].push_back({{"name", d.name},
                                    {"verdict", d.verdict},
                                    {"found", d.found},
                                    {"before", six_digits(1e3 * d.before_v)},
                                    {"after", six_digits(1e3 * d.after_v)},
                                    {"wall_s", six_digits(std::round(d.wall_s))}});
  }
  return page(embedded::proof_html, embedded::proof_js, "bms proof",
              in_script(content.dump(-1, ' ', false, json::error_handler_t::replace)));
}

}  // namespace bms::reports
