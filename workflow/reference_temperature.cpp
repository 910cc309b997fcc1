#include "workflow/reference_temperature.hpp"

#include <algorithm>

namespace bms::workflow {

namespace {

using model::TemperatureResistance;

/// Places of the parameters of temperature_resistance.
constexpr std::size_t r0_energy = 0, r1_energy = 1, reference = 2, r0_share = 3;

template <class Column>
void scale(Column& column, double by) {
  for (std::size_t k = 0; k < column.size; ++k) column[k] *= by;
}

}  // namespace

void state_reference(files::CellFile& cell, bool ocv_identified) {
  for (model::MechanismSetting& m : cell.mechanisms) {
    if (m.index == model::mechanism_index_of<model::EntropicOcv> && !ocv_identified) continue;
    const model::MechanismInfo& info = model::catalogue[m.index];
    for (std::size_t k = 0; k < info.parameters; ++k) {
      if (info.parameter[k].is_reference_temperature) m.value[k] = cell.parameters.reference_temperature_c;
    }
  }
}

void move_resistances(files::CellFile& cell, double temperature_c) {
  constexpr std::size_t index = model::mechanism_index_of<TemperatureResistance>;
  const auto at = std::find_if(cell.mechanisms.begin(), cell.mechanisms.end(),
                               [](const model::MechanismSetting& m) { return m.index == index; });
  if (at == cell.mechanisms.end() || at->value[reference] == temperature_c) return;
  model::MechanismValues<>& value = at->value;
  const auto factor = [&](double energy_j_per_mol) {
    namespace d = model::mechanism_detail;
    return d::arrhenius<double>(d::energy_over_rt(energy_j_per_mol, value[reference]), value[reference], temperature_c);
  };
  const double reactions = value[r0_share] * factor(value[r0_energy]), r0 = 1 - value[r0_share] + reactions,
               r1 = factor(value[r1_energy]);
  auto& rc = cell.parameters.rc;
  scale(rc.r0_ohm, r0);
  scale(rc.r0_std_ohm, r0);
  scale(rc.r1_ohm, r1);
  scale(rc.r1_std_ohm, r1);
  const model::Parameter& share = TemperatureResistance::parameters[r0_share];
  value[r0_share] = std::clamp(reactions / r0, share.low, share.high);
  value[reference] = temperature_c;
}

}  // namespace bms::workflow
