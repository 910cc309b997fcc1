// A frame as a host sees it on a CAN bus: any kind that can be there, with the time it was received.
#pragma once

#include <array>
#include <cstdint>

#include "hal/can.hpp"

namespace bms::monitor {

enum class FrameKind : std::uint8_t {
  standard,  ///< data, 11-bit id: the battery's own messages
  extended,  ///< data, 29-bit id: those of its J1939 profile
  remote,    ///< a request, either id
  error,     ///< what the controller of this machine reports; id holds the class (linux/can/error.h)
  fd,        ///< CAN FD, either id
};

struct BusFrame {
  std::int64_t time_us = 0;  ///< since 1970, or since whatever a log counts from
  FrameKind kind = FrameKind::standard;
  bool long_id = false;  ///< 29 bits
  std::uint8_t length =
      0;  ///< bytes of data in use, at most 8, FD at most 64; of a remote request the length asked for
  std::uint8_t fd_flags = 0;  ///< as candump writes them
  std::uint32_t id = 0;
  std::array<std::uint8_t, 64> data{};
};

/// The part that decoders look at; frame.kind must be standard or extended.
constexpr can::Frame to_can_frame(const BusFrame& frame) {
  can::Frame out{frame.id, frame.length, {}, frame.long_id};
  for (std::size_t k = 0; k < out.data.size(); ++k) out.data[k] = frame.data[k];
  return out;
}

constexpr BusFrame to_bus_frame(const can::Frame& frame, std::int64_t time_us) {
  BusFrame out;
  out.time_us = time_us;
  out.kind = frame.long_id ? FrameKind::extended : FrameKind::standard;
  out.long_id = frame.long_id;
  out.length = frame.length;
  out.id = frame.id;
  for (std::size_t k = 0; k < frame.data.size(); ++k) out.data[k] = frame.data[k];
  return out;
}

}  // namespace bms::monitor
