// A contact that has become worse: its moment is searched, and it stays so in later recordings.
#pragma once

#include <fmt/format.h>

#include "diagnosis/dual.hpp"
#include "diagnosis/mechanism.hpp"
#include "diagnosis/mechanisms/needs_current.hpp"
#include "model/mechanisms/contact_step.hpp"

namespace bms::diagnosis {

template <>
struct Knowledge<model::ContactStep> : DefaultKnowledge<model::ContactStep> {
  static constexpr MechanismText text = {
      .id = model::ContactStep::id,
      .name = "a contact that has become worse",
      .brief = "a contact has changed at some moment",
      .mark = "begins at one moment and is in proportion to the current from that moment",
      .meaning = "A terminal, a fuse or a connector has loosened or corroded.",
      .action = "Check and tighten the connections of this cell before it gets hot."};
  static constexpr Signature signature = Signature::contact_change;
  static constexpr bool outside_cell = true;
  static constexpr double searched_unknowns = 4;  ///< what searching for the moment is worth

  static std::string claim(const MechanismSetting& s) {
    return fmt::format("a contact has {} resistance since {}, by {}",
                       s.value[contact_resistance] >= 0 ? "more" : "less", duration_text(s.value[contact_onset]),
                       size_text(s, contact_resistance));
  }
  static std::optional<std::string> not_testable(const TestConditions& c) { return needs_current(c); }
  /// No contact becomes better by itself: what looks like it is an error of the cell file's resistance.
  static Bounds bounds(std::size_t parameter, Bounds file, double /*rc_s*/) {
    return parameter == contact_resistance ? Bounds{0, file.high} : file;
  }
  static bool carry_over(MechanismSetting& s) {
    s.value[contact_onset] = 0;
    return true;
  }
  template <class S>
  static void set_up(SimulationSetup<S>& setup, const model::MechanismValues<S>& with) {
    model::MechanismValues<S> value = with;
    if (setup.record > 0) value[contact_onset] = S(setup.recording.time_s.front());
    setup.template choose<model::ContactStep>(value);
  }
  template <class S>
  static S between_terminals(const model::MechanismValues<S>& value, const Check& check, std::size_t record) {
    const bool changed = record > 0 || check.time_s >= number(value[contact_onset]);
    return changed ? S(value[contact_resistance] * check.current_a) : S(0);
  }
};

}  // namespace bms::diagnosis
