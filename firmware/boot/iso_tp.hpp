// ISO-TP (ISO 15765-2:2016) on classic CAN with normal addressing: messages of up to 1,026 bytes in frames of 8. One
// message at a time in each direction. Bounded for any input: what does not fit the state is ignored or ends the
// message, as the standard says (9.8.3).
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "can/frame.hpp"

namespace bms::boot {

class IsoTp {
 public:
  static constexpr std::size_t longest = 1'026;           ///< transfer data with 1,024 bytes
  static constexpr std::uint8_t block_size = 8;           ///< frames between two flow controls that this side asks for
  static constexpr std::uint64_t timeout_us = 1'000'000;  ///< N_Bs, N_Cr

  IsoTp(std::uint32_t send_id, std::uint32_t receive_id) : send_id_(send_id), receive_id_(receive_id) {}

  /// Takes a frame of the bus; those with other identifiers are ignored. While a message waits to be taken, another one
  /// is not begun.
  void receive(const can::Frame& frame, std::uint64_t now_us);
  /// The received message, empty if none is complete. taken() frees the place.
  std::span<const std::uint8_t> message() const {
    return complete_ ? std::span(in_).first(in_size_) : std::span(in_).first(0);
  }
  void taken() { complete_ = false; }

  /// Begins to send. Returns false if another message is being sent, or if it is empty or too long.
  bool send(std::span<const std::uint8_t> message);
  bool sending() const { return out_ != Out::idle; }
  /// The next frame that is due now. Call it until it returns false.
  bool next_frame(can::Frame& frame, std::uint64_t now_us);

 private:
  enum class Out : std::uint8_t { idle, first, waiting, consecutive };

  void first_frame(const can::Frame& frame, std::uint64_t now_us);
  void consecutive_frame(const can::Frame& frame, std::uint64_t now_us);
  void flow_control(const can::Frame& frame, std::uint64_t now_us);
  can::Frame frame_of(std::size_t head, std::size_t bytes);

  std::uint32_t send_id_, receive_id_;
  std::array<std::uint8_t, longest> in_{}, out_bytes_{};
  std::size_t in_size_ = 0, in_done_ = 0, out_size_ = 0, out_done_ = 0;
  bool receiving_ = false, complete_ = false;
  std::uint8_t in_sequence_ = 0, in_block_ = 0, out_sequence_ = 0, out_block_ = 0, waits_ = 0;
  bool out_limited_ = false;
  std::uint64_t in_since_us_ = 0, out_since_us_ = 0, separation_us_ = 0;
  enum class Flow : std::uint8_t { none, go_on, overflow } flow_ = Flow::none;
  Out out_ = Out::idle;
};

}  // namespace bms::boot
