// A CAN frame of any kind as a host receives it, with its time stamp.
#pragma once

#include <array>
#include <cstdint>

#include "hal/can.hpp"

namespace bms::monitor {

enum class FrameKind : std::uint8_t {
  standard,  ///< data, 11-bit id: the battery's own messages
  extended,  ///< data, 29-bit id: messages of the J1939 profile
  remote,    ///< remote request, 11-bit or 29-bit id
  error,     ///< error report of this machine's controller; id holds the class (linux/can/error.h)
  fd,        ///< CAN FD, 11-bit or 29-bit id
};

struct BusFrame {
  std::int64_t time_us = 0;  ///< since 1970, or since the start of a log
  FrameKind kind = FrameKind::standard;
  bool long_id = false;  ///< 29 bits
  /// Data bytes, at most 8, or 64 with CAN FD; of a remote request the requested length.
  std::uint8_t length = 0;
  std::uint8_t fd_flags = 0;  ///< as in a candump log
  std::uint32_t id = 0;
  std::array<std::uint8_t, 64> data{};
};

/// frame.kind must be standard or extended.
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
