// What a concealed effect is: the world that it changes, the experiments that show it, and how its numbers are drawn.
//
// Each file of effects/ defines one EffectKind; effects.cpp collects them in a table.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "benchmark/truth/concealed_cell.hpp"
#include "benchmark/truth/measuring_chain.hpp"
#include "benchmark/truth/profiles.hpp"
#include "benchmark/truth/random_functions.hpp"

namespace bms::benchmark::truth {

/// A cell and its instruments under a stimulus: what an effect changes.
struct World {
  Stimulus stimulus;  ///< true currents
  double start_soc = 0.5;
  double given_soc_error = 0;  ///< initial SOC given to the diagnosis, minus start_soc
  bool holdout = false;        ///< a later recording
  CellEffects cell;
  Faults faults;
};

/// The quantity through which an effect enters the recording.
enum class ActsOn { cell, current, voltage, temperature, start };

/// Tests that show an effect clearly.
struct Experiment {
  std::vector<Profile> profiles;
  double current_scale = 1;
  double swing_k = 0;         ///< change of the ambient temperature; 0: constant
  bool away_from_25 = false;  ///< a constant ambient temperature far from 25 degrees C
  double step_s = 0;          ///< longest sampling step; 0: any
};

/// What an effect may use when it draws its numbers.
struct EffectDraw {
  const HealthyCell& cell;
  const World& world;  ///< without the effect
  plant::Random& random;
  std::uint64_t seed;     ///< of the effect's time series
  double direction;       ///< -1 or 1
  double capacity_ratio;  ///< capacity / 6 Ah
  double one_c_a;         ///< current of 1C
  double r0_ohm, tau_s;   ///< at 50 % SOC; tau = R1 C1

  /// A hold-out recording has other time series than the recording before it.
  static std::uint64_t series_seed(std::uint64_t seed, const World& world) { return world.holdout ? seed + 1 : seed; }
};

/// An effect with all its numbers except its amplitude.
struct DrawnEffect {
  double least = 0, most = 1;  ///< physical range of the amplitude
  std::function<void(double amplitude, World&)> apply;
};

struct EffectKind {
  const char* id;
  ActsOn acts_on;
  Experiment (*experiment)(plant::Random& random);
  DrawnEffect (*draw)(const EffectDraw& draw);
  bool needs_temperature = false;     ///< the recording has a temperature column
  bool needs_steady_ambient = false;  ///< the ambient temperature stays at 25 degrees C
  bool needs_other_effect = false;    ///< it shows only in a cell that has the other effect of the pair
  bool repeats_in_holdout = true;     ///< a model of the recording can predict it in the hold-out
  std::array<const char*, 2> laws{};  ///< outside the catalogue: the law of a cell or channel that it changes, or both
                                      ///< if two say the same (README.md)
};

/// Experiments without a preference: every profile.
inline Experiment any_profile() { return {.profiles = {all_profiles.begin(), all_profiles.end()}}; }

}  // namespace bms::benchmark::truth
