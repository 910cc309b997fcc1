// Frames that wait for a transmit mailbox, in the order of arbitration; frames with the same identifier by age. If the
// queue is full, the least urgent frame is dropped, which may be the new one.
//
// Depth: frames. Sequence numbers give the age and may wrap. Cost: one pass over the waiting frames.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "hal/can.hpp"

namespace bms::hal::bxcan {

struct WaitingFrame {
  can::Frame frame;
  std::uint32_t number = 0;  ///< sequence number of the can_send() call
};

/// Bits of the arbitration field in the order on the wire: the lower value wins, equal values mean the same identifier.
/// A 29-bit frame has SRR and IDE recessive after its first eleven bits, so it loses against the standard frame with
/// these eleven bits (ISO 11898-1, 10.4.2).
constexpr std::uint32_t arbitration(const can::Frame& frame) {
  return frame.long_id ? frame.id >> 18 << 21 | 3U << 19 | (frame.id & 0x3'FFFFU) << 1 : frame.id << 21;
}

constexpr bool more_urgent(const WaitingFrame& a, const WaitingFrame& b) {
  const std::uint32_t of_a = arbitration(a.frame), of_b = arbitration(b.frame);
  return of_a != of_b ? of_a < of_b : static_cast<std::int32_t>(a.number - b.number) < 0;
}

template <std::size_t Depth>
class TransmitQueue {
 public:
  /// Returns false if the queue was full and the least urgent frame, possibly the new one, was dropped.
  constexpr bool insert(const WaitingFrame& waiting) {
    const bool room = size_ < Depth;
    if (!room && !more_urgent(waiting, frames_[0])) return false;
    std::size_t at = room ? size_++ : 0;
    if (room) {
      for (; at > 0 && more_urgent(frames_[at - 1], waiting); --at) frames_[at] = frames_[at - 1];
    } else {
      for (; at + 1 < Depth && more_urgent(waiting, frames_[at + 1]); ++at) frames_[at] = frames_[at + 1];
    }
    frames_[at] = waiting;
    return room;
  }

  /// Removes the most urgent frame that `may` accepts. Returns false if no frame qualifies.
  template <class May>
  constexpr bool pop(WaitingFrame& out, May&& may) {
    const WaitingFrame* found = most_urgent(may);
    if (found == nullptr) return false;
    out = *found;
    for (auto at = static_cast<std::size_t>(found - frames_.data()); at + 1 < size_; ++at)
      frames_[at] = frames_[at + 1];
    --size_;
    return true;
  }

  /// Returns the most urgent frame that `may` accepts, or nullptr.
  template <class May>
  constexpr const WaitingFrame* most_urgent(May&& may) const {
    for (std::size_t k = size_; k-- > 0;) {
      if (may(frames_[k])) return &frames_[k];
    }
    return nullptr;
  }

  constexpr std::size_t size() const { return size_; }
  constexpr void clear() { size_ = 0; }

 private:
  std::array<WaitingFrame, Depth> frames_{};  // least urgent first
  std::size_t size_ = 0;
};

}  // namespace bms::hal::bxcan
