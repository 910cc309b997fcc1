// A change of capacity. Once a knee of the OCV is crossed elsewhere its effect is far from linear.
#pragma once

#include <fmt/format.h>

#include "diagnosis/mechanism.hpp"
#include "diagnosis/mechanisms/needs_soc_span.hpp"
#include "model/mechanisms/capacity_change.hpp"

namespace bms::diagnosis {

template <>
struct Knowledge<model::CapacityChange> : DefaultKnowledge<model::CapacityChange> {
  static constexpr MechanismText text = {
      .id = model::CapacityChange::id,
      .name = "a change of capacity",
      .brief = "the cell's capacity differs from its cell file",
      .mark = "grows with the charge moved and comes back where the charge does",
      .meaning = "The cell has aged, or its file was made for another cell.",
      .action = "Measure the capacity with one full slow discharge and enter it in the cell file."};
  static constexpr bool report_limit = true;
  static constexpr Fact facts = Fact::soc_span;

  static std::string claim(const MechanismSetting& s) {
    return fmt::format("the cell holds {} {} charge than its file says", size_text(s, 0, "%"),
                       s.value[0] >= 0 ? "less" : "more");
  }
  static std::optional<std::string> not_testable(const TestConditions& c) { return needs_soc_span(c); }
  static std::vector<std::vector<double>> far_starts(const MechanismSetting&, const RecordingFacts&) {
    return {{-0.1}, {0.04}, {0.08}, {0.14}, {0.2}, {0.28}};
  }
  /// A cell does not age so: much of its capacity is gone, its resistance is as it was.
  static bool is_implausible(const MechanismSetting& s, const std::vector<MechanismSetting>& all,
                             const RecordingFacts&) {
    constexpr const Thresholds::Decision& limits = thresholds.decision;
    return s.value[0] > limits.capacity_lost_alone &&
           first_strength(all, model::mechanism_index_of<model::ResistanceGrowth>) < limits.resistance_grown &&
           first_strength(all, model::mechanism_index_of<model::PolarisationGrowth>) < limits.resistance_grown;
  }
  static double capacity_share(const MechanismSetting& s) { return 1 - s.value[0]; }
  /// Acts together with the calibration's own change of capacity.
  template <class S>
  static void set_up(SimulationSetup<S>& setup, const model::MechanismValues<S>& value) {
    setup.capacity_loss += value[0];
  }
};

}  // namespace bms::diagnosis
