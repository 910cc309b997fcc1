#include "diagnosis/experiment_plan.hpp"

#include <algorithm>
#include <cmath>

#include "diagnosis/diagnose.hpp"
#include "diagnosis/numerics.hpp"
#include "diagnosis/reference.hpp"
#include "diagnosis/thresholds.hpp"

namespace bms::diagnosis {

namespace {

constexpr const Thresholds::Design& plan_limits = thresholds.design;
constexpr const Numerics::Design& plan_numerics = numerics.design;

/// What a hypothesis' current sensor reads of a current: its laws inverted by bisection.
double read_a(const model::ChosenLaws<double>& laws, double true_a, double capacity_ah) {
  double low = 2 * std::min(true_a, 0.0) - capacity_ah, high = 2 * std::max(true_a, 0.0) + capacity_ah;
  for (int k = 0; k < plan_numerics.halvings; ++k) {
    const double middle = (low + high) / 2;
    (laws.true_current(middle) < true_a ? low : high) = middle;
  }
  return (low + high) / 2;
}

}  // namespace

ExperimentPlan planned(const experiments::Experiment& experiment, const PlanSetting& setting, double step_s) {
  experiments::ExperimentOptions options;
  options.capacity_ah = setting.capacity_ah;
  options.step_s = step_s;
  ExperimentPlan p{{}, bms::experiments::experiment(experiment.name, options).value()};
  PreparedRecording& r = p.record;
  r.initial_soc = experiment.start_soc;
  r.initial_soc_sigma = std::max(setting.cell.tolerance.initial_soc, plan_limits.initial_soc_at_least);
  for (const experiments::ProfileRow& row : p.rows) {
    r.time_s.edit().push_back(row.time_s);
    r.current_a.edit().push_back(row.current_a);
    r.voltage_v.edit().push_back(0);
    const bool given = std::isfinite(row.temperature_c);
    if (setting.temperature || given)
      r.temperature_c.edit().push_back(given ? row.temperature_c : setting.cell.reference_temperature_c);
  }
  return p;
}

double coarse_step_s(const experiments::Experiment& experiment, double duration_s) {
  return experiment.step_s < 1 ? experiment.step_s : std::max(1.0, std::ceil(duration_s / plan_limits.rows));
}

NoiseModel of_coarse_rows(NoiseModel noise, double step_s) {
  noise.white_v /= std::sqrt(std::max(step_s, 1.0));
  return noise;
}

std::vector<std::pair<double, const experiments::Experiment*>> courses(const PlanSetting& setting) {
  std::vector<std::pair<double, const experiments::Experiment*>> all;
  for (const experiments::Experiment& e : experiments::experiments()) {
    if (std::isfinite(e.start_soc))
      all.emplace_back(planned(e, setting, plan_limits.survey_step_s).record.duration_s(), &e);
  }
  std::stable_sort(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  return all;
}

PreparedRecording read_under(const std::vector<MechanismSetting>& settings, const ExperimentPlan& plan,
                             const model::CellParameters<>& cell, bool& within) {
  PreparedRecording r = plan.record;
  const model::ChosenLaws<double> laws = model::chosen<double>(settings, cell.capacity_ah);
  double known_a = 0, known_read_a = read_a(laws, 0, cell.capacity_ah);
  for (double& a : r.current_a.edit()) {
    if (a != known_a) {
      known_a = a;
      known_read_a = read_a(laws, a, cell.capacity_ah);
    }
    a = known_read_a;
  }
  std::vector<MechanismSetting> inside = settings;
  std::erase_if(inside, [](const MechanismSetting& s) { return knowledge_of(s.index).outside_cell; });
  std::vector<double> soc, current_ref_a, voltage_ref_v;
  const std::vector<double> volts = predict(cell, settings, r, &soc), terminal_v = predict(cell, inside, r);
  for (std::size_t k = 0; k < r.size(); ++k) {
    const experiments::ProfileRow& row = plan.rows[k];
    r.voltage_v.edit()[k] = std::isfinite(row.source_v) ? laws.reading(row.source_v) : volts[k];
    current_ref_a.push_back(row.current_ref_a());
    voltage_ref_v.push_back(row.voltmeter ? terminal_v[k] : row.source_v);
    within = within && soc[k] > plan_limits.soc_lowest && soc[k] < plan_limits.soc_highest &&
             volts[k] > cell.limits.voltage_min_v && volts[k] < cell.limits.voltage_max_v;
  }
  average_references(r, current_ref_a, voltage_ref_v, cell);
  return r;
}

}  // namespace bms::diagnosis
