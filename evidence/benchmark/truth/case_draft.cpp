#include "benchmark/truth/case_draft.hpp"

#include <algorithm>
#include <cmath>

#include "benchmark/truth/calibration.hpp"
#include "benchmark/truth/data_faults.hpp"
#include "benchmark/truth/detection_scale.hpp"
#include "benchmark/truth/healthy_cells.hpp"
#include "benchmark/truth/laboratory.hpp"
#include "benchmark/truth/test_setting.hpp"

namespace bms::benchmark::truth {

namespace {

using Kinds = std::vector<const EffectKind*>;

constexpr double largest_similarity = 0.85;  // of the effects of a pair

/// Everything that is drawn before the effects.
struct Plan {
  HealthyCell cell;
  Laboratory lab;
  TestSetting setting, later_setting;
  SocRange range, later_range;
  std::uint64_t effect_seed = 0, instrument_seed = 0;
  std::vector<double> wanted;  ///< strength of each effect
};

/// The first recording with its effects.
struct Recorded {
  World healthy, full;
  MeasuredSeries measured;
  std::vector<ScaledEffect> effects;
  bool good = true;
};

bool needs_steady_ambient(const Kinds& kinds) {
  return std::any_of(kinds.begin(), kinds.end(), [](const EffectKind* k) { return k->needs_steady_ambient; });
}

Experiment draw_experiment(const Kinds& kinds, bool demanding, plant::Random& random) {
  std::vector<Experiment> wanted;
  for (const EffectKind* kind : kinds) wanted.push_back(kind->experiment(random));
  Experiment experiment = kinds.empty() ? any_profile() : joined(wanted);
  if (chance(random, 1.0 / 3)) experiment.profiles = any_profile().profiles;
  if (demanding) {
    if (chance(random, 0.6)) {
      experiment.current_scale = between(random, 1.3, 1.8);
      experiment.profiles = {Profile::multi_rate, Profile::drive_two_way, Profile::forklift_shift};
    }
    if (chance(random, 0.6)) experiment.swing_k = sign(random) * between(random, 8, 18);
  }
  if (experiment.swing_k == 0 && !needs_steady_ambient(kinds) && chance(random, 0.2))
    experiment.swing_k = sign(random) * between(random, 3, 12);
  return experiment;
}

Plan draw_plan(CaseKind case_kind, bool demanding, const Kinds& kinds, plant::Random& random, Strengths strengths) {
  Plan plan;
  plan.cell = draw_healthy_cell(random);
  plan.lab = draw_laboratory(plan.cell.capacity_ah, demanding, random);
  for (const EffectKind* kind : kinds) {
    if (kind->needs_temperature) plan.lab.measures_temperature = true;
  }
  Experiment experiment = draw_experiment(kinds, demanding, random);
  plan.setting = draw_setting(experiment, plan.lab.step_s, false, random);
  experiment.profiles = any_profile().profiles;
  plan.later_setting = draw_setting(experiment, plan.setting.step_s, true, random);
  if (needs_steady_ambient(kinds)) {
    for (TestSetting* s : {&plan.setting, &plan.later_setting}) {
      s->ambient = Ambient::constant;
      s->ambient_start_c = 25;
    }
  }
  if (chance(random, 0.35)) plan.range.lowest = between(random, 0.04, 0.25);
  if (chance(random, 0.35)) plan.later_range.lowest = between(random, 0.04, 0.25);

  // these draws must not change when the range of SOC is narrowed
  plan.effect_seed = random.bits();
  plan.instrument_seed = random.bits();
  for (std::size_t n = 0; n < kinds.size(); ++n)
    plan.wanted.push_back(case_kind == CaseKind::pair ? log_between(random, 2.6, 8)
                                                      : log_between(random, strengths.least, strengths.most));
  return plan;
}

/// Draws the effects and scales each to its wanted strength.
void add_effects(const Plan& plan, const Kinds& kinds, Recorded& recorded) {
  const World& healthy = recorded.healthy;
  const CellTrace trace = run_cell(plan.cell, {}, healthy.stimulus, healthy.start_soc);
  const DetectionScale detection_scale(plan.cell, healthy.stimulus, trace, white_v(plan.lab, plan.cell));
  std::vector<ScaledEffect>& effects = recorded.effects;
  for (std::size_t n = 0; n < kinds.size(); ++n) {
    plant::Random random(derived_seed(plan.effect_seed, n));
    const Effect effect = draw_effect(*kinds[n], plan.cell, healthy, random);
    const std::vector<ScaledEffect> known = kinds[n]->needs_other_effect ? effects : std::vector<ScaledEffect>{};
    effects.push_back(scale(plan.cell, healthy, known, effect, detection_scale, plan.wanted[n]));
  }
  if (effects.size() != 2) return;
  std::vector<std::vector<double>> shares_v;
  for (std::size_t n = 0; n < 2; ++n) {
    shares_v.push_back(difference_v(plan.cell, healthy, {effects[1 - n]}, {effects[n]}));
    effects[n].strength = detection_scale.strength(shares_v[n]);
  }
  recorded.good = std::abs(detection_scale.cosine_similarity(shares_v[0], shares_v[1])) < largest_similarity;
}

/// Repeats the test in a narrower range of SOC until it stays within the allowed one.
Recorded run_recording(const Plan& plan, const Kinds& kinds) {
  constexpr int most_runs = 5;
  constexpr double narrowest = 0.3;
  SocRange range = plan.range;
  Recorded recorded;
  for (int run = 1; run <= most_runs; ++run) {
    recorded.healthy = make_world(plan.cell, plan.setting, range, false);
    recorded.effects.clear();
    if (!kinds.empty()) add_effects(plan, kinds, recorded);
    recorded.full = with_effects(recorded.healthy, recorded.effects);
    recorded.measured = observe(plan.cell, recorded.full);
    if (!narrow(range, recorded.measured.trace.soc) || range.highest - range.lowest < narrowest) break;
    if (run == most_runs) recorded.good = false;
  }
  return recorded;
}

struct HoldOut {
  World healthy, world;
  MeasuredSeries measured;
  bool good = true;
};

HoldOut run_holdout(const Plan& plan, const std::vector<ScaledEffect>& effects) {
  constexpr int most_runs = 6;
  SocRange range = plan.later_range;
  HoldOut holdout;
  for (int run = 1; run <= most_runs; ++run) {
    holdout.healthy = make_world(plan.cell, plan.later_setting, range, true);
    holdout.world = with_effects(holdout.healthy, effects);
    holdout.measured = observe(plan.cell, holdout.world);
    if (!narrow(range, holdout.measured.trace.soc)) return holdout;
  }
  holdout.good = false;
  return holdout;
}

bool strength_wanted(CaseKind kind, const ScaledEffect& s, double least) {
  if (kind == CaseKind::pair) return s.strength >= 2 && s.strength <= 12;
  // nobody would report a smaller amplitude, so at the smallest one the effect may be clearly visible
  const bool smallest = s.amplitude <= s.effect.drawn.least * 1.001;
  return s.strength >= 0.9 * least && (s.strength <= 9 || smallest);
}

/// Time and SOC where the difference exceeds 20 % of its maximum.
void locate(const std::vector<double>& difference_v, double step_s, const std::vector<double>& soc, Answer& answer) {
  double most = 0;
  for (double v : difference_v) most = std::max(most, std::abs(v));
  bool any = false;
  for (std::size_t k = 0; k < difference_v.size(); ++k) {
    if (std::abs(difference_v[k]) <= 0.2 * most) continue;
    const double time_s = static_cast<double>(k) * step_s;
    if (!any) {
      answer.start_s = time_s;
      answer.soc_from = soc[k];
      answer.soc_to = soc[k];
    }
    any = true;
    answer.end_s = time_s;
    answer.soc_from = std::min(answer.soc_from, soc[k]);
    answer.soc_to = std::max(answer.soc_to, soc[k]);
  }
}

Answer answer_of(const Plan& plan, const Recorded& recorded, const Series& recording) {
  Answer answer;
  for (const ScaledEffect& s : recorded.effects) {
    answer.ids.emplace_back(s.effect.kind->id);
    answer.strengths.push_back(s.strength);
    answer.amplitudes.push_back(s.amplitude);
    for (const char* law : s.effect.kind->laws) {
      if (law != nullptr) answer.laws.emplace_back(law);
    }
    answer.repeats_in_holdout = answer.repeats_in_holdout && s.effect.kind->repeats_in_holdout;
  }
  if (!recorded.effects.empty()) {
    answer.strength = *std::min_element(answer.strengths.begin(), answer.strengths.end());
    const std::vector<double> d = difference_v(plan.cell, recorded.healthy, {}, recorded.effects);
    answer.effect_rms_v = rms(d);
    locate(d, recorded.healthy.stimulus.step_s, recorded.measured.trace.soc, answer);
  }
  const std::vector<double> clean_v = converted_v(recorded.full, recorded.measured.voltage_v);
  std::vector<double> noise_v = recording.voltage_v;
  for (std::size_t k = 0; k < noise_v.size(); ++k) noise_v[k] -= clean_v[k];
  answer.noise_floor_v = rms(noise_v);
  answer.profile = name_of(plan.setting.profile);
  return answer;
}

/// A later test: noise and drift are new, the effects are the same.
Series run_test_plan(const HealthyCell& cell, const std::vector<ScaledEffect>& effects, Laboratory lab,
                     std::uint64_t seed, const TestPlan& test_plan) {
  plant::Random random(seed);
  World world;
  world.holdout = true;
  world.start_soc = test_plan.start_soc;
  world.stimulus = {.step_s = test_plan.step_s,
                    .current_a = test_plan.current_a,
                    .ambient_c = test_plan.ambient_c,
                    .resistance_temperature_c = {}};
  const double laboratory_c = between(random, 21, 29);
  for (double& c : world.stimulus.ambient_c) c = std::isfinite(c) ? c : laboratory_c;
  world = with_effects(std::move(world), effects);
  lab.measures_temperature = lab.measures_temperature || test_plan.measures_temperature;
  const MeasuredSeries measured = observe(cell, world, test_plan.source_v);
  Series series = record(world, measured, lab, random.bits());
  series.terminal_v = measured.trace.voltage_v;
  if (world.cell.contact_scale != 0) {
    for (std::size_t k = 0; k < series.terminal_v.size(); ++k)
      series.terminal_v[k] -= world.cell.contact_scale * world.cell.contact_ohm[k] * test_plan.current_a[k];
  }
  return series;
}

}  // namespace

Draft draw_draft(CaseKind kind, bool demanding, const Kinds& kinds, plant::Random& random, Strengths strengths) {
  const Plan plan = draw_plan(kind, demanding, kinds, random, strengths);
  const Recorded recorded = run_recording(plan, kinds);
  const HoldOut holdout = run_holdout(plan, recorded.effects);

  Draft draft;
  draft.good = recorded.good && holdout.good &&
               std::all_of(recorded.effects.begin(), recorded.effects.end(),
                           [&](const ScaledEffect& s) { return strength_wanted(kind, s, strengths.least); });
  Case& made = draft.made;
  made.recording = record(recorded.full, recorded.measured, plan.lab, plan.instrument_seed);
  made.holdout = record(holdout.world, holdout.measured, plan.lab, derived_seed(plan.instrument_seed, 1));
  made.run_test = [cell = plan.cell, effects = recorded.effects, lab = plan.lab,
                   seed = derived_seed(plan.instrument_seed, 2)](const TestPlan& test_plan) {
    return run_test_plan(cell, effects, lab, seed, test_plan);
  };
  made.cell = calibrate(plan.cell, plan.lab.calibration_share, random);
  const double user_error = std::clamp(0.0025 * random.normal(), -0.005, 0.005);
  const World& full = recorded.full;
  made.given_initial_soc = std::clamp(full.start_soc + full.given_soc_error + user_error, 0.0, 1.0);
  made.holdout_initial_soc = std::round(200 * holdout.world.start_soc) / 200;
  made.answer = answer_of(plan, recorded, made.recording);
  made.answer.kind = kind;
  if (kind == CaseKind::outside)
    made.answer.holdout_effect_rms_v = rms(difference_v(plan.cell, holdout.healthy, {}, recorded.effects));
  return draft;
}

}  // namespace bms::benchmark::truth
