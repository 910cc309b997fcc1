// The address of a J1939 node (SAE J1939-81, as public implementations have it): claims one, defends it by its NAME,
// and moves to another one if a node with a smaller NAME, which is more urgent, has it.
//
//   0x18EEFF00 + address   out   address claimed, the NAME; from the null address: none is free
//                          in    the same of another node
//   0x18EAxx00             in    request for the parameter group 0xEE00, to this address or to all
//
// Nothing else may be sent before 250 ms have passed without a loss.
#pragma once

#include <cstdint>

#include "hal/bytes.hpp"
#include "hal/can.hpp"

namespace bms::firmware::j1939 {

/// Fields of NAME, from bit 0 up.
struct Name {
  std::uint32_t identity = 1;                         ///< 21 bits: of the unit
  std::uint32_t manufacturer = 0x7FF;                 ///< 11 bits, assigned by SAE; no manufacturer
  std::uint32_t instances = 0;                        ///< of control unit and function, 8 bits
  std::uint32_t function = 0xFF;                      ///< not available
  std::uint32_t vehicle_system = 0x7F, industry = 0;  ///< not available; global

  /// With the capability to take any address.
  constexpr std::uint64_t value() const {
    return std::uint64_t{identity & 0x1F'FFFF} | std::uint64_t{manufacturer & 0x7FF} << 21 |
           std::uint64_t{instances & 0xFF} << 32 | std::uint64_t{function & 0xFF} << 40 |
           std::uint64_t{vehicle_system & 0x7F} << 49 | std::uint64_t{industry & 7} << 60 | std::uint64_t{1} << 63;
  }
};

class Address {
 public:
  static constexpr std::uint8_t first = 0x80, last = 0xF7;  ///< for nodes that choose by themselves
  static constexpr std::uint8_t null = 0xFE, all = 0xFF;
  static constexpr std::uint32_t contention_us = 250'000, claimed = 0x18EE'FF00;

  constexpr explicit Address(std::uint64_t name, std::uint8_t preferred = first) : name_(name), address_(preferred) {}

  constexpr std::uint8_t value() const { return address_; }

  /// Call at each sample. Returns true if messages may be sent from value(). A claim that could not be sent is
  /// repeated.
  bool update(std::uint64_t now_us) {
    if (!began_) send(now_us);
    return began_ && address_ != null && now_us - sent_us_ >= contention_us;
  }

  /// Call while nobody listens. Others may have claimed the address meanwhile, so it is claimed again afterwards.
  void stop() {
    began_ = false;
    moves_ = 0;
    if (address_ == null) address_ = first;
  }

  void receive(const can::Frame& frame, std::uint64_t now_us) {
    if (!frame.long_id || !began_) return;
    const std::uint32_t group = frame.id >> 16 & 0xFF;
    const auto to = static_cast<std::uint8_t>(frame.id >> 8), from = static_cast<std::uint8_t>(frame.id);
    if (group == 0xEA && frame.length >= 3 && (to == address_ || to == all)) {
      if (frame.data[0] == 0 && frame.data[1] == 0xEE && frame.data[2] == 0) answer();
      return;
    }
    if (group != 0xEE || frame.length != 8 || from != address_ || address_ == null) return;
    if (hal::get_bytes<std::uint64_t>(frame.data, 0) > name_) return answer();
    if (++moves_ > last - first) {
      address_ = null;
      return answer();
    }
    address_ = address_ == last ? first : static_cast<std::uint8_t>(address_ + 1);
    send(now_us);
  }

 private:
  /// Returns false if it cannot be sent.
  bool claim() const {
    can::Frame frame{claimed | address_, 8, {}, true};
    hal::put_bytes(frame.data, 0, name_);
    return hal::can_send(frame);
  }
  void answer() { began_ = claim(); }
  void send(std::uint64_t now_us) {
    sent_us_ = now_us;
    answer();
  }

  std::uint64_t name_, sent_us_ = 0;
  std::uint8_t address_, moves_ = 0;
  bool began_ = false;
};

}  // namespace bms::firmware::j1939
