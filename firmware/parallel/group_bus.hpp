// The Presence of a battery in frames of the bus between the batteries (firmware/can/parallel_bus.dbc), and back.
//
// A Presence is a pair of frames with the same counter, each with a checksum over its identifier and content. One is
// received if both are intact, the pair is complete, every value is possible, and the counter differs from that of the
// last one of this node: a controller that repeats what it has sent once is not alive. A lost pair needs no action
// here: ParallelBattery::present_us is three of them.
//
//   voltage    2 mV, so 1 mV of error at each battery; above 131.06 V or below 0: not known, and the sender counts as
//              unable
//   currents   0.1 A. Limits are rounded down, and end at 6,553.4 A
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "can/frame.hpp"
#include "parallel/parallel_battery.hpp"
#include "parallel_messages.hpp"  // generated from firmware/can/parallel_bus.dbc

namespace bms::parallel {

class GroupBus {
 public:
  static constexpr std::uint32_t first_presence_id = can::parallel::Presence1::id,
                                 first_limits_id = can::parallel::BatteryLimits1::id;

  /// Both frames of a Presence, for the bus. own.node: 1 to most_batteries.
  constexpr std::array<can::Frame, 2> frames(const Presence& own) {
    can::parallel::Presence1 presence;
    can::parallel::BatteryLimits1 limits;
    const bool voltage_known = own.open_circuit_uv >= 0 && own.open_circuit_uv <= most_uv;
    const State state = voltage_known ? own.state : State::unable;
    presence.state = static_cast<std::uint32_t>(state);
    presence.leader = own.leader;
    presence.granted = own.granted;
    presence.charge_wanted = own.charge_wanted ? 1 : 0;
    if (voltage_known) presence.open_circuit_voltage = 1e-6F * static_cast<float>(own.open_circuit_uv);
    presence.current = 1e-6F * static_cast<float>(own.current_ua);
    limits.discharge = rounded_down_a(own.allowed_discharge_ua);
    limits.charge = rounded_down_a(own.allowed_charge_ua);
    counter_ = can::next(counter_);
    return {of_node(presence.frame(counter_), own.node), of_node(limits.frame(counter_), own.node)};
  }

  /// A frame of the bus. Returns a Presence with the second frame of its pair, also one of the own node.
  constexpr std::optional<Presence> receive(const can::Frame& frame) {
    if (frame.long_id || !can::intact(frame, static_cast<std::uint16_t>(frame.id))) return std::nullopt;
    const std::uint32_t first = frame.id >= first_limits_id ? first_limits_id : first_presence_id;
    if (frame.id < first || frame.id >= first + most_batteries) return std::nullopt;
    Half& half = halves_[frame.id - first];
    if (first == first_presence_id) {
      half.presence = frame;
      half.complete = false;
      half.begun = true;
      return std::nullopt;
    }
    const std::uint8_t counter = can::counter_of(frame);
    if (!half.begun || half.complete || counter != can::counter_of(half.presence)) return std::nullopt;
    half.complete = true;
    if (counter == half.last_counter) return std::nullopt;
    half.last_counter = counter;
    return presence_of(half.presence, frame, static_cast<std::uint8_t>(frame.id - first + 1));
  }

 private:
  static constexpr std::int32_t most_uv = 131'060'000;
  static constexpr std::uint8_t no_counter = 0xFF;

  /// All nodes have the layout of the first one.
  static constexpr can::Frame of_node(can::Frame frame, std::uint8_t node) {
    frame.id += node - 1U;
    can::protect(frame, static_cast<std::uint16_t>(frame.id), can::counter_of(frame));
    return frame;
  }
  static_assert(can::parallel::Presence4::id == first_presence_id + 3 &&
                can::parallel::BatteryLimits4::id == first_limits_id + 3 &&
                can::parallel::Presence4::data_id == can::parallel::Presence4::id &&
                can::parallel::BatteryLimits4::data_id == can::parallel::BatteryLimits4::id);

  static constexpr float rounded_down_a(std::int32_t ua) {
    return 0.1F * static_cast<float>(std::clamp<std::int32_t>(ua, 0, 2'147'000'000) / 100'000);
  }
  static constexpr std::int32_t in_micro(float value) { return static_cast<std::int32_t>(1e6F * value); }

  static constexpr std::optional<Presence> presence_of(const can::Frame& first, const can::Frame& second,
                                                       std::uint8_t node) {
    const auto p = can::parallel::Presence1::of(first);
    const auto limits = can::parallel::BatteryLimits1::of(second);
    const bool values_possible = p.state <= static_cast<std::uint32_t>(State::connected) &&
                                 p.leader <= most_batteries && p.granted <= most_batteries;
    const auto within = [](float value, float most) { return value >= -most && value <= most; };  // and a number
    if (!values_possible || !within(p.open_circuit_voltage, 131.1F) || !within(p.current, 2'147.0F) ||
        !within(limits.discharge, 2'147.0F) || !within(limits.charge, 2'147.0F))
      return Presence{.node = node};  // unable
    return Presence{.node = node,
                    .state = static_cast<State>(p.state),
                    .open_circuit_uv = in_micro(p.open_circuit_voltage),
                    .current_ua = in_micro(p.current),
                    .allowed_discharge_ua = in_micro(limits.discharge),
                    .allowed_charge_ua = in_micro(limits.charge),
                    .leader = static_cast<std::uint8_t>(p.leader),
                    .granted = static_cast<std::uint8_t>(p.granted),
                    .charge_wanted = p.charge_wanted != 0};
  }

  struct Half {
    can::Frame presence;
    bool begun = false, complete = false;
    std::uint8_t last_counter = no_counter;
  };

  std::array<Half, most_batteries> halves_{};
  std::uint8_t counter_ = 0;
};

}  // namespace bms::parallel
