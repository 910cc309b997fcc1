// The term of an unknown cause in the slow polarisation (law_term.hpp).
#pragma once

#include <fmt/format.h>

#include "diagnosis/mechanism.hpp"
#include "model/mechanisms/load_memory.hpp"

namespace bms::diagnosis {

template <>
struct Knowledge<model::LoadMemory> : DefaultKnowledge<model::LoadMemory> {
  static constexpr MechanismText text = {
      .id = model::LoadMemory::id,
      .name = "a memory of the load",
      .brief = "the voltage remembers charging and discharging differently",
      .mark = "builds up under load and decays in every rest, differently in charge and in discharge",
      .meaning = "Something slow in the cell follows the load, and no known cause does so in this way.",
      .action = "Use the extended cell file, and check it on another recording with --holdout."};
  static constexpr bool only_a_term = true;
  static constexpr std::size_t charge = 0, discharge = 1, time_constant = 2;  ///< places of the parameters

  static std::string claim(const MechanismSetting& s) {
    return fmt::format("the voltage remembers the load for {}, by {} in charge and {} in discharge",
                       size_text(s, time_constant), quantity_of(s, charge), quantity_of(s, discharge));
  }

 private:
  /// With its sign.
  static std::string quantity_of(const MechanismSetting& s, std::size_t parameter) {
    return parameter_text(model::LoadMemory::parameters[parameter], s.value[parameter], s.deviation[parameter]);
  }
};

}  // namespace bms::diagnosis
