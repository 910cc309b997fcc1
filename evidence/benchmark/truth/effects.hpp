// The concealed effects by id. An effect has all its numbers drawn except its amplitude, which the wanted strength
// decides.
#pragma once

#include <string>
#include <vector>

#include "benchmark/truth/effect_kind.hpp"

namespace bms::benchmark::truth {

/// Ids of the diagnosis' catalogue that occur alone. `temperature_sensor` is missing: in a cell whose resistances do
/// not depend on the temperature nothing shows it, so it occurs only together with `temperature_resistance`.
const std::vector<std::string>& catalogue_ids();

/// Effects that no catalogue contains.
const std::vector<std::string>& outside_ids();

/// Throws std::logic_error when there is no effect of this id.
const EffectKind& effect_kind(const std::string& id);

struct Effect {
  const EffectKind* kind = nullptr;
  DrawnEffect drawn;
};

/// world: without the effect.
Effect draw_effect(const EffectKind& kind, const HealthyCell& cell, const World& world, plant::Random& random);

/// Two effects of the catalogue that one recording can contain and that do not describe the same thing; in 6 % of the
/// draws `temperature_resistance` with `temperature_sensor`.
std::vector<const EffectKind*> draw_pair(plant::Random& random);

}  // namespace bms::benchmark::truth
