// An intermittent contact: which bursts there are is a property of one recording.
#pragma once

#include <fmt/format.h>

#include "diagnosis/mechanism.hpp"
#include "diagnosis/mechanisms/needs_current.hpp"
#include "model/mechanisms/contact_intermittent.hpp"

namespace bms::diagnosis {

template <>
struct Knowledge<model::ContactIntermittent> : DefaultKnowledge<model::ContactIntermittent> {
  static constexpr MechanismText text = {
      .id = model::ContactIntermittent::id,
      .name = "an intermittent contact",
      .brief = "a contact opens now and then",
      .mark = "comes in bursts, in proportion to the current, and leaves no trace between them",
      .meaning = "A loose contact: the resistance jumps for moments, often with vibration.",
      .action = "Find and fasten the loose connection. What was measured in the bursts is not a property of the cell."};
  static constexpr Signature signature = Signature::contact_bursts;

  static std::string claim(const MechanismSetting& s) {
    return fmt::format("a contact opens in bursts, {} of the time and by {}", quantity(s.value[burst_share], 0, "%"),
                       size_text(s, contact_resistance));
  }
  static std::optional<std::string> not_testable(const TestConditions& c) { return needs_current(c); }
  static bool carry_over(MechanismSetting&) { return false; }
  template <class S>
  static void set_up(SimulationSetup<S>& setup, const model::MechanismValues<S>& value) {
    setup.template choose<model::ContactIntermittent>(value);
    setup.template law<model::ContactIntermittent>().bursts = setup.bursts;
  }
};

}  // namespace bms::diagnosis
