// Frames that wait for a transmit mailbox, in the order in which the bus would take them: by arbitration, and of one
// identifier the older first. Full: the least urgent goes, be it the new one.
//
// Depth: frames; the numbers that give the order of age wrap safely. Cost: a pass over the frames that wait.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "hal/can.hpp"

namespace bms::hal::bxcan {

struct WaitingFrame {
  can::Frame frame;
  std::uint32_t number = 0;  ///< of can_send()
};

/// The arbitration field's bits as they come on the wire: lower wins, equal is the same identifier. A frame of 29 bits
/// has SRR and IDE recessive behind its first eleven and so loses to the standard frame with these eleven (ISO
/// 11898-1, 10.4.2).
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
  /// False when a frame was given up for want of a place: the least urgent of all.
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

  /// The most urgent one that `may`, taken out; false: none.
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
