#include "workflow/reference_temperature.hpp"

#include <cmath>

#include <fmt/format.h>

namespace bms::workflow {

namespace {

constexpr double near_k = 5;  ///< as far apart as recordings of one temperature can be

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

double reference_of(double stated_c, double identified_c) {
  return std::abs(identified_c - stated_c) <= near_k ? stated_c : identified_c;
}

void check_reference(const files::CellFile& cell, double identified_c, bool moved,
                     std::vector<measurement::Warning>& warnings) {
  const double reference_c = cell.parameters.reference_temperature_c;
  if (moved || std::abs(identified_c - reference_c) <= near_k) return;
  warnings.push_back({"reference_temperature",
                      fmt::format("R0, R1, C1 were identified at {:g} degrees C, but the reference temperature of the "
                                  "cell file is {:g} degrees C; use --reference-temperature {:g}, or --extend with "
                                  "recordings at several temperatures",
                                  identified_c, reference_c, identified_c)});
}

}  // namespace bms::workflow
