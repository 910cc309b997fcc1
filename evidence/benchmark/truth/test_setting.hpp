// The test that a recording of a case comes from: profile, sampling, duration, start and weather.
#pragma once

#include "benchmark/truth/effects.hpp"

namespace bms::benchmark::truth {

/// SOC range of the profile.
struct SocRange {
  double lowest = 0.04, highest = 0.965;
};

/// Narrows the range by what the SOC of a run went beyond 2.5 to 98.5 %. Returns false if the run stayed within.
bool narrow(SocRange& range, const std::vector<double>& soc);

struct TestSetting {
  Profile profile = Profile::hppc;
  double step_s = 1, duration_s = 0, current_scale = 1;
  double start_soc = 0.9;
  Ambient ambient = Ambient::constant;
  double ambient_start_c = 25, swing_k = 0;
  std::uint64_t seed = 0;
};

TestSetting draw_setting(const Experiment& experiment, double usual_step_s, bool holdout, plant::Random& random);

/// One experiment for several effects: the profiles that all of them want, or all profiles if they share none.
Experiment joined(const std::vector<Experiment>& experiments);

/// The world without effects.
World make_world(const HealthyCell& cell, const TestSetting& setting, const SocRange& range, bool holdout);

}  // namespace bms::benchmark::truth
