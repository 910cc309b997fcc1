// Identifiers on the bus. The firmware names its messages by those of firmware/can/greybox_bms.dbc: 0x180 to 0x1BF, and
// Stop at 0x0A0. On a bus where they are taken (0x180 to 0x1B9 are the first transmit PDOs of CANopen nodes 0 to 57),
// a back end moves the block to another base and Stop to another identifier. The data id of the end-to-end protection
// stays, so a receiver that moves the identifiers back needs no other change.
#pragma once

#include <cstdint>

#include "can/frame.hpp"

namespace bms::hal {

/// Bit rate and identifiers of this node.
struct CanSettings {
  std::uint32_t bit_rate;    ///< [bit/s]
  std::uint16_t base, stop;  ///< identifiers of the first message of the block, and of Stop
};

class Identifiers {
 public:
  static constexpr std::uint16_t dbc_base = 0x180, block = 0x40, dbc_stop = 0x0A0;

  constexpr Identifiers() = default;
  constexpr explicit Identifiers(const CanSettings& settings) : base_(settings.base), stop_(settings.stop) {}

  /// An identifier of the DBC file as it is on the bus. Those of other protocols stay.
  constexpr std::uint16_t on_the_bus(std::uint16_t id) const {
    if (id == dbc_stop) return stop_;
    return id >= dbc_base && id < dbc_base + block ? static_cast<std::uint16_t>(id - dbc_base + base_) : id;
  }
  constexpr can::Frame on_the_bus(can::Frame frame) const {
    if (!frame.long_id) frame.id = on_the_bus(static_cast<std::uint16_t>(frame.id));
    return frame;
  }
  /// Replaces the identifier on the bus by that of the DBC file. Returns false for a frame of another node that has an
  /// identifier of the DBC file.
  constexpr bool from_the_bus(can::Frame& frame) const {
    if (frame.long_id) return true;
    if (frame.id == stop_)
      frame.id = dbc_stop;
    else if (frame.id >= base_ && frame.id < base_ + std::uint32_t{block})
      frame.id = frame.id - base_ + dbc_base;
    else if (frame.id == dbc_stop || (frame.id >= dbc_base && frame.id < dbc_base + std::uint32_t{block}))
      return false;
    return true;
  }

 private:
  std::uint16_t base_ = dbc_base, stop_ = dbc_stop;
};

}  // namespace bms::hal
