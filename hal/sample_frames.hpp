// Samples over CAN, for boards whose measuring chain is not there: two frames a sample, the second completes it.
//
//   0x310  i32 current_ua, i32 voltage_uv
//   0x311  u48 time_us, i16 temperature_cdegc
//   0x312  i32 soc_ppb, i32 soc_sigma_ppb       the starting point, before the first sample
#pragma once

#include <array>

#include "estimator/sample.hpp"
#include "hal/bytes.hpp"
#include "hal/can.hpp"

namespace bms::hal {

inline constexpr std::uint16_t reading_frame_id = 0x310, time_frame_id = 0x311, start_frame_id = 0x312;

constexpr std::array<CanFrame, 2> frames_of(const Sample& s) {
  std::array<CanFrame, 2> frames{{{reading_frame_id, 8, {}}, {time_frame_id, 8, {}}}};
  put_bytes(frames[0].data, 0, s.current_ua);
  put_bytes(frames[0].data, 4, s.voltage_uv);
  put_bytes(frames[1].data, 0, s.time_us, 6);
  put_bytes(frames[1].data, 6, s.temperature_cdegc);
  return frames;
}

constexpr CanFrame frame_of(const StartingPoint& p) {
  CanFrame frame{start_frame_id, 8, {}};
  put_bytes(frame.data, 0, p.soc_ppb);
  put_bytes(frame.data, 4, p.soc_sigma_ppb);
  return frame;
}

/// Takes in a frame; true when it completed `sample`, which begins as Sample{} each time. Frames of another length or number
/// change nothing.
constexpr bool completes(const CanFrame& frame, Sample& sample) {
  if (frame.length != 8) return false;
  if (frame.id == reading_frame_id) {
    sample.current_ua = get_bytes<std::int32_t>(frame.data, 0);
    sample.voltage_uv = get_bytes<std::int32_t>(frame.data, 4);
  }
  if (frame.id != time_frame_id) return false;
  sample.time_us = get_bytes<std::uint64_t>(frame.data, 0, 6);
  sample.temperature_cdegc = get_bytes<std::int16_t>(frame.data, 6);
  return true;
}

/// Whether the frame is one of these.
constexpr bool of_sample(const CanFrame& frame) { return frame.id >= reading_frame_id && frame.id <= start_frame_id; }

constexpr bool is_start(const CanFrame& frame) { return frame.id == start_frame_id && frame.length == 8; }

constexpr StartingPoint start_of(const CanFrame& frame) {
  return {get_bytes<std::int32_t>(frame.data, 0), get_bytes<std::int32_t>(frame.data, 4)};
}

}  // namespace bms::hal
