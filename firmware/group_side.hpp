// The group around a battery of several at one DC link (firmware/parallel/), in an image that has the bus between them
// (BMS_PARALLEL). For every sample, before the protections are evaluated: it receives what the others have sent,
// decides which request the contactors follow, and sends what the others have to know.
//
//   request   that of the truck, as far as the group lets this battery follow it
//   leave     the contactors open at once and without a fault, as if their coils had no supply
//   charger   the profile of a charger speaks at the leader only, for the whole group (charge_of_group.hpp)
//   limits    AllowedCurrent is that of the whole group at its leader and 0 at the others: a truck that obeys the
//             largest one of all batteries obeys the leader
//
// Node and number are parameters. Until they are set, nothing closes. A new set acts at once: it is applied while the
// contactors are open.
#pragma once

#include <cstddef>
#include <cstdint>

#include "firmware/board_parameters.hpp"
#include "firmware/messages.hpp"
#include "hal/group_bus.hpp"
#include "parallel/group_member.hpp"
#include "parameters/parameter_block.hpp"
#include "protection/protection.hpp"

namespace bms::firmware {

/// An image without the bus: nothing of all this.
template <bool fitted>
class GroupSide {
 public:
  template <class... Any>
  constexpr void update(const Any&...) {}
  constexpr const protection::Decision& published(const protection::Decision& own) { return own; }
};

template <>
class GroupSide<true> {
 public:
  /// Before the protections. last: their decision with the sample before. Changes request and coils_dead of `inputs`.
  /// open_circuit_uv: of the whole battery, or measurement::no_reading.
  template <class Profile>
  [[gnu::noinline]] void update(const parameters::Values& values, std::int32_t current_ua, std::int32_t open_circuit_uv,
                                const protection::Decision& last, std::int32_t rest_ua, std::uint64_t now_us,
                                Profile& profile, protection::ExternalInputs& inputs) {
    follow(values, rest_ua);
    can::Frame frame;
    for (std::size_t k = 0; k < most_frames && hal::group_can_receive(frame); ++k) member_.receive(frame, now_us);
    if (node_ == 0) {
      order_ = {};
      inputs.request = protection::Request::none;
      protection::set_group_incomplete(inputs, true);
      return;
    }
    bool charge_wanted = false;
    if constexpr (requires { profile.control(); }) charge_wanted = profile.control().own_wanted();
    [[maybe_unused]] const bool charges = inputs.request == protection::Request::charge;
    order_ = member_.update({.request = inputs.request,
                             .state = last.state,
                             .open_circuit_uv = open_circuit_uv,
                             .current_ua = current_ua,
                             .allowed_discharge_ua = last.allowed.discharge_ua,
                             .allowed_charge_ua = last.allowed.charge_ua,
                             .rest_ua = rest_ua,
                             .charge_wanted = charge_wanted},
                            now_us);
    for (const can::Frame& own : member_.frames()) hal::group_can_send(own);
    inputs.request = order_.request;
    inputs.coils_dead = inputs.coils_dead || order_.leave;
    const parallel::Decision& group = member_.decision();
    protection::set_group_incomplete(inputs, !group.complete);
    if constexpr (requires { profile.control(); }) {
      if (!charges || group.connected == 0) closed_us_ = now_us;
      const bool enabled = now_us - closed_us_ >= charge_enabled_us;
      profile.control().join(group.leads, group.charge_wanted, enabled ? order_.charge_ua : 0);
    }
  }

  /// The decision as it is published: with the current that the truck may draw from all batteries.
  const protection::Decision& published(const protection::Decision& own) {
    published_ = own;
    published_.allowed.charge_ua = order_.charge_ua;
    published_.allowed.discharge_ua = order_.discharge_ua;
    return published_;
  }

 private:
  /// From the main contacts to the charger contactor: the self-test of one battery, 0.3 s, and two samples.
  static constexpr std::uint64_t charge_enabled_us = 500'000;
  static constexpr std::size_t most_frames = 16;  ///< of the driver's ring: bounds the time of a sample
  static_assert(parallel::most_batteries == parameters::most_batteries);
  static_assert([] {
    for (std::size_t k = 0; k < hal::group_bus_ids.size(); ++k) {
      const auto first = k < 4 ? parallel::GroupBus::first_presence_id : parallel::GroupBus::first_limits_id;
      if (hal::group_bus_ids[k] != first + k % 4) return false;
    }
    return true;
  }());

  void follow(const parameters::Values& values, std::int32_t rest_ua) {
    const auto node = static_cast<std::uint8_t>(at(values, parameters::Parameter::group_node)),
               batteries = static_cast<std::uint8_t>(at(values, parameters::Parameter::group_batteries));
    if (node == node_ && batteries == batteries_) return;
    node_ = node;
    batteries_ = batteries;
    member_ = parallel::GroupMember({.node = node, .batteries = batteries, .rest_ua = rest_ua});
  }

  std::uint64_t closed_us_ = 0;
  std::uint8_t node_ = 0, batteries_ = 0;
  parallel::GroupMember member_{{.node = 1, .batteries = 1}};
  parallel::GroupMember::Order order_;
  protection::Decision published_;
};

}  // namespace bms::firmware
