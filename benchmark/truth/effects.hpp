// What can be wrong, one entry per id: everything about it drawn but for its size, which the wanted strength decides.
//
// Ids of the contract first; `temperature_sensor` comes only beside `temperature_resistance`: to a cell whose
// resistances do not follow the temperature nothing can show it. Then what no catalogue lists.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "benchmark/truth/concealed_cell.hpp"
#include "benchmark/truth/measuring_chain.hpp"
#include "benchmark/truth/profiles.hpp"
#include "benchmark/truth/random_functions.hpp"

namespace bms::benchmark::truth {

/// A cell with its instruments under a drive: what an effect changes.
struct World {
  Stimulus stimulus;  ///< true currents
  double start_soc = 0.5;
  double believed_soc_excess = 0;  ///< what the user was told, less start_soc
  bool holdout = false;            ///< a later recording
  CellEffects cell;
  Faults faults;
};

enum class ActsOn { cell, current, voltage, temperature, start };

struct Effect {
  std::string id;
  ActsOn acts_on = ActsOn::cell;
  double least = 0, most = 1;  ///< physical range of the amplitude
  std::function<void(double amplitude, World&)> apply;
};

/// What a wise experimenter would run to see it.
struct Experiment {
  std::vector<Profile> profiles;
  double current_scale = 1;
  double swing_k = 0;         ///< of the surroundings
  bool away_from_25 = false;  ///< or else constantly warm or cold
  double step_s = 0;          ///< 0: as usual
};

const std::vector<std::string>& catalogue_ids();  ///< singles
const std::vector<std::string>& outside_ids();

Experiment experiment_for(const std::string& id, plant::Random& random);
Effect draw_effect(const std::string& id, const HealthyCell& cell, const World& world, plant::Random& random);

}  // namespace bms::benchmark::truth
