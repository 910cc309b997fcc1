// A minimal CANopen slave (CiA 301): network management (NMT), heartbeat and an SDO server for values of up to four
// bytes and for texts that are read.
//
//   000h          in     NMT: start, stop, pre-operational or reset, for this node or for all
//   700h + node   out    boot-up once, then the state every heartbeat_us
//   600h + node   in     SDO: read or write an object in one frame (expedited transfer), read a text in segments
//   580h + node   out    the answer, or an abort code
//   700h + peer   in     heartbeat of one other node
//
// The node becomes operational without a master, because a truck may have none. In state "stopped" it sends only its
// heartbeat. Block transfers, and writing in segments, are refused. The owner implements the objects: read(index, sub)
// and write(index, sub, value, length). Source: CiA 301 version 4.2.0, sections 7.2.4 (SDO) and 7.2.8 (NMT), as public
// implementations have it.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <string_view>

#include "firmware/cycle.hpp"
#include "hal/bytes.hpp"
#include "hal/can.hpp"
#include "hal/charger_bus.hpp"

namespace bms::firmware::canopen {

inline constexpr std::uint32_t nmt_id = 0x000, sdo_answer_id = 0x580, sdo_request_id = 0x600, heartbeat_id = 0x700;

enum class NodeState : std::uint8_t { boot_up = 0, stopped = 4, operational = 5, pre_operational = 127 };

/// SDO abort codes; none means success.
enum class AbortCode : std::uint32_t {
  none = 0,
  toggle_not_alternated = 0x0503'0000,
  unknown_command = 0x0504'0001,
  read_only = 0x0601'0002,
  no_such_object = 0x0602'0000,
  wrong_length = 0x0607'0010,
  no_such_sub_index = 0x0609'0011
};

/// Value of an object.
struct Entry {
  std::uint32_t value = 0;
  std::uint8_t length = 0;  ///< bytes: 1, 2 or 4
  AbortCode abort_code = AbortCode::none;
  std::string_view text{};  ///< if not empty, instead of value; of static storage
};

/// Of a node; the same bus if the charger has none of its own.
enum class Bus : std::uint8_t { of_charger, of_truck };

class Node {
 public:
  static constexpr std::uint32_t heartbeat_us = 500'000;

  constexpr explicit Node(std::uint8_t id, Bus bus = Bus::of_charger) : id_(id), bus_(bus) {}

  constexpr NodeState state() const { return state_; }

  /// Sends boot-up or a heartbeat if it is due. Call at each sample; now_us is the time of the sample.
  void update_heartbeat(std::uint32_t now_us) {
    const bool boot_up = state_ == NodeState::boot_up;
    if (boot_up) heartbeat_.restart();
    if (!heartbeat_.due(now_us, heartbeat_us)) return;
    send_heartbeat(state_);
    if (boot_up) state_ = NodeState::operational;
  }

  /// Handles NMT and SDO requests. Returns true if the frame was for this node.
  template <class Objects>
  bool receive(const can::Frame& frame, Objects&& objects) {
    if (frame.long_id) return false;
    if (frame.id == nmt_id && frame.length == 2 && (frame.data[1] == 0 || frame.data[1] == id_)) {
      apply_nmt_command(frame.data[0]);
      return true;
    }
    if (frame.id != sdo_request_id + id_ || frame.length != 8) return false;
    if (state_ == NodeState::operational || state_ == NodeState::pre_operational) serve_sdo(frame, objects);
    return true;
  }

 private:
  static constexpr std::uint8_t start = 1, stop = 2, enter_pre_operational = 128, reset_node = 129,
                                reset_communication = 130;
  // client command specifiers: the upper three bits
  static constexpr std::uint8_t download = 1, upload = 2, upload_segment = 3, abort = 4;
  static constexpr std::size_t value_at = 4;

  constexpr void apply_nmt_command(std::uint8_t command) {
    if (command == start) state_ = NodeState::operational;
    if (command == stop) state_ = NodeState::stopped;
    if (command == enter_pre_operational) state_ = NodeState::pre_operational;
    if (command == reset_node || command == reset_communication) state_ = NodeState::boot_up;
  }

  void send(const can::Frame& frame) const {
    if constexpr (hal::has_charger_bus) {
      if (bus_ == Bus::of_truck) return static_cast<void>(hal::can_send(frame));
    }
    hal::send_to_charger(frame);
  }

  void send_heartbeat(NodeState state) const { send({heartbeat_id + id_, 1, {static_cast<std::uint8_t>(state)}}); }

  template <class Objects>
  void serve_sdo(const can::Frame& request, Objects& objects) {
    const auto index = hal::get_bytes<std::uint16_t>(request.data, 1);
    const std::uint8_t command = request.data[0] >> 5, sub = request.data[3];
    if (command == upload_segment) return send_segment(request);
    rest_ = {};  // a new transfer ends the one before
    std::copy_n(request.data.begin() + 1, object_.size(), object_.begin());
    if (command == abort) return;
    can::Frame answer{sdo_answer_id + id_, 8, {0, request.data[1], request.data[2], sub}};
    AbortCode abort_code = AbortCode::unknown_command;
    if (command == upload) {
      const Entry entry = objects.read(index, sub);
      abort_code = entry.abort_code;
      rest_ = entry.text;
      toggle_ = 0;
      answer.data[0] = static_cast<std::uint8_t>(rest_.empty() ? 0x43 | (4 - entry.length) << 2 : 0x41);
      hal::put_bytes(answer.data, value_at, rest_.empty() ? entry.value : static_cast<std::uint32_t>(rest_.size()));
    } else if (command == download && (request.data[0] & 3) == 3) {  // expedited, with its length
      abort_code = objects.write(index, sub, hal::get_bytes<std::uint32_t>(request.data, value_at),
                                 static_cast<std::uint8_t>(4 - (request.data[0] >> 2 & 3)));
      answer.data[0] = 0x60;
    }
    if (abort_code != AbortCode::none) make_abort(answer, abort_code);
    send(answer);
  }

  static void make_abort(can::Frame& answer, AbortCode code) {
    answer.data[0] = 0x80;
    hal::put_bytes(answer.data, value_at, static_cast<std::uint32_t>(code));
  }

  /// The next seven characters; bit 4 alternates, bit 0 says that they are the last ones.
  void send_segment(const can::Frame& request) {
    can::Frame answer{sdo_answer_id + id_, 8, {}};
    if (rest_.empty() || (request.data[0] & 0x10) != toggle_) {
      make_abort(answer, rest_.empty() ? AbortCode::unknown_command : AbortCode::toggle_not_alternated);
      if (!rest_.empty()) std::ranges::copy(object_, answer.data.begin() + 1);  // else there is no transfer to name
      rest_ = {};
    } else {
      const std::size_t sent = std::min<std::size_t>(rest_.size(), 7);
      answer.data[0] = static_cast<std::uint8_t>(toggle_ | (7 - sent) << 1 | (sent == rest_.size() ? 1U : 0U));
      std::ranges::copy(rest_.substr(0, sent), answer.data.begin() + 1);
      rest_.remove_prefix(sent);
      toggle_ ^= 0x10;
    }
    send(answer);
  }

  Cycle heartbeat_;
  std::uint8_t id_;
  NodeState state_ = NodeState::boot_up;
  Bus bus_;
  std::string_view rest_{};               ///< of a text that is read
  std::array<std::uint8_t, 3> object_{};  ///< index and subindex of the last transfer
  std::uint8_t toggle_ = 0;
};

/// Another node, as its heartbeat shows it.
class Peer {
 public:
  /// Without a heartbeat for this time the node is gone. Chargers send one per second by default, and two may be lost.
  static constexpr std::uint64_t timeout_us = 3'500'000;

  constexpr explicit Peer(std::uint8_t id) : id_(id) {}

  constexpr void receive(const can::Frame& frame, std::uint64_t now_us) {
    if (frame.long_id || frame.id != heartbeat_id + id_ || frame.length != 1) return;
    const auto state = static_cast<NodeState>(frame.data[0] & 0x7F);  // bit 7 alternates in answers to node guarding
    repeated_ = present(now_us) && state == state_;
    state_ = state;
    received_us_ = now_us;
  }
  /// Returns true if the node sends heartbeats and is not stopped.
  constexpr bool present(std::uint64_t now_us) const {
    return state_ != NodeState::stopped && now_us - received_us_ < timeout_us;
  }
  /// Returns true if two heartbeats in a row, the last one within the timeout, were "operational". A heartbeat has no
  /// check code, so a single one is not enough to switch something on.
  constexpr bool operational(std::uint64_t now_us) const {
    return present(now_us) && repeated_ && state_ == NodeState::operational;
  }

 private:
  std::uint64_t received_us_ = 0;
  std::uint8_t id_;
  NodeState state_ = NodeState::stopped;  ///< of the last heartbeat
  bool repeated_ = false;                 ///< the heartbeat before had the same state
};

}  // namespace bms::firmware::canopen
