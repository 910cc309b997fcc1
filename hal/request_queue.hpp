// Received frames that wait for the firmware, each kind in a place of its own, so that no kind can take the place of
// another:
//
//   stop            one: the newest. Stop
//   nothing         one: the newest request for nothing
//   drive requests  48, the newest first: the newest valid one counts, so a flood can only push out older ones
//   request         one: the newest plain request for power (Command)
//   commands        eight, the oldest first: other commands and the frames of service sessions
//   network         eight, the oldest first: CANopen, chargers with 29-bit identifiers
//
// A frame of the battery's own messages that is too short, has a wrong CRC or an impossible counter is never queued. A
// frame that finds its place full is dropped; of drive requests, the oldest one.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "can/codec.hpp"
#include "hal/accepted_frames.hpp"
#include "hal/can.hpp"

namespace bms::hal {

/// Frames in the order of their arrival.
template <std::size_t Size>
class FrameRing {
 public:
  constexpr bool full() const { return size_ == Size; }
  constexpr void push(const can::Frame& frame) {
    frames_[(first_ + size_) % Size] = frame;
    ++size_;
  }
  constexpr void push_over_oldest(const can::Frame& frame) {
    if (full()) drop_oldest();
    push(frame);
  }
  constexpr bool pop_oldest(can::Frame& frame) {
    if (size_ == 0) return false;
    frame = frames_[first_];
    drop_oldest();
    return true;
  }
  constexpr bool pop_newest(can::Frame& frame) {
    if (size_ == 0) return false;
    frame = frames_[(first_ + --size_) % Size];
    return true;
  }

 private:
  constexpr void drop_oldest() {
    first_ = (first_ + 1) % Size;
    --size_;
  }
  std::array<can::Frame, Size> frames_{};
  std::size_t first_ = 0, size_ = 0;
};

class RequestQueue {
 public:
  static constexpr std::size_t drive_requests = 48;

  constexpr void push(const can::Frame& frame) {
    if (frame.long_id) {
      for (const LongId& accepted : long_ids) {
        if (accepted.matches(frame.id) && !network_.full()) return network_.push(frame);
      }
      return;
    }
    if (!is_own(frame.id)) {
      if (!network_.full()) network_.push(frame);
      return;
    }
    if (!can::intact(frame, static_cast<std::uint16_t>(frame.id)) || can::counter_of(frame) >= can::counters) return;
    if (frame.id == stop_frame_id)
      stop_.push_over_oldest(frame);
    else if (asks_for_nothing(frame))
      nothing_.push_over_oldest(frame);
    else if (frame.id == drive_request_frame_id)
      drive_.push_over_oldest(frame);
    else if (is_plain_request(frame))
      request_.push_over_oldest(frame);
    else if (!commands_.full())
      commands_.push(frame);
  }

  /// A stop first, then a request for nothing, drive requests from the newest on, the plain request, commands.
  constexpr bool pop(can::Frame& frame) {
    return stop_.pop_oldest(frame) || nothing_.pop_oldest(frame) || drive_.pop_newest(frame) ||
           request_.pop_oldest(frame) || commands_.pop_oldest(frame);
  }
  constexpr bool pop_network(can::Frame& frame) { return network_.pop_oldest(frame); }

 private:
  static constexpr bool is_own(std::uint32_t id) {
    return id == stop_frame_id || id == command_frame_id || id == service_request_frame_id ||
           id == command_authority_frame_id || id == drive_request_frame_id;
  }
  static constexpr bool is_plain_request(const can::Frame& frame) {
    return frame.id == command_frame_id && can::get_raw(frame, 12, 8) == request_code;
  }
  static constexpr bool asks_for_nothing(const can::Frame& frame) {
    return (is_plain_request(frame) && can::get_raw(frame, 20, 32) == 0) ||
           (frame.id == drive_request_frame_id && can::get_raw(frame, 12, 4) == 0);
  }

  FrameRing<1> stop_, nothing_, request_;
  FrameRing<drive_requests> drive_;
  FrameRing<8> commands_, network_;
};

}  // namespace bms::hal
