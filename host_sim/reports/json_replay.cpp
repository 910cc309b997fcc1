#include "reports/json_replay.hpp"

#include "files/recording_text.hpp"
#include "reports/json_parts.hpp"

namespace bms::reports {

std::string json_of(const replay::ReplayResult& r, const std::string& trace_sha256) {
  Json json;
  json["command"] = "replay";
  json["recording"] = r.recording.path;
  json["read_as"] = read_as(r.recording.read_as);
  json["samples"] = r.track.rows.size();
  json["duration_s"] = r.recording.duration_s();
  json["target"] = r.target;
  json["scalar"] = replay::name_of(r.scalar);
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
  json["soc_column"] = soc_column_of(r.soc_column);
  json["capacity"] =
      r.capacity ? Json({{"value_ah", r.capacity->value_ah}, {"std_ah", r.capacity->std_ah}}) : Json(nullptr);
  json["counted_capacity_ah"] = optional(r.counted_capacity_ah);
  json["reasons"] = r.reasons;
  json["reliable"] = r.doubts.empty();
  json["doubts"] = r.doubts;
  if (r.runs > 0) {
    json["run"] = r.run;
    json["runs"] = r.runs;
  }
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

std::string json_of(const replay::CutResult& r) {
  Json json;
  json["command"] = "replay";
  json["recording"] = r.recording;
  json["cell"] = r.cell;
  json["cuts"] = r.cuts;
  json["from_s"] = replay::cut_from_s;
  json["within_2_sigma_limits"] = replay::cut_inside_limits;
  json["starts"] = Json::array();
  for (const replay::CutFigures& f : r.starts) {
    Json start = {{"start", f.start.id},
                  {"median_rmse", f.median_rmse},
                  {"worst_rmse", f.worst_rmse},
                  {"max_error", f.largest},
                  {"median_rmse_after_knee", f.median_rmse_after_knee},
                  {"within_sigmas", f.inside},
                  {"worst_within_2_sigma", f.worst_inside},
                  {"cuts_below", f.cuts_below},
                  {"median_error_over_sigma", f.median_ratio},
                  {"median_sigma", f.median_sigma},
                  {"recovered", f.recovered}};
    for (const replay::CutRun& run : f.runs) {
      start["runs"].push_back({{"from_s", run.from_s},
                               {"duration_s", run.duration_s},
                               {"rmse", run.rmse},
                               {"rmse_after_knee", run.rmse_after_knee},
                               {"max_error", run.largest},
                               {"within_sigmas", run.inside},
                               {"median_error_over_sigma", run.median_ratio},
                               {"median_sigma", run.median_sigma},
                               {"knee_s", optional(run.knee_s)},
                               {"recovered_s", optional(run.recovered_s)}});
    }
    json["starts"].push_back(std::move(start));
  }
  return text_of(json);
}

std::string json_of(const measurement::Recording& r, const std::string& out) {
  Json repairs = Json::array();
  for (const measurement::Warning& w : r.warnings) {
    if (files::is_repair(w)) repairs.push_back(w.text);
  }
  return text_of({{"command", "import"},
                  {"recording", r.path},
                  {"read_as", read_as(r.read_as)},
                  {"out", out},
                  {"rows", r.rows()},
                  {"duration_s", r.duration_s()},
                  {"cells", r.cell_voltage_v.size()},
                  {"read_mb_per_second", r.read_mb_per_second},
                  {"repairs", repairs},
                  {"warnings", warnings_of(r.warnings)}});
}

std::string json_of(const files::FrameList& list, const std::string& log) {
  Json messages = Json::array();
  for (const files::ListedMessage& m : list.messages) {
    Json signals = Json::array();
    for (const files::ListedSignal& s : m.signals) {
      const bool any = s.values > s.missing;
      signals.push_back({{"name", s.name},
                         {"unit", s.unit},
                         {"values", s.values},
                         {"missing", s.missing},
                         {"lowest", any ? Json(s.lowest) : Json(nullptr)},
                         {"highest", any ? Json(s.highest) : Json(nullptr)},
                         {"column", s.column.empty() ? Json(nullptr) : Json(s.column)}});
    }
    messages.push_back({{"name", m.name},
                        {"id", m.id},
                        {"extended", m.long_id},
                        {"channel", m.channel},
                        {"frames", m.frames},
                        {"cycle_s", m.cycle_s()},
                        {"signals", signals}});
  }
  return text_of({{"command", "import"},
                  {"recording", log},
                  {"messages", messages},
                  {"unknown_frames", list.unknown_frames},
                  {"unknown_messages", list.unknown_messages}});
}

std::string json_of(const std::string& experiment, const std::string& out, const experiments::ProfileFigures& f) {
  return text_of({{"command", "experiment"},
                  {"name", experiment},
                  {"out", out},
                  {"samples", f.samples},
                  {"duration_s", f.duration_s},
                  {"charged_ah", f.charged_ah},
                  {"discharged_ah", f.discharged_ah},
                  {"largest_current_a", f.largest_current_a}});
}

}  // namespace bms::reports
