// Bytes on their way from a serial port's interrupt to the program. One writer, one reader: the indices need no lock on
// a single core.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>

namespace bms::hal {

class ReceivedBytes {
 public:
  /// From the interrupt. What does not fit is lost and counted.
  void push(char byte) {
    const std::uint32_t at = head_.load(std::memory_order_relaxed);
    if (at - tail_.load(std::memory_order_acquire) == buffer_.size()) {
      lost_.store(lost_.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
      return;
    }
    buffer_[at % buffer_.size()] = byte;
    head_.store(at + 1, std::memory_order_release);
  }

  /// From the program; false: there is none.
  bool pop(char& byte) {
    const std::uint32_t at = tail_.load(std::memory_order_relaxed);
    if (at == head_.load(std::memory_order_acquire)) return false;
    byte = buffer_[at % buffer_.size()];
    tail_.store(at + 1, std::memory_order_release);
    return true;
  }

  std::uint32_t lost() const { return lost_.load(std::memory_order_relaxed); }

 private:
  std::array<char, 512> buffer_{};
  std::atomic<std::uint32_t> head_{0}, tail_{0}, lost_{0};
};

}  // namespace bms::hal
