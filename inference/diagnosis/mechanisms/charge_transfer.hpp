// A charge transfer that is not proportional to the current.
#pragma once

#include <fmt/format.h>

#include "diagnosis/mechanism.hpp"
#include "model/mechanisms/charge_transfer.hpp"

namespace bms::diagnosis {

template <>
struct Knowledge<model::ChargeTransfer> : DefaultKnowledge<model::ChargeTransfer> {
  static constexpr MechanismText text = {
      .id = model::ChargeTransfer::id,
      .name = "a charge transfer that is not proportional to the current",
      .brief = "the resistance falls as the current rises",
      .mark = "makes large currents cost less than in proportion, at once",
      .meaning =
          "The reaction at the electrodes (Butler-Volmer) is not proportional to the current, most of all in the cold.",
      .action = "Use the extended cell file where currents of several sizes occur."};
  static constexpr Fact facts = Fact::rates;
  static constexpr std::size_t exchange_current = 2;  ///< place of the parameter
  static constexpr double smallest_current_c = 0.5;   ///< [C] at which the overvoltage bends

  static std::string claim(const MechanismSetting& s) {
    const std::string beyond = quantity(2 * s.value[exchange_current], 2 * s.deviation[exchange_current], "A");
    // a weak bend is known alone: a larger share that bends at larger currents makes the same
    if (s.deviation[0] > s.value[0] / 2 && s.deviation[1] > s.value[1] / 2)
      return fmt::format("an unknown share of the resistance decreases as the current comes near {}", beyond);
    return fmt::format("{} of R0 and {} of R1 decrease as the current exceeds {}", size_text(s, 0, "%"),
                       size_text(s, 1, "%"), beyond);
  }
  static std::vector<double> probing_shapes(double capacity_ah) {
    return {0.2 * capacity_ah, 0.7 * capacity_ah, 2.5 * capacity_ah};
  }
  static std::optional<std::string> not_testable(const TestConditions& c) {
    if (c.current_below(smallest_current_c)) return "the current is too small to bend the overvoltage";
    if (c.facts.one_current) return "the current has one size, at which it is a smaller resistance";
    return std::nullopt;
  }
};

}  // namespace bms::diagnosis
