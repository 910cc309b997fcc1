#include "benchmark/truth/effects.hpp"

#include <algorithm>
#include <array>
#include <stdexcept>

#include "benchmark/truth/effects/adc_nonlinearity.hpp"
#include "benchmark/truth/effects/capacity_change.hpp"
#include "benchmark/truth/effects/channel_skew.hpp"
#include "benchmark/truth/effects/charge_transfer.hpp"
#include "benchmark/truth/effects/contact_intermittent.hpp"
#include "benchmark/truth/effects/contact_step.hpp"
#include "benchmark/truth/effects/coulombic_loss.hpp"
#include "benchmark/truth/effects/current_clipping.hpp"
#include "benchmark/truth/effects/current_gain.hpp"
#include "benchmark/truth/effects/current_offset.hpp"
#include "benchmark/truth/effects/direction_asymmetry.hpp"
#include "benchmark/truth/effects/entropic_ocv.hpp"
#include "benchmark/truth/effects/fast_polarisation.hpp"
#include "benchmark/truth/effects/initial_soc.hpp"
#include "benchmark/truth/effects/leakage.hpp"
#include "benchmark/truth/effects/memory_bump.hpp"
#include "benchmark/truth/effects/ocv_hysteresis.hpp"
#include "benchmark/truth/effects/ocv_shape.hpp"
#include "benchmark/truth/effects/parallel_imbalance.hpp"
#include "benchmark/truth/effects/periodic_interference.hpp"
#include "benchmark/truth/effects/plating_relaxation.hpp"
#include "benchmark/truth/effects/polarisation_growth.hpp"
#include "benchmark/truth/effects/pressure_memory.hpp"
#include "benchmark/truth/effects/resistance_growth.hpp"
#include "benchmark/truth/effects/self_heating.hpp"
#include "benchmark/truth/effects/slow_polarisation.hpp"
#include "benchmark/truth/effects/sticky_converter.hpp"
#include "benchmark/truth/effects/temperature_resistance.hpp"
#include "benchmark/truth/effects/temperature_sensor.hpp"
#include "benchmark/truth/effects/voltage_gain.hpp"
#include "benchmark/truth/effects/voltage_offset.hpp"

namespace bms::benchmark::truth {

namespace {

// The table of effects. The order decides which case of a split has which effect.
constexpr std::array catalogue = {&effects::ocv_hysteresis,
                                  &effects::slow_polarisation,
                                  &effects::fast_polarisation,
                                  &effects::charge_transfer,
                                  &effects::direction_asymmetry,
                                  &effects::temperature_resistance,
                                  &effects::self_heating,
                                  &effects::entropic_ocv,
                                  &effects::capacity_change,
                                  &effects::coulombic_loss,
                                  &effects::leakage,
                                  &effects::resistance_growth,
                                  &effects::polarisation_growth,
                                  &effects::contact_step,
                                  &effects::contact_intermittent,
                                  &effects::ocv_shape,
                                  &effects::current_offset,
                                  &effects::current_gain,
                                  &effects::current_clipping,
                                  &effects::voltage_offset,
                                  &effects::voltage_gain,
                                  &effects::channel_skew,
                                  &effects::initial_soc};
constexpr std::array outside = {&effects::plating_relaxation,    &effects::parallel_imbalance,
                                &effects::memory_bump,           &effects::adc_nonlinearity,
                                &effects::periodic_interference, &effects::pressure_memory,
                                &effects::sticky_converter};

/// Groups of effects of which one recording contains at most one: they describe the same thing or hide each other.
const std::vector<std::vector<const EffectKind*>>& exclusive_groups() {
  using namespace effects;
  static const std::vector<std::vector<const EffectKind*>> groups = {
      {&current_offset, &current_gain, &current_clipping, &channel_skew},
      {&voltage_offset, &voltage_gain},
      {&temperature_resistance, &self_heating},
      {&leakage, &coulombic_loss, &current_offset},
      {&contact_step, &contact_intermittent},
      {&charge_transfer, &polarisation_growth, &self_heating},
      {&slow_polarisation, &polarisation_growth},
      {&capacity_change, &current_gain, &coulombic_loss},
      {&capacity_change, &ocv_shape, &initial_soc},
  };
  return groups;
}

bool go_together(const EffectKind* a, const EffectKind* b) {
  if (a == b) return false;
  const auto& groups = exclusive_groups();
  return std::none_of(groups.begin(), groups.end(), [&](const std::vector<const EffectKind*>& group) {
    return std::count(group.begin(), group.end(), a) > 0 && std::count(group.begin(), group.end(), b) > 0;
  });
}

template <class Kinds>
std::vector<std::string> ids_of(const Kinds& kinds) {
  std::vector<std::string> ids;
  for (const EffectKind* kind : kinds) ids.emplace_back(kind->id);
  return ids;
}

}  // namespace

const std::vector<std::string>& catalogue_ids() {
  static const std::vector<std::string> ids = ids_of(catalogue);
  return ids;
}

const std::vector<std::string>& outside_ids() {
  static const std::vector<std::string> ids = ids_of(outside);
  return ids;
}

const EffectKind& effect_kind(const std::string& id) {
  for (const EffectKind* kind : catalogue) {
    if (id == kind->id) return *kind;
  }
  for (const EffectKind* kind : outside) {
    if (id == kind->id) return *kind;
  }
  if (id == effects::temperature_sensor.id) return effects::temperature_sensor;
  throw std::logic_error("no such effect: " + id);
}

Effect draw_effect(const EffectKind& kind, const HealthyCell& cell, const World& world, plant::Random& random) {
  const std::uint64_t seed = random.bits();
  const EffectDraw draw = {.cell = cell,
                           .world = world,
                           .random = random,
                           .seed = seed,
                           .direction = sign(random),
                           .capacity_ratio = cell.capacity_ah / 6,
                           .one_c_a = cell.capacity_ah,
                           .r0_ohm = cell.r0_ohm.at(0.5),
                           .tau_s = cell.r1_ohm.at(0.5) * cell.c1_f.at(0.5)};
  return {&kind, kind.draw(draw)};
}

std::vector<const EffectKind*> draw_pair(plant::Random& random) {
  if (chance(random, 0.06)) return {&effects::temperature_resistance, &effects::temperature_sensor};
  for (;;) {
    const EffectKind *first = one_of(random, catalogue), *second = one_of(random, catalogue);
    if (go_together(first, second)) return {first, second};
  }
}

}  // namespace bms::benchmark::truth
