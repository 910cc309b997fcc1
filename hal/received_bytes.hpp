// Bytes from a serial port's interrupt to the program. One writer, one reader: on a single core the indices need no
// lock.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>

namespace bms::hal {

class ReceivedBytes {
 public:
  /// Called by the interrupt. A byte that does not fit is lost and counted.
  void push(char byte) {
    const std::uint32_t at = head_.load(std::memory_order_relaxed);
    if (at - tail_.load(std::memory_order_acquire) == buffer_.size()) return lose();
    buffer_[at % buffer_.size()] = byte;
    head_.store(at + 1, std::memory_order_release);
  }

  /// Called by the interrupt. Counts a byte that the receiver lost.
  void lose() { lost_.store(lost_.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed); }

  /// Called by the program. Returns false if no byte is waiting.
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
