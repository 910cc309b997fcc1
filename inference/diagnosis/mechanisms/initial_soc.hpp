// A wrong state of charge at the start: of the first recording alone.
#pragma once

#include <fmt/format.h>

#include "diagnosis/mechanism.hpp"
#include "model/mechanisms/initial_soc.hpp"

namespace bms::diagnosis {

template <>
struct Knowledge<model::InitialSoc> : DefaultKnowledge<model::InitialSoc> {
  static constexpr MechanismText text = {.id = model::InitialSoc::id,
                                         .name = "a wrong state of charge at the start",
                                         .brief = "the state of charge at the start was different",
                                         .mark = "is there from the first sample on and does not grow",
                                         .meaning = "The recording began at another state of charge than was given.",
                                         .action =
                                             "Let the cell rest before a recording and read its start from the "
                                             "voltage, outside the flat part of the OCV curve."};
  static constexpr Fact facts = Fact::soc_span;

  static std::string claim(const MechanismSetting& s) {
    return fmt::format("the recording began {} of charge {} than was given", size_text(s, 0, "%"),
                       s.value[0] >= 0 ? "higher" : "lower");
  }
  static std::optional<std::string> not_testable(const TestConditions& c) {
    if (!c.facts.start_given) return "no initial state of charge was given";
    return std::nullopt;
  }
  /// Far starts, and the one that the recording states elsewhere.
  static std::vector<std::vector<double>> far_starts(const MechanismSetting&, const RecordingFacts& recording) {
    std::vector<std::vector<double>> starts = {{-0.15}, {-0.08}, {-0.04}, {0.04}, {0.08}, {0.15}};
    if (recording.start_shift) starts.push_back({*recording.start_shift});
    return starts;
  }
  /// The true start is any state of charge, whatever was given.
  static Bounds bounds(std::size_t /*parameter*/, Bounds /*file*/, double /*rc_s*/) { return {-1, 1}; }
  static bool carry_over(MechanismSetting&) { return false; }
  template <class S>
  static void set_up(SimulationSetup<S>& setup, const model::MechanismValues<S>& value) {
    if (setup.record == 0) setup.initial_soc += value[0];
  }
};

}  // namespace bms::diagnosis
