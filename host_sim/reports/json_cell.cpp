#include "reports/json_cell.hpp"

#include "reports/json_parts.hpp"

namespace bms::reports {

std::string json_of(const files::CellFile& cell, const std::vector<std::string>& doubts) {
  const model::CellParameters<>& p = cell.parameters;
  const auto rated = [](double a) { return a != 0 ? Json(a) : Json(nullptr); };
  Json nodes = Json::array();
  for (std::size_t k = 0; k < p.rc.soc.size; ++k) {
    nodes.push_back(
        {{"soc", p.rc.soc[k]}, {"r0_ohm", p.rc.r0_ohm[k]}, {"r1_ohm", p.rc.r1_ohm[k]}, {"c1_f", p.rc.c1_f[k]}});
  }
  return text_of({{"command", "cell"},
                  {"cell", cell.name},
                  {"chemistry", cell.chemistry},
                  {"capacity_ah", p.capacity_ah},
                  {"limits",
                   {{"voltage_min_v", p.limits.voltage_min_v},
                    {"voltage_max_v", p.limits.voltage_max_v},
                    {"charge_current_max_a", p.limits.charge_current_max_a},
                    {"discharge_current_max_a", p.limits.discharge_current_max_a}}},
                  {"pulses",
                   {{"temperature_min_c", cell.pulses.stated() ? Json(cell.pulses.temperature_min_c) : Json(nullptr)},
                    {"charge_10s_a", rated(cell.pulses.charge.for_10s_a)},
                    {"charge_30s_a", rated(cell.pulses.charge.for_30s_a)},
                    {"discharge_10s_a", rated(cell.pulses.discharge.for_10s_a)},
                    {"discharge_30s_a", rated(cell.pulses.discharge.for_30s_a)}}},
                  {"rc", nodes},
                  {"doubts", doubts}});
}

std::string json_of(const replay::SimulationResult& r, const std::optional<diagnosis::Coverage>& coverage) {
  Json measured = nullptr;
  if (coverage) {
    measured = {{"nominal", diagnosis::nominal_coverage},
                {"recording", number(coverage->share())},
                {"half_width_v", number(coverage->half_width_v())},
                {"rmse_v", number(coverage->error_v())}};
  }
  return text_of({{"command", "simulate"},
                  {"cell", r.cell},
                  {"input", r.input},
                  {"read_as", read_as(r.read_as)},
                  {"out", r.out},
                  {"samples", r.samples},
                  {"duration_s", r.duration_s},
                  {"initial_soc", r.initial_soc},
                  {"final_soc", r.final_soc},
                  {"final_voltage_v", r.final_voltage_v},
                  {"coverage", measured},
                  {"steps_per_second", r.steps_per_second},
                  {"warnings", warnings_of(r.warnings)}});
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
          {"corrected_one_step_fit_percent", f.corrected_one_step_fit_percent},
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

Json parameters_of(const std::vector<identification::Parameter>& parameters) {
  Json list = Json::array();
  for (const identification::Parameter& p : parameters) {
    list.push_back({{"name", p.name},
                    {"soc", p.soc},
                    {"value", p.value},
                    {"std", p.std},
                    {"std_white", p.std_white},
                    {"by_ocv_tolerance", p.by_ocv_tolerance},
                    {"at_bound", p.at_bound},
                    {"seen", p.identifiable}});
    if (p.temperature_c) list.back()["temperature_c"] = *p.temperature_c;
  }
  return list;
}

Json matrix_of(const Eigen::MatrixXd& matrix) {
  Json rows = Json::array();
  for (Eigen::Index row = 0; row < matrix.rows(); ++row) {
    const Eigen::VectorXd values = matrix.row(row);
    rows.push_back(std::vector<double>(values.data(), values.data() + values.size()));
  }
  return rows;
}

Json left_out_of(const identification::LeftOutError& e) {
  return {{"recording", e.name},
          {"temperature_c", optional(e.temperature_c)},
          {"rmse_v", e.rmse_v},
          {"resistance_error", e.resistance_error},
          {"soc_error", e.soc_error},
          {"rest_v", e.rest_v},
          {"overpotential_v", e.overpotential_v},
          {"correlation_s", e.correlation_s},
          {"beyond_per_ev", e.beyond_per_ev}};
}

/// Null without --extend.
Json joint_of(const std::optional<workflow::JointResult>& joint) {
  if (!joint) return nullptr;
  const identification::StructureChoice& choice = joint->choice;
  Json json = {{"left_out", choice.left_out}, {"parts", choice.parts}};
  for (const identification::CandidateResult& c : choice.candidates) {
    json["candidates"].push_back({{"name", c.name},
                                  {"unknowns", c.unknowns},
                                  {"fitted_rmse_v", c.fitted_rmse_v},
                                  {"left_out_rmse_v", c.left_out_rmse_v},
                                  {"left_out_v", c.left_out_v},
                                  {"chosen", c.chosen}});
  }
  for (std::size_t k = 0; k < choice.model.unknowns.size(); ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    json["parameters"].push_back({{"name", choice.model.unknowns[k].name()},
                                  {"value", choice.fit.value[i]},
                                  {"std", choice.fit.std[i]},
                                  {"at_bound", choice.fit.at_bound[i] != 0}});
  }
  for (std::size_t k = 0; k < joint->recordings.size(); ++k) {
    json["recordings"].push_back({{"recording", joint->recordings[k]},
                                  {"rmse_v", choice.fit.rmse_v[k]},
                                  {"r0_change", choice.fit.states[k].r0_change},
                                  {"branch_position", choice.fit.states[k].branch_position}});
  }
  json["left_outs"] = json["held_out"] = Json::array();
  for (const identification::LeftOutError& e : choice.left_outs) json["left_outs"].push_back(left_out_of(e));
  for (std::size_t k = 0; k < joint->held_out.size(); ++k) {
    json["held_out"].push_back(left_out_of(joint->held_out[k]));
    if (k >= joint->coverage.size()) continue;
    json["held_out"].back()["coverage"] = number(joint->coverage[k].share());
    json["held_out"].back()["half_width_v"] = number(joint->coverage[k].half_width_v());
  }
  const identification::ModelErrors& errors = choice.errors;
  json["errors"] = {{"resistance_fraction", errors.resistance_fraction},
                    {"resistance_per_ev", errors.resistance_per_ev},
                    {"initial_soc", errors.initial_soc},
                    {"model_v", errors.model_v},
                    {"correlation_s", errors.correlation_s}};
  const identification::IdentifiedExtent& extent = choice.extent;
  json["extent"] = {{"temperature_min_c", optional(extent.temperature_min_c)},
                    {"temperature_max_c", optional(extent.temperature_max_c)},
                    {"soc_min", extent.soc_min},
                    {"soc_max", extent.soc_max},
                    {"current_max_a", extent.current_max_a},
                    {"duration_s", extent.duration_s}};
  return json;
}

}  // namespace

std::string json_of(const workflow::IdentifyResult& r) {
  const identification::Identification& i = r.identification;
  Json json;
  json["command"] = "identify";
  json["read_as"] = r.read_as;
  json["model"] = r.model;
  json["optimizer"] = r.optimizer;
  json["cell"] = r.cell;
  json["out"] = r.out;
  json["samples"] = i.estimation.samples;
  json["parameters"] = parameters_of(i.parameters);
  if (!i.polynomials.empty()) json["polynomials"] = parameters_of(i.polynomials);
  json["correlation"] = matrix_of(i.correlation);
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
  const healthy_data::HealthyData healthy = r.cell_file ? r.cell_file->healthy : healthy_data::HealthyData{};
  json["healthy"] = {
      {"hours", number(healthy.hours())}, {"recordings", healthy.recordings()}, {"blocks", healthy.blocks.size()}};
  json["joint"] = joint_of(r.joint);
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

}  // namespace bms::reports
