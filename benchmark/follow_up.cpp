#include "benchmark/follow_up.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "benchmark/cause_ids.hpp"
#include "diagnosis/next_experiment.hpp"
#include "diagnosis/reference.hpp"

namespace bms::benchmark {

namespace {

/// The profile at the sampling rate of the recording, with the readings of the reference instruments that it asks for.
diagnosis::PreparedRecording carried_out(const truth::Case& c, const model::CellParameters<>& cell,
                                         const diagnosis::NextExperiment& next) {
  const double step_s = std::min(next.step_s, c.recording.time_s[1] - c.recording.time_s[0]);
  experiments::ExperimentOptions options;
  options.capacity_ah = next.capacity_ah;
  options.step_s = step_s;
  truth::TestPlan test_plan;
  test_plan.step_s = step_s;
  test_plan.start_soc = next.start_soc;
  std::vector<double> current_ref_a, voltage_ref_v;
  const std::vector<experiments::ProfileRow> rows = experiments::experiment(next.profile, options).value();
  for (const experiments::ProfileRow& row : rows) {
    test_plan.current_a.push_back(row.current_a);
    test_plan.ambient_c.push_back(row.temperature_c);
    test_plan.source_v.push_back(row.source_v);
    test_plan.measures_temperature = test_plan.measures_temperature || std::isfinite(row.temperature_c);
    current_ref_a.push_back(row.current_ref_a());
  }
  const truth::Series s = c.run_test(test_plan);
  for (std::size_t k = 0; k < rows.size(); ++k)
    voltage_ref_v.push_back(rows[k].voltmeter ? s.terminal_v[k] : rows[k].source_v);
  diagnosis::PreparedRecording r{
      next.profile, s.time_s, s.current_a, s.voltage_v, s.temperature_c, next.start_soc, cell.tolerance.initial_soc,
      true,         {}};
  diagnosis::average_references(r, current_ref_a, voltage_ref_v, cell);
  return r;
}

}  // namespace

std::vector<std::vector<std::string>> sets_of(const diagnosis::Diagnosis& d) {
  std::vector<std::vector<std::string>> sets;
  const auto id = [](std::size_t m) { return std::string(model::catalogue[m].id); };
  for (const diagnosis::Finding& f : d.findings) {
    auto& set = sets.emplace_back(1, id(f.setting.index));
    for (const std::size_t e : f.equivalent_to) set.push_back(id(e));
  }
  return sets;
}

std::optional<FollowUp> follow_up(const truth::Case& c, const model::CellParameters<>& cell,
                                  const diagnosis::PreparedRecording& recording, const diagnosis::Diagnosis& first) {
  if (first.verdict != diagnosis::Verdict::ambiguous || !c.run_test) return std::nullopt;
  FollowUp up;
  const auto begin = std::chrono::steady_clock::now();
  const auto next = diagnosis::next_experiment(cell, first, !recording.temperature_c.empty());
  up.plan_wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  if (!next) return up;
  up.profile = next->profile;
  up.expected_gain = next->gain;
  up.duration_s = next->duration_s;
  up.sets = sets_of(diagnosis::diagnose(cell, {}, {recording, carried_out(c, cell, *next)}));

  if (c.answer.ids.size() != 1) return up;
  const std::string& truth = c.answer.ids.front();
  const std::vector<std::string> confused = sets_of(first).front();
  bool named = false, rival = false;
  for (const auto& set : up.sets) {
    named = named || contains(set, truth);
    for (const std::string& id : set) rival = rival || (id != truth && contains(confused, id));
  }
  up.separated = named && !rival;
  return up;
}

}  // namespace bms::benchmark
