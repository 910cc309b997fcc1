#include "host_sim/json_results.hpp"

#include <nlohmann/json.hpp>

namespace bms {

namespace {

using Json = nlohmann::ordered_json;

Json optional(const std::optional<double>& value) { return value ? Json(*value) : Json(nullptr); }

Json warnings_of(const std::vector<Warning>& warnings) {
  Json list = Json::array();
  for (const Warning& w : warnings) list.push_back(w.id + ": " + w.text);
  return list;
}

std::string text_of(const Json& json) { return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n"; }

}  // namespace

std::string json_of(const ReplayResult& r, const std::string& trace_sha256) {
  Json json;
  json["command"] = "replay";
  json["recording"] = r.recording.path;
  json["samples"] = r.track.rows.size();
  json["duration_s"] = r.recording.duration_s();
  json["target"] = r.target;
  json["scalar"] = name_of(r.scalar);
  json["cell"] = r.cell.name;
  json["initial_soc"] = r.initial_soc;
  json["soc"] = {{"final", r.soc.final},
                 {"final_sigma", r.soc.final_sigma},
                 {"rmse", optional(r.soc.rmse)},
                 {"max_error", optional(r.soc.max_error)},
                 {"rmse_after_30min", optional(r.soc.rmse_after_30min)},
                 {"max_error_after_30min", optional(r.soc.max_error_after_30min)},
                 {"within_2_sigma", optional(r.soc.within_2_sigma)}};
  json["voltage"] = {{"prediction_rmse_v", r.voltage.prediction_rmse_v},
                     {"prediction_max_v", r.voltage.prediction_max_v},
                     {"open_loop_rmse_v", r.voltage.open_loop_rmse_v},
                     {"open_loop_fit_percent", r.voltage.open_loop_fit_percent}};
  json["trace_sha256"] = trace_sha256;
  json["verified_against"] = r.verified_against ? Json(*r.verified_against) : Json(nullptr);
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

}  // namespace bms
