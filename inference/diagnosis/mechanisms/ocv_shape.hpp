// An OCV curve that has slid along the state of charge.
#pragma once

#include <fmt/format.h>

#include "diagnosis/mechanism.hpp"
#include "diagnosis/mechanisms/needs_soc_span.hpp"
#include "model/mechanisms/ocv_shape.hpp"

namespace bms::diagnosis {

template <>
struct Knowledge<model::OcvShape> : DefaultKnowledge<model::OcvShape> {
  static constexpr MechanismText text = {
      .id = model::OcvShape::id,
      .name = "an OCV curve that has slid",
      .brief = "the steps of the OCV lie at another state of charge",
      .mark = "moves the steps of the OCV curve along the state of charge and leaves its ends",
      .meaning = "The electrodes have slipped against each other: loss of lithium or of active material.",
      .action = "Record a new slow OCV curve, and measure the capacity with it."};
  static constexpr Fact facts = Fact::soc_span;

  static std::string claim(const MechanismSetting& s) {
    const auto& parameter = model::OcvShape::parameters;
    return fmt::format("the OCV curve has slid along the state of charge, by {} at {} % and {} at {} %",
                       quantity(s.value[0], s.deviation[0], "%"), number_in(parameter[0].name),
                       quantity(s.value[1], s.deviation[1], "%"), number_in(parameter[1].name));
  }
  static std::optional<std::string> not_testable(const TestConditions& c) { return needs_soc_span(c); }
  static std::vector<std::vector<double>> far_starts(const MechanismSetting&, const RecordingFacts&) {
    return {{-0.06, -0.06}, {-0.03, -0.03}, {0.03, 0.03}, {0.06, 0.06}, {0.06, -0.06}, {-0.06, 0.06}};
  }
  /// A cell does not age so: the stages of its OCV lie closer together, its capacity is as it was. Unequal parallel
  /// cells were named so, with slides of +5 % at 20 % and -10 % at 80 %: a quarter less of an electrode would be used.
  static bool is_implausible(const MechanismSetting& s, const std::vector<MechanismSetting>& all,
                             const RecordingFacts&) {
    constexpr const Thresholds::Decision& limits = thresholds.decision;
    const double closer = (s.value[0] - s.value[1]) / limits.slides_apart_soc;
    return closer - first_strength(all, model::mechanism_index_of<model::CapacityChange>) > limits.stages_closer;
  }
};

}  // namespace bms::diagnosis
