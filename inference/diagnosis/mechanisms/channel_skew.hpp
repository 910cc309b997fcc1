// A time skew of the channels: seen at the edges of the current, so there must be some.
#pragma once

#include <cmath>

#include <fmt/format.h>

#include "diagnosis/mechanism.hpp"
#include "model/mechanisms/channel_skew.hpp"

namespace bms::diagnosis {

template <>
struct Knowledge<model::ChannelSkew> : DefaultKnowledge<model::ChannelSkew> {
  static constexpr MechanismText text = {
      .id = model::ChannelSkew::id,
      .name = "a time skew of the channels",
      .brief = "current and voltage are not read at the same moment",
      .mark = "shows as spikes at the edges of the current, up at one and down at the next, and nowhere else",
      .meaning =
          "The current in a row of the recording flowed a moment before or after the voltage of that row was read.",
      .action =
          "Synchronise the two channels, or shift the current by the time found, before you conclude anything else."};
  static constexpr std::size_t edges_needed = 5;  ///< of the current
  static constexpr double slowest_step_s = 20;    ///< [s] between rows

  static std::string claim(const MechanismSetting& s) {
    return fmt::format("the current is read {} {} than the voltage", size_text(s, 0),
                       s.value[0] >= 0 ? "later" : "earlier");
  }
  static std::optional<std::string> not_testable(const TestConditions& c) {
    if (c.facts.edges < edges_needed || c.facts.step_s > slowest_step_s) return "too few steps of the current";
    return std::nullopt;
  }
  /// Less than what the noise model grants each reading next to an edge of the current.
  static bool is_implausible(const MechanismSetting& s, const std::vector<MechanismSetting>&,
                             const RecordingFacts& facts) {
    return std::abs(s.value[0]) < thresholds.noise.edge_jitter * facts.step_s;
  }
  template <class S>
  static void set_up(SimulationSetup<S>& setup, const model::MechanismValues<S>& value) {
    setup.current_delay_s = value[0];
  }
};

}  // namespace bms::diagnosis
