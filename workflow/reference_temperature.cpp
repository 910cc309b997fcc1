#include "workflow/reference_temperature.hpp"

namespace bms::workflow {

void state_reference(files::CellFile& cell, bool ocv_identified) {
  for (model::MechanismSetting& m : cell.mechanisms) {
    if (m.index == model::mechanism_index_of<model::EntropicOcv> && !ocv_identified) continue;
    const model::MechanismInfo& info = model::catalogue[m.index];
    for (std::size_t k = 0; k < info.parameters; ++k) {
      if (info.parameter[k].is_reference_temperature) m.value[k] = cell.parameters.reference_temperature_c;
    }
  }
}

}  // namespace bms::workflow
