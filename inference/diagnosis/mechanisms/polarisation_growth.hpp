// A change of the polarisation.
#pragma once

#include <algorithm>

#include <fmt/format.h>

#include "diagnosis/mechanism.hpp"
#include "diagnosis/mechanisms/needs_current.hpp"
#include "model/mechanisms/polarisation_growth.hpp"
#include "model/mechanisms/slow_polarisation.hpp"

namespace bms::diagnosis {

template <>
struct Knowledge<model::PolarisationGrowth> : DefaultKnowledge<model::PolarisationGrowth> {
  static constexpr MechanismText text = {.id = model::PolarisationGrowth::id,
                                         .name = "a change of the polarisation",
                                         .brief = "the polarisation is larger or slower than in the cell file",
                                         .mark = "builds up with the cell file's own time constant after every edge",
                                         .meaning = "Ageing, or a cell file of another cell or temperature.",
                                         .action = "Identify R1 and C1 again from pulses with rests."};
  static std::string claim(const MechanismSetting& s) {
    return fmt::format("the polarisation is {} {} and its capacitance {} {} than in the cell file",
                       size_text(s, 0, "%"), s.value[0] >= 0 ? "larger" : "smaller", size_text(s, 1, "%"),
                       s.value[1] >= 0 ? "larger" : "smaller");
  }
  static std::optional<std::string> not_testable(const TestConditions& c) { return needs_current(c); }

  static constexpr double share_of_slow = 0.6;    ///< of a 1RC file's R1, which holds slower polarisation as well
  static constexpr double share_of_charge = 0.5;  ///< of its C1, so that what is left of the pair is faster

  /// A slow polarisation takes over most of R1.
  static bool joint_start(std::vector<MechanismSetting>& all, const model::CellParameters<>& cell) {
    const auto slow = std::find_if(all.begin(), all.end(), [](const MechanismSetting& s) {
      return s.index == model::mechanism_index_of<model::SlowPolarisation>;
    });
    if (slow == all.end()) return false;
    all.back().value[0] = -share_of_slow;
    all.back().value[1] = -share_of_charge;
    const double largest_ohm = model::SlowPolarisation::parameters[0].upper(cell.capacity_ah);
    slow->value[0] = std::min(
        largest_ohm,
        slow->value[0] + share_of_slow * model::cell_detail::rc_value(cell.rc, cell.rc.r1_ohm, numerics.middle_soc));
    return true;
  }
};

}  // namespace bms::diagnosis
