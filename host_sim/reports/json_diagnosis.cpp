#include "diagnosis/detection_limits.hpp"
#include "diagnosis/texts.hpp"
#include "diagnosis/withheld_text.hpp"
#include "reports/detectability.hpp"
#include "reports/json_cell.hpp"
#include "reports/json_parts.hpp"
#include "workflow/diagnosis_comparison.hpp"

namespace bms::reports {

namespace {

Json ids_of(const std::vector<std::size_t>& mechanisms) {
  Json ids = Json::array();
  for (const std::size_t m : mechanisms) ids.push_back(model::catalogue[m].id);
  return ids;
}

Json spans_of(const std::vector<model::Span>& spans) {
  Json list = Json::array();
  for (const model::Span& s : spans) list.push_back({{"start_s", s.start_s}, {"end_s", s.end_s}});
  return list;
}

Json parameters_of(const diagnosis::MechanismSetting& setting) {
  const model::MechanismInfo& info = model::catalogue[setting.index];
  Json parameters = Json::array();
  for (std::size_t k = 0; k < info.parameters; ++k) {
    parameters.push_back({{"name", info.parameter[k].name},
                          {"value", number(setting.value[k])},
                          {"std", number(setting.deviation[k])},
                          {"unit", info.parameter[k].unit}});
  }
  return parameters;
}

Json resistances_of(const std::vector<diagnosis::ResistanceAt>& resistances) {
  Json list = Json::array();
  for (const diagnosis::ResistanceAt& r : resistances)
    list.push_back({{"name", r.name},
                    {"value", number(r.here.ohm)},
                    {"std", number(r.here.std_ohm)},
                    {"reference_value", r.reference ? number(r.reference->ohm) : Json(nullptr)},
                    {"reference_std", r.reference ? number(r.reference->std_ohm) : Json(nullptr)},
                    {"unit", "ohm"}});
  return list;
}

Json mechanism_of(const diagnosis::Finding& f) {
  const diagnosis::MechanismText& text = diagnosis::text_of_mechanism(f.setting.index);
  Json parameters = parameters_of(f.setting);
  for (std::size_t k = 0; k < parameters.size(); ++k)
    parameters[k]["at_bound"] = k < f.at_bound.size() && f.at_bound[k] != 0;
  return {{"id", text.id},
          {"name", text.name},
          {"probability", number(f.probability)},
          {"equivalent_to", ids_of(f.equivalent_to)},
          {"parameters", std::move(parameters)},
          {"resistances", resistances_of(f.resistances)},
          {"rms_contribution_v", number(f.rms_contribution_v)},
          {"gain", number(f.gain)},
          {"because", f.because},
          {"meaning", text.meaning},
          {"action", text.action}};
}

Json figures_of(const std::optional<workflow::OpenLoopFigures>& f) {
  return f ? Json{{"rmse_v", number(f->rmse_v)}, {"fit_percent", number(f->fit_percent)}} : Json(nullptr);
}

Json inputs_of(const std::vector<workflow::RecordingComparison>& recordings) {
  Json list = Json::array();
  for (const workflow::RecordingComparison& c : recordings) {
    list.push_back({{"path", c.recording.path},
                    {"samples", c.record.size()},
                    {"duration_s", c.record.duration_s()},
                    {"initial_soc", c.record.initial_soc},
                    {"initial_soc_sigma", c.record.initial_soc_sigma}});
  }
  return list;
}

Json holdouts_of(const std::vector<workflow::RecordingComparison>& holdouts) {
  Json list = Json::array();
  for (const workflow::RecordingComparison& c : holdouts) {
    list.push_back({{"path", c.recording.path},
                    {"samples", c.record.size()},
                    {"initial_soc", c.record.initial_soc},
                    {"coverage", number(c.interval.coverage.share())},
                    {"half_width_v", number(c.interval.coverage.half_width_v())},
                    {"rmse_v", number(c.interval.coverage.error_v())}});
  }
  return list;
}

/// How each file was read.
Json formats_of(const std::vector<workflow::RecordingComparison>& recordings) {
  Json list = Json::array();
  for (const workflow::RecordingComparison& c : recordings) list.push_back(read_as(c.recording.read_as));
  return list;
}

/// Share of the readings within the 95 % interval of the extended cell.
Json coverage_of(const workflow::DiagnoseResult& r) {
  const auto share = [](const std::optional<diagnosis::Coverage>& c) { return c ? number(c->share()) : Json(nullptr); };
  return {{"nominal", diagnosis::nominal_coverage},
          {"recording", share(coverage(r.recordings))},
          {"holdout", share(coverage(r.holdouts))}};
}

Json location_of(const diagnosis::Diagnosis& d) {
  Json regimes = Json::array();
  for (const diagnosis::Regime& g : d.regimes) {
    regimes.push_back({{"axis", g.axis},
                       {"from", number(g.from)},
                       {"to", number(g.to)},
                       {"share", number(g.share)},
                       {"usual", number(g.usual)}});
  }
  return {
      {"spans", spans_of(d.spans)}, {"regimes", std::move(regimes)}, {"explained_share", number(d.explained_share)}};
}

Json candidates_of(const diagnosis::Diagnosis& d) {
  Json list = Json::array();
  for (const diagnosis::Ranked& c : d.candidates) {
    list.push_back({{"ids", ids_of(c.ids)},
                    {"probability", d.interrupted ? Json(nullptr) : number(c.probability)},
                    {"log_likelihood_gain", number(c.gain)},
                    {"explained_share", number(c.explained_share)}});
  }
  return list;
}

Json limits_of(const diagnosis::Diagnosis& d) {
  Json list = Json::array();
  for (const diagnosis::DetectionLimit& l : d.limits) {
    const model::MechanismInfo& info = model::catalogue[l.mechanism];
    list.push_back({{"id", info.id},
                    {"parameter", info.parameter[l.parameter].name},
                    {"value", number(l.value)},
                    {"unit", info.parameter[l.parameter].unit}});
  }
  return list;
}

/// How much speaks for each law that an unknown cause may act on, the likeliest first.
Json laws_of(const diagnosis::Diagnosis& d) {
  Json list = Json::array();
  for (const diagnosis::LawEvidence& e : d.law ? d.law->laws : std::vector<diagnosis::LawEvidence>{}) {
    if (e.law[0] != 0) list.push_back({{"law", e.law}, {"depends_on", e.depends_on}, {"evidence", number(e.gain)}});
  }
  return list;
}

Json estimates_of(const diagnosis::Diagnosis& d) {
  Json list = Json::array();
  for (const diagnosis::ChangeEstimate& e : d.estimates) {
    const model::MechanismInfo& info = model::catalogue[e.mechanism];
    list.push_back({{"id", info.id},
                    {"parameter", info.parameter[0].name},
                    {"value", number(e.value)},
                    {"std", number(e.std)},
                    {"unit", info.parameter[0].unit}});
  }
  return list;
}

Json range_of(const healthy_data::HealthyRange& r) {
  return r.known() ? Json{number(r.low), number(r.high)} : Json(nullptr);
}

Json beyond_of(const diagnosis::HealthyCoverage& covered) {
  Json list = Json::array();
  for (const diagnosis::BeyondHealthy& b : covered.beyond)
    list.push_back({{"axis", b.axis},
                    {"share", number(b.share)},
                    {"recorded", range_of(b.recorded)},
                    {"healthy", range_of(b.healthy)}});
  return list;
}

Json not_testable_of(const diagnosis::Diagnosis& d) {
  Json list = Json::array();
  for (const diagnosis::NotTestable& n : d.not_testable)
    list.push_back({{"id", model::catalogue[n.mechanism].id}, {"reason", n.reason}});
  return list;
}

/// Of an unfinished one.
Json search_of(const diagnosis::Diagnosis& d) {
  return d.interrupted ? Json{{"tried", ids_of(d.tried)}, {"not_tried", ids_of(d.not_tried)}} : Json(nullptr);
}

Json healthy_of(const diagnosis::Diagnosis& d) {
  const diagnosis::HealthyBasis h = d.healthy.value_or(diagnosis::HealthyBasis{});
  const bool decided = d.healthy && h.decided;
  return {{"hours", number(h.hours)},
          {"recordings", h.recordings},
          {"blocks", h.blocks},
          {"decided", decided},
          {"false_alarm_rate", decided ? number(h.false_alarm_rate) : Json(nullptr)},
          {"covered", d.healthy ? number(h.covered.share) : Json(nullptr)},
          {"least_covered", d.healthy ? number(h.covered.least) : Json(nullptr)},
          {"beyond", beyond_of(h.covered)}};
}

Json withheld_of(const diagnosis::Diagnosis& d) {
  Json list = Json::array();
  for (const diagnosis::Withheld& w : d.withheld) {
    Json parameters = Json::array();
    const bool known = w.mechanism != diagnosis::no_mechanism;
    for (std::size_t k = 0; known && k < model::catalogue[w.mechanism].parameters; ++k) {
      const model::Parameter& p = model::catalogue[w.mechanism].parameter[k];
      parameters.push_back({{"name", p.name},
                            {"value", number(w.setting.value[k])},
                            {"std", number(w.setting.deviation[k])},
                            {"unit", p.unit}});
    }
    const auto& needed = w.healthy.hours_needed;
    list.push_back({{"id", known ? std::string(model::catalogue[w.mechanism].id) : healthy_data::unknown_cause},
                    {"parameters", std::move(parameters)},
                    {"gain", number(w.gain)},
                    {"healthy_gain", number(w.healthy.healthy_gain)},
                    {"false_alarm", number(w.healthy.false_alarm)},
                    {"hours_needed", needed ? number(*needed) : Json(nullptr)},
                    {"reason", reason_of(w, d)}});
  }
  return list;
}

Json experiment_of(const diagnosis::NextExperiment& next, const std::string& then) {
  return {{"profile", next.profile},
          {"separates", ids_of(next.separates)},
          {"leaves", ids_of(next.leaves)},
          {"why", diagnosis::why(next)},
          {"command", diagnosis::command(next)},
          {"instruction", diagnosis::instruction(next)},
          {"then", then},
          {"start_soc", number(next.start_soc)},
          {"duration_s", number(next.duration_s)},
          {"expected_gain", number(next.gain)}};
}

/// The SOC column of the first recording that has one of its own; null without one.
Json soc_column_of_first(const workflow::DiagnoseResult& r) {
  for (const workflow::RecordingComparison& of : r.recordings) {
    if (of.soc_column) return soc_column_of(of.soc_column);
  }
  return nullptr;
}

}  // namespace

std::string json_of(const workflow::DiagnoseResult& r) {
  const diagnosis::Diagnosis& d = r.diagnosis;
  Json json;
  json["command"] = "diagnose";
  json["cell"] = r.cell.name;
  json["recordings"] = inputs_of(r.recordings);
  json["holdouts"] = holdouts_of(r.holdouts);
  json["holdouts_beyond"] = r.holdouts_beyond;
  json["verdict"] = name_of(d.verdict);
  json["statement"] = d.statement;
  json["location"] = location_of(d);
  json["mechanisms"] = Json::array();
  if (r.named()) {
    for (const diagnosis::Finding& f : d.findings) json["mechanisms"].push_back(mechanism_of(f));
  }
  json["search"] = search_of(d);
  json["healthy"] = healthy_of(d);
  json["withheld"] = withheld_of(d);
  json["candidates"] = candidates_of(d);
  json["baseline"] = {{"recording", figures_of(r.baseline)}, {"holdout", figures_of(r.baseline_holdout)}};
  json["extended"] = {{"recording", figures_of(r.extended)}, {"holdout", figures_of(r.extended_holdout)}};
  json["coverage"] = coverage_of(r);
  json["soc"] =
      r.soc ? Json{{"baseline_rmse", r.soc->baseline_rmse}, {"extended_rmse", r.soc->extended_rmse}} : Json(nullptr);
  json["noise_floor_v"] = number(d.noise_floor_v);
  json["unexplained"] = {{"rmse_v", number(d.unexplained_rmse_v)}, {"share", number(d.unexplained_share)}};
  json["law"] = d.law ? Json(d.law->law) : Json(nullptr);
  json["depends_on"] = d.law ? Json(d.law->depends_on) : Json::array();
  json["laws"] = laws_of(d);
  json["left_out"] = d.law && d.law->cell ? Json{{"before_rmse_v", number(d.law->left_out_before_v)},
                                                 {"after_rmse_v", number(d.law->left_out_after_v)}}
                                          : Json(nullptr);
  json["term"] = d.law && d.law->mechanism ? Json{{"id", model::catalogue[d.law->mechanism->index].id},
                                                  {"parameters", parameters_of(*d.law->mechanism)}}
                                           : Json(nullptr);
  json["detection_limits"] = limits_of(d);
  json["not_visible"] = ids_of(diagnosis::not_visible(d));
  json["isolability"] = isolability_json(d);
  json["estimates"] = estimates_of(d);
  json["resistances"] = d.resistances ? Json{{"temperature_c", number(d.resistances->temperature_c)},
                                             {"reference_c", number(d.resistances->reference_c)},
                                             {"step_s", number(d.resistances->step_s)},
                                             {"cell", resistances_of(d.resistances->cell)}}
                                      : Json(nullptr);
  json["not_testable"] = not_testable_of(d);
  json["next_experiment"] = r.next ? experiment_of(*r.next, r.then) : Json(nullptr);
  json["nothing_more"] = r.nothing_more.empty() ? Json(nullptr) : Json(r.nothing_more);
  json["faults"] = Json::array();
  for (const diagnosis::DataFault& f : d.faults)
    json["faults"].push_back({{"id", f.id}, {"text", f.text}, {"spans", spans_of(f.spans)}});
  json["decision"] = {{"base_cost", number(d.base_cost)},     {"best_cost", number(d.best_cost)},
                      {"remaining", number(d.remaining)},     {"adequacy", number(d.adequacy)},
                      {"fast_excess", number(d.fast_excess)}, {"far_out", number(d.far_out)}};
  json["soc_column"] = soc_column_of_first(r);
  json.update({{"out", r.out}, {"wall_s", r.wall_s}});
  json["read_as"] = formats_of(r.recordings);
  json["notes"] = warnings_of(r.notes);
  json["warnings"] = warnings_of(r.warnings);
  return text_of(json);
}

}  // namespace bms::reports
