#include "reports/json_study.hpp"
#include "reports/json_parts.hpp"

namespace bms::reports {

namespace {

Json statement_of(const study::StatementResult& s) {
  Json json = {
      {"id", s.id}, {"where", s.where}, {"statement", s.text}, {"holds_if", s.rule}, {"plants", Json::array()}};
  for (const study::StatementShare& p : s.shares) {
    json["plants"].push_back({{"plant", p.plant},
                              {"holds", p.holds},
                              {"judged", p.judged},
                              {"low", p.low},
                              {"high", p.high},
                              {"example", p.example}});
  }
  return json;
}

Json held_out_of(const study::HeldOut& h) {
  return {{"table", h.table},
          {"from", h.from},
          {"rank_correlation", optional(h.rank_correlation)},
          {"median_gap_points", optional(h.median_gap_points)},
          {"typical_ratio", h.typical_ratio > 0 ? Json(h.typical_ratio) : Json(nullptr)}};
}

Json match_of(const study::Table7Match& m) {
  return {{"rank_correlation", m.rank_correlation},
          {"off_diagonal_rank_correlation", m.off_diagonal_rank_correlation},
          {"median_gap_points", m.median_gap_points}};
}

}  // namespace

std::string json_of(const study::PaperDiagnosis& d) {
  Json json = {{"command", "study"}, {"statement", d.statement}};
  for (const study::PaperPhysics& p : d.physics)
    json["physics"].push_back({{"id", p.id}, {"value", p.value}, {"low", p.low}, {"high", p.high}, {"unit", p.unit}});
  json["effects"] = d.candidates.front().effects.name();
  for (const study::EffectVerdict& v : d.effects)
    json["verdicts"].push_back({{"effect", v.effect},
                                {"probability", v.probability},
                                {"present", v.present ? Json(*v.present) : Json(nullptr)}});
  json["table7"] = match_of(d.candidates.front().table7);
  json["table7_without_effects"] = match_of(d.plain.table7);
  for (const study::HeldOut& h : d.held_out) json["held_out_tables"].push_back(held_out_of(h));
  for (const study::HeldOut& h : d.held_out_plain) json["held_out_tables_without_effects"].push_back(held_out_of(h));
  for (const study::CandidateFit& c : d.candidates) {
    json["candidates"].push_back({{"effects", c.effects.name()},
                                  {"unknowns", c.unknowns},
                                  {"score", c.score},
                                  {"weight", c.weight},
                                  {"table7", match_of(c.table7)}});
  }
  for (const study::TableMisfit& m : d.misfits) {
    json["table_misfits"].push_back({{"table", m.table},
                                     {"in_fit", m.used},
                                     {"left_out", m.left_out ? Json(*m.left_out) : Json(nullptr)},
                                     {"limit", m.limit},
                                     {"contradicts", m.contradicts()}});
  }
  for (const study::Contradiction& c : d.contradictions)
    json["contradictions"].push_back({{"figure", c.figure}, {"published", c.published}, {"simulated", c.simulated}});
  json["wall_s"] = d.seconds;
  return text_of(json);
}

std::string json_of(const study::StudyResult& r) {
  Json json;
  json["command"] = "study";
  json["source"] = r.source;
  json["tables"] = Json::array();
  for (const files::PageTable& t : r.tables) {
    Json rows = Json::array();
    for (const auto& row : t.rows) {
      Json cells = Json::array();
      for (const files::PageCell& c : row) {
        Json cell = {{"text", c.text}};
        if (c.value) cell["value"] = *c.value;
        if (c.paper) cell["paper"] = *c.paper;
        cells.push_back(std::move(cell));
      }
      rows.push_back(std::move(cells));
    }
    json["tables"].push_back(
        {{"id", t.id}, {"title", t.title}, {"head", t.head}, {"rows", std::move(rows)}, {"note", t.note}});
  }
  json["claims"] = Json::array();
  for (const study::StudyClaim& c : r.claims)
    json["claims"].push_back(
        {{"claim", c.claim}, {"holds", c.holds ? Json(*c.holds) : Json(nullptr)}, {"evidence", c.result}});
  json["statements"] = Json::array();
  for (const study::StatementResult& s : r.statements) json["statements"].push_back(statement_of(s));
  json["identifications"] = r.fits;
  json["wall_s"] = r.seconds;
  json["warnings"] = warnings_of(r.warnings);
  return text_of(json);
}

}  // namespace bms::reports
