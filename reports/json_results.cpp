#include "reports/json_results.hpp"

#include <cmath>

#include <nlohmann/json.hpp>

#include "diagnosis/texts.hpp"

namespace bms::reports {

namespace {

using Json = nlohmann::ordered_json;

Json optional(const std::optional<double>& value) { return value ? Json(*value) : Json(nullptr); }

Json warnings_of(const std::vector<measurement::Warning>& warnings) {
  Json list = Json::array();
  for (const measurement::Warning& w : warnings) list.push_back(w.id + ": " + w.text);
  return list;
}

std::string text_of(const Json& json) { return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n"; }

}  // namespace

std::string json_of(const host_sim::ReplayResult& r, const std::string& trace_sha256) {
  Json json;
  json["command"] = "replay";
  json["recording"] = r.recording.path;
  json["samples"] = r.track.rows.size();
  json["duration_s"] = r.recording.duration_s();
  json["target"] = r.target;
  json["scalar"] = host_sim::name_of(r.scalar);
  json["cell"] = r.cell.name;
  json["initial_soc"] = r.initial_soc;
  json["soc"] = {{"final", r.soc.final},
                 {"final_sigma", r.soc.final_sigma},
                 {"rmse", optional(r.soc.rmse)},
                 {"max_error", optional(r.soc.max_error)},
                 {"rmse_after_30min", optional(r.soc.rmse_after_30min)},
                 {"max_error_after_30min", optional(r.soc.max_error_after_30min)},
                 {"within_2_sigma", optional(r.soc.within_2_sigma)},
                 {"current_offset_a", optional(r.soc.current_offset_a)},
                 {"current_offset_sigma_a", optional(r.soc.current_offset_sigma_a)}};
  json["voltage"] = {{"prediction_rmse_v", optional(r.voltage.prediction_rmse_v)},
                     {"prediction_max_v", optional(r.voltage.prediction_max_v)},
                     {"open_loop_rmse_v", optional(r.voltage.open_loop_rmse_v)},
                     {"open_loop_fit_percent", optional(r.voltage.open_loop_fit_percent)}};
  json["trace_sha256"] = trace_sha256;
  json["verified_against"] = r.verified_against ? Json(*r.verified_against) : Json(nullptr);
  if (r.difference) json["difference"] = *r.difference;
  json["steps_per_second"] = r.track.steps_per_second;
  json["read_mb_per_second"] = r.recording.read_mb_per_second;
  json["warnings"] = warnings_of(r.recording.warnings);
  return text_of(json);
}

std::string json_of(const SimulateResult& r) {
  return text_of({{"command", "simulate"},
                  {"cell", r.cell},
                  {"input", r.input},
                  {"out", r.out},
                  {"samples", r.samples},
                  {"duration_s", r.duration_s},
                  {"initial_soc", r.initial_soc},
                  {"final_soc", r.final_soc},
                  {"final_voltage_v", r.final_voltage_v},
                  {"steps_per_second", r.steps_per_second},
                  {"warnings", warnings_of(r.warnings)}});
}

std::string json_of(const ExperimentResult& r) {
  return text_of({{"command", "experiment"},
                  {"name", r.name},
                  {"out", r.out},
                  {"samples", r.samples},
                  {"duration_s", r.duration_s},
                  {"charged_ah", r.charged_ah},
                  {"discharged_ah", r.discharged_ah},
                  {"largest_current_a", r.largest_current_a}});
}

namespace {

Json fit_of(const identification::FitStatistics& f) {
  const identification::ResidualAnalysis& r = f.residuals;
  Json ahead = Json::array();
  for (const identification::FitStatistics::PredictionError& a : f.ahead)
    ahead.push_back({{"steps", a.steps}, {"rmse_v", a.rmse_v}});
  return {{"fit_percent", f.fit_percent},
          {"rmse_v", f.rmse_v},
          {"largest_v", f.largest_v},
          {"one_step_fit_percent", f.one_step_fit_percent},
          {"ahead", std::move(ahead)},
          {"output_variance_v2", f.output_variance_v2},
          {"samples", f.samples},
          {"residuals",
           {{"mean_v", r.mean_v},
            {"mean_band_v", r.mean_band_v},
            {"biased", r.biased()},
            {"correlation_length", r.correlation_length},
            {"white_band", r.white_band},
            {"autocorrelated", r.autocorrelated},
            {"input_correlated", r.input_correlated},
            {"autocorrelation", r.autocorrelation},
            {"input_correlation", r.input_correlation}}}};
}

}  // namespace

std::string json_of(const IdentifyResult& r) {
  const identification::Identification& i = r.identification;
  Json json;
  json["command"] = "identify";
  json["model"] = r.model;
  json["optimizer"] = r.optimizer;
  json["cell"] = r.cell;
  json["out"] = r.out;
  json["samples"] = i.estimation.samples;
  json["parameters"] = Json::array();
  for (const identification::Parameter& p : i.parameters) {
    json["parameters"].push_back({{"name", p.name},
                                  {"soc", p.soc},
                                  {"value", p.value},
                                  {"std", p.std},
                                  {"std_white", p.std_white},
                                  {"by_ocv_tolerance", p.by_ocv_tolerance},
                                  {"at_bound", p.at_bound},
                                  {"seen", p.identifiable}});
    if (p.temperature_c) json["parameters"].back()["temperature_c"] = *p.temperature_c;
  }
  json["correlation"] = Json::array();
  for (Eigen::Index row = 0; row < i.correlation.rows(); ++row) {
    const Eigen::VectorXd values = i.correlation.row(row);
    json["correlation"].push_back(std::vector<double>(values.data(), values.data() + values.size()));
  }
  json["estimation"] = fit_of(i.estimation);
  json["validation"] = r.validation ? fit_of(*r.validation) : Json(nullptr);
  json["validations"] = Json::array();
  for (const auto& [path, fit] : r.validations) {
    json["validations"].push_back(fit_of(fit));
    json["validations"].back()["recording"] = path;
  }
  const auto state = [](const identification::InitialState& s) {
    return Json{{"soc", s.soc}, {"soc_std", s.soc_std}, {"v_rc_v", s.v_rc_v}, {"observable", s.observable}};
  };
  json["initial_state"] = i.initial.empty() ? Json(nullptr) : state(i.initial.front());
  json["initial_states"] = Json::array();
  for (const identification::InitialState& s : i.initial) json["initial_states"].push_back(state(s));
  json["coulombic_efficiency"] = optional(r.coulombic_efficiency);
  json["iterations"] = i.optimum.iterations;
  json["evaluations"] = i.optimum.evaluations;
  json["gradient"] = i.optimum.gradient;
  json["converged"] = i.optimum.converged;
  json["reason"] = i.optimum.reason;
  json["starts"] = i.starts;
  json["starts_agreeing"] = i.agreeing;
  json["wall_s"] = r.wall_s;
  json["warnings"] = warnings_of(r.warnings);
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
    json["claims"].push_back({{"claim", c.claim}, {"holds", c.holds}, {"evidence", c.result}});
  json["identifications"] = r.fits;
  json["wall_s"] = r.seconds;
  json["warnings"] = warnings_of(r.warnings);
  return text_of(json);
}

namespace {

/// JSON has no infinity; what is not finite is not known.
Json number(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

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

Json mechanism_of(const diagnosis::Finding& f) {
  const model::MechanismInfo& info = model::catalogue[f.setting.index];
  const diagnosis::MechanismText& words = diagnosis::text_of_mechanism(f.setting.index);
  Json parameters = Json::array();
  for (std::size_t k = 0; k < info.parameters; ++k) {
    parameters.push_back({{"name", info.parameter[k].name},
                          {"value", number(f.setting.value[k])},
                          {"std", number(f.setting.deviation[k])},
                          {"unit", info.parameter[k].unit},
                          {"at_bound", k < f.at_bound.size() && f.at_bound[k] != 0}});
  }
  return {{"id", info.id},
          {"name", words.name},
          {"probability", number(f.probability)},
          {"equivalent_to", ids_of(f.equivalent_to)},
          {"parameters", std::move(parameters)},
          {"rms_contribution_v", number(f.rms_contribution_v)},
          {"gain", number(f.gain)},
          {"because", f.because},
          {"meaning", words.meaning},
          {"action", words.action}};
}

Json figures_of(const std::optional<workflow::OpenLoopFigures>& f) {
  return f ? Json{{"rmse_v", number(f->rmse_v)}, {"fit_percent", number(f->fit_percent)}} : Json(nullptr);
}

}  // namespace

std::string json_of(const workflow::DiagnoseResult& r) {
  const diagnosis::Diagnosis& d = r.diagnosis;
  Json json;
  json["command"] = "diagnose";
  json["cell"] = r.cell.name;
  json["recordings"] = Json::array();
  for (const workflow::RecordingComparison& c : r.recordings) {
    json["recordings"].push_back({{"path", c.recording.path},
                                  {"samples", c.record.size()},
                                  {"duration_s", c.record.duration_s()},
                                  {"initial_soc", c.record.initial_soc},
                                  {"initial_soc_sigma", c.record.initial_soc_sigma}});
  }
  json["holdouts"] = Json::array();
  for (const workflow::RecordingComparison& c : r.holdouts)
    json["holdouts"].push_back(
        {{"path", c.recording.path}, {"samples", c.record.size()}, {"initial_soc", c.record.initial_soc}});
  json["verdict"] = name_of(d.verdict);
  json["statement"] = d.statement;
  Json regimes = Json::array();
  for (const diagnosis::Regime& g : d.regimes)
    regimes.push_back({{"axis", g.axis},
                       {"from", number(g.from)},
                       {"to", number(g.to)},
                       {"share", number(g.share)},
                       {"usual", number(g.usual)}});
  json["location"] = {
      {"spans", spans_of(d.spans)}, {"regimes", std::move(regimes)}, {"explained_share", number(d.explained_share)}};
  json["mechanisms"] = Json::array();
  if (r.named()) {
    for (const diagnosis::Finding& f : d.findings) json["mechanisms"].push_back(mechanism_of(f));
  }
  json["candidates"] = Json::array();
  for (const diagnosis::Ranked& c : d.candidates) {
    json["candidates"].push_back({{"ids", ids_of(c.ids)},
                                  {"probability", number(c.probability)},
                                  {"log_likelihood_gain", number(c.gain)},
                                  {"explained_share", number(c.explained_share)}});
  }
  json["baseline"] = {{"recording", figures_of(r.baseline)}, {"holdout", figures_of(r.baseline_holdout)}};
  json["extended"] = {{"recording", figures_of(r.extended)}, {"holdout", figures_of(r.extended_holdout)}};
  json["soc"] =
      r.soc ? Json{{"baseline_rmse", r.soc->baseline_rmse}, {"extended_rmse", r.soc->extended_rmse}} : Json(nullptr);
  json["noise_floor_v"] = number(d.noise_floor_v);
  json["unexplained"] = {{"rmse_v", number(d.unexplained_rmse_v)}, {"share", number(d.unexplained_share)}};
  json["detection_limits"] = Json::array();
  for (const diagnosis::DetectionLimit& l : d.limits) {
    const model::MechanismInfo& info = model::catalogue[l.mechanism];
    json["detection_limits"].push_back({{"id", info.id},
                                        {"parameter", info.parameter[l.parameter].name},
                                        {"value", number(l.value)},
                                        {"unit", info.parameter[l.parameter].unit}});
  }
  json["not_testable"] = Json::array();
  for (const diagnosis::NotTestable& n : d.not_testable)
    json["not_testable"].push_back({{"id", model::catalogue[n.mechanism].id}, {"reason", n.reason}});
  json["next_experiment"] = nullptr;
  if (r.next) {
    json["next_experiment"] = {{"profile", r.next->profile},
                               {"separates", ids_of(r.next->separates)},
                               {"leaves", ids_of(r.next->leaves)},
                               {"why", diagnosis::why(*r.next)},
                               {"command", diagnosis::command(*r.next)},
                               {"instruction", diagnosis::instruction(*r.next)},
                               {"start_soc", number(r.next->start_soc)},
                               {"duration_s", number(r.next->duration_s)},
                               {"expected_gain", number(r.next->gain)}};
  }
  json["faults"] = Json::array();
  for (const diagnosis::DataFault& f : d.faults)
    json["faults"].push_back({{"id", f.id}, {"text", f.text}, {"spans", spans_of(f.spans)}});
  json["decision"] = {{"base_cost", number(d.base_cost)},     {"best_cost", number(d.best_cost)},
                      {"remaining", number(d.remaining)},     {"adequacy", number(d.adequacy)},
                      {"fast_excess", number(d.fast_excess)}, {"far_out", number(d.far_out)}};
  json["out"] = r.out;
  json["wall_s"] = r.wall_s;
  json["warnings"] = warnings_of(r.warnings);
  return text_of(json);
}

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
    for (const proof::ProofClaim& c : e.claims) {
      Json claim = {
          {"id", c.id}, {"claim", c.claim}, {"said", c.claimed}, {"measured", c.measured}, {"tolerance", c.tolerance}};
      claim["number"] = nullptr;
      if (const auto& n = c.number) {
        claim["number"] = {{"said", optional(n->claimed)},    {"said_std", number(n->claimed_sigma)},
                           {"measured", number(n->measured)}, {"measured_std", number(n->measured_sigma)},
                           {"allowed", number(n->allowed)},   {"unit", n->unit}};
      }
      claim["errors"] = nullptr;
      if (c.errors)
        claim["errors"] = {{"before_v", number(c.errors->before_v)},
                           {"after_v", number(c.errors->after_v)},
                           {"allowed_ratio", c.errors->allowed}};
      claim["within_uncertainty"] = c.within_uncertainty ? Json(*c.within_uncertainty) : Json(nullptr);
      claim["holds"] = c.holds;
      claim["verdict"] = c.verdict();
      one["claims"].push_back(std::move(claim));
    }
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
