#include "benchmark/truth/test_setting.hpp"

#include <algorithm>

namespace bms::benchmark::truth {

namespace {

double draw_duration_s(const TestSetting& s, bool holdout, bool has_an_end, plant::Random& random) {
  constexpr double most_rows = 25'000;
  if (holdout) return std::clamp(between(random, 3'600, 14'400), 3'600.0, most_rows * s.step_s);
  const double least_s = std::max(9'000.0, 5'000 * s.step_s), most_s = std::min(28'800.0, most_rows * s.step_s);
  return has_an_end ? most_s : between(random, least_s, most_s);
}

}  // namespace

bool narrow(SocRange& range, const std::vector<double>& soc) {
  constexpr SocRange allowed = {0.025, 0.985};
  constexpr double margin = 0.01;
  const auto [low, high] = std::minmax_element(soc.begin(), soc.end());
  const double below = std::max(0.0, allowed.lowest - *low), above = std::max(0.0, *high - allowed.highest);
  if (below > 0) range.lowest += below + margin;
  if (above > 0) range.highest -= above + margin;
  return below > 0 || above > 0;
}

TestSetting draw_setting(const Experiment& experiment, double usual_step_s, bool holdout, plant::Random& random) {
  TestSetting s;
  s.profile = one_of(random, experiment.profiles);
  s.current_scale = experiment.current_scale;
  s.step_s = experiment.step_s > 0 ? std::min(experiment.step_s, usual_step_s) : usual_step_s;
  const bool has_an_end = s.profile == Profile::full_cycle || s.profile == Profile::storage;
  if (!holdout && has_an_end && experiment.step_s == 0) s.step_s = std::max(s.step_s, 1.0);
  s.duration_s = draw_duration_s(s, holdout, has_an_end, random);
  s.start_soc = draw_start_soc(s.profile, random);
  s.seed = random.bits();
  if (experiment.swing_k != 0) {
    s.ambient = chance(random, 0.7) ? Ambient::step_and_back : Ambient::wave;
    s.swing_k = experiment.swing_k;
    s.ambient_start_c = experiment.swing_k > 0 ? between(random, 12, 25) : between(random, 25, 32);
  } else if (experiment.away_from_25) {
    s.ambient_start_c = chance(random, 0.5) ? between(random, 8, 16) : between(random, 33, 40);
  } else {
    s.ambient_start_c = between(random, 21, 29);
  }
  return s;
}

Experiment joined(const std::vector<Experiment>& experiments) {
  Experiment all = experiments.front();
  for (const Experiment& e : experiments) {
    all.current_scale = std::max(all.current_scale, e.current_scale);
    if (all.swing_k == 0) all.swing_k = e.swing_k;
    all.away_from_25 = all.away_from_25 || e.away_from_25;
    if (e.step_s > 0) all.step_s = e.step_s;
    std::vector<Profile> shared;
    for (const Profile p : all.profiles) {
      if (std::count(e.profiles.begin(), e.profiles.end(), p) > 0) shared.push_back(p);
    }
    if (shared.empty())
      all.profiles.insert(all.profiles.end(), e.profiles.begin(), e.profiles.end());
    else
      all.profiles = shared;
  }
  return all;
}

World make_world(const HealthyCell& cell, const TestSetting& setting, const SocRange& range, bool holdout) {
  plant::Random random(setting.seed);
  const double one_c_v = cell.capacity_ah * (cell.r0_ohm.at(0.5) + cell.r1_ohm.at(0.5));
  World world;
  world.holdout = holdout;
  world.start_soc = std::clamp(setting.start_soc, range.lowest + 0.02, range.highest);
  world.stimulus.step_s = setting.step_s;
  world.stimulus.current_a = draw_current_a({.profile = setting.profile,
                                             .step_s = setting.step_s,
                                             .capacity_ah = cell.capacity_ah,
                                             .start_soc = world.start_soc,
                                             .lowest_soc = range.lowest,
                                             .highest_soc = range.highest,
                                             .duration_s = setting.duration_s,
                                             .current_scale = setting.current_scale,
                                             .fastest_charge = std::min(2.0, 0.27 / one_c_v),
                                             .fastest_discharge = std::min(5.5, 0.75 / one_c_v)},
                                            random);
  plant::Random weather(derived_seed(setting.seed, 1));
  world.stimulus.ambient_c = draw_ambient_c(setting.ambient, setting.ambient_start_c, setting.swing_k,
                                            world.stimulus.current_a.size(), weather);
  return world;
}

}  // namespace bms::benchmark::truth
