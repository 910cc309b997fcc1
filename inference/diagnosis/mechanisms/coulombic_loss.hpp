// A coulombic loss.
#pragma once

#include <fmt/format.h>

#include "diagnosis/mechanism.hpp"
#include "diagnosis/mechanisms/constant_current.hpp"
#include "diagnosis/mechanisms/needs_charging.hpp"
#include "model/mechanisms/coulombic_loss.hpp"

namespace bms::diagnosis {

template <>
struct Knowledge<model::CoulombicLoss> : DefaultKnowledge<model::CoulombicLoss> {
  static constexpr MechanismText text = {.id = model::CoulombicLoss::id,
                                         .name = "a coulombic loss",
                                         .brief = "part of the charge put in does not come back",
                                         .mark = "grows with the charge put in, not with time",
                                         .meaning = "Side reactions take part of the charging current.",
                                         .action =
                                             "Give the charge count a coulombic efficiency. Check charging voltage and "
                                             "temperature if the loss exceeds 1 %."};
  static constexpr Fact facts = Fact::reversals;

  static std::string claim(const MechanismSetting& s) {
    if (s.value[0] >= 0) return fmt::format("{} of the charge put in does not come back", size_text(s, 0, "%"));
    return fmt::format("{} more charge comes back than was put in", size_text(s, 0, "%"));
  }
  static std::optional<std::string> not_testable(const TestConditions& c) {
    const auto reason = needs_charging(c);
    return reason ? reason : constant_current::too_short(c);
  }
};

}  // namespace bms::diagnosis
