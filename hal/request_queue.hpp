// Frames that arrived between the samples and wait for next_request() (hal/requests.hpp). Holds eight frames; while it
// is full, new frames are dropped.
#pragma once

#include <array>
#include <cstddef>

#include "hal/can.hpp"

namespace bms::hal {

class RequestQueue {
 public:
  constexpr void push(const can::Frame& frame) {
    if (size_ == frames_.size()) return;
    frames_[(first_ + size_) % frames_.size()] = frame;
    ++size_;
  }
  constexpr bool pop(can::Frame& frame) {
    if (size_ == 0) return false;
    frame = frames_[first_];
    first_ = (first_ + 1) % frames_.size();
    --size_;
    return true;
  }

 private:
  std::array<can::Frame, 8> frames_{};
  std::size_t first_ = 0, size_ = 0;
};

}  // namespace bms::hal
