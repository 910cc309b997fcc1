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

/// A loop that needs more would tire any technician.
constexpr std::size_t most_rounds = 4;

bool has_rivals(const std::vector<std::vector<std::string>>& sets) {
  return std::any_of(sets.begin(), sets.end(), [](const auto& set) { return set.size() > 1; });
}

/// Returns true if causes are named and none has a rival.
bool decided(const Round& r) { return diagnosis::names(r.verdict) && !has_rivals(r.sets); }

/// Returns true if these are decided and true.
bool right(const Round& r, const truth::Answer& answer) {
  return decided(r) &&
         std::all_of(r.sets.begin(), r.sets.end(), [&](const auto& set) { return contains(answer.ids, set.front()); });
}

/// Returns true if the true effect is named and no other that was confused with it.
bool separated(const Round& r, const std::string& truth, const std::vector<std::string>& confused) {
  bool named = false, rival = false;
  for (const auto& set : r.sets) {
    named = named || contains(set, truth);
    for (const std::string& id : set) rival = rival || (id != truth && contains(confused, id));
  }
  return named && !rival;
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

const char* end_of(const FollowUp& up) {
  if (up.decided) return up.right ? "right" : "WRONG";
  if (up.nothing_more) return "nothing more can be learned";
  if (up.rounds.empty()) return "no experiment";
  const diagnosis::Verdict verdict = up.rounds.back().verdict;
  return diagnosis::names(verdict) ? "still ambiguous" : diagnosis::name_of(verdict);
}

std::optional<FollowUp> follow_up(const truth::Case& c, const model::CellParameters<>& cell,
                                  const diagnosis::PreparedRecording& recording, const diagnosis::Diagnosis& first) {
  if (first.verdict != diagnosis::Verdict::ambiguous || !c.run_test) return std::nullopt;
  FollowUp up;
  std::vector<diagnosis::PreparedRecording> records = {recording};
  std::vector<std::string> profiles;
  diagnosis::Diagnosis d = first;
  while (diagnosis::names(d.verdict) && has_rivals(sets_of(d)) && up.rounds.size() < most_rounds) {
    Round round;
    const auto begin = std::chrono::steady_clock::now();
    const auto next = diagnosis::next_experiment(cell, d, !recording.temperature_c.empty(), profiles);
    round.plan_wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    up.nothing_more = !next;
    if (!next) break;
    round.profile = next->profile;
    round.expected_gain = next->gain;
    round.duration_s = next->duration_s;
    profiles.push_back(next->profile);
    records.push_back(carried_out(c, cell, *next));
    d = diagnosis::diagnose(cell, {}, records);
    round.verdict = d.verdict;
    round.sets = sets_of(d);
    up.rounds.push_back(std::move(round));
  }

  if (up.rounds.empty()) return up;
  up.decided_at_once = decided(up.rounds.front());
  up.right_at_once = right(up.rounds.front(), c.answer);
  up.decided = decided(up.rounds.back());
  up.right = right(up.rounds.back(), c.answer);
  if (c.answer.ids.size() == 1)
    up.separated = separated(up.rounds.front(), c.answer.ids.front(), sets_of(first).front());
  return up;
}

}  // namespace bms::benchmark
