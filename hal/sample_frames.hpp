// Samples as CAN frames, for boards without a measuring chain of their own. The last frame completes the sample.
// Identifiers ascend in sending order, so a node that sends by priority keeps the order.
//
//   0x310           i32 soc_ppb, i32 soc_sigma_ppb       starting point, before the first sample; ignored unless soc is
//                                                        0 to 1 and sigma 0.001 to 0.289
//   0x311           u32 CRC-32, u16 frames, u16 counter  optional check: CRC over identifier and data of all following
//                                                        frames of the sample; `frames` is their number
//   0x312           i32 current_ua, i32 voltage_uv       of a pack: voltage over all cells
//   0x313           i32 link_plus_uv, i32 link_minus_uv  optional: load side of main plus and of main minus against the
//                                                        negative end of the cells
//   0x314 to 0x31B  i32 uv, i32 uv                       of a pack: cells 1 and 2, 3 and 4, ...
//   0x31C           4 x i16 temperature_cdegc            of a pack
//   0x31D           u48 time_us, i16 temperature_cdegc   completes the sample; of a pack: no temperature
//   0x31E to 0x321  i32 uv, i32 uv                       of a pack of more than 16 cells: cells 17 and 18, ...
//   0x322           as 0x31D, which is not sent          completes the sample of a pack of 17 to 24 cells
//   0x323 to 0x326  i32 uv, i32 uv                       of a pack of more than 24 cells: cells 25 and 26, ...
//   0x327           as 0x31D                             completes the sample of a pack of more than 24 cells
//
// A lost frame makes its readings missing. With a check frame, a sample with a wrong bit or a missing frame is
// rejected as a whole.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "hal/bytes.hpp"
#include "hal/can.hpp"
#include "measurement/pack_sample.hpp"
#include "measurement/sample.hpp"

namespace bms::hal {

inline constexpr std::uint16_t start_frame_id = 0x310, check_frame_id = 0x311, reading_frame_id = 0x312,
                               dc_link_frame_id = 0x313, first_cells_frame_id = 0x314, temperatures_frame_id = 0x31C,
                               time_frame_id = 0x31D, cell_17_frame_id = 0x31E, large_pack_time_frame_id = 0x322,
                               cell_25_frame_id = 0x323, largest_pack_time_frame_id = 0x327,
                               first_sample_frame_id = start_frame_id,
                               last_sample_frame_id =
                                   pack_cells > 24 ? largest_pack_time_frame_id : large_pack_time_frame_id;

/// The last frame of a sample of this number of cells.
template <std::size_t Cells>
inline constexpr std::uint16_t completing_frame_id = [] {
  if (Cells > 24) return largest_pack_time_frame_id;
  return Cells > 16 ? large_pack_time_frame_id : time_frame_id;
}();

/// Identifier of the frame with this cell and its neighbour; cell: 0 to 31.
constexpr std::uint16_t cells_frame_id(std::size_t cell) {
  if (cell >= 24) return static_cast<std::uint16_t>(cell_25_frame_id + cell / 2 - 12);
  return static_cast<std::uint16_t>(cell < 16 ? first_cells_frame_id + cell / 2 : cell_17_frame_id + cell / 2 - 8);
}

/// The first of the two cells of a frame of a sample of this number of cells, or nothing if it has no cells.
template <std::size_t Cells>
constexpr std::optional<std::size_t> first_cell_of(std::uint32_t id) {
  if (Cells > 24 && id >= cell_25_frame_id && id < largest_pack_time_frame_id)
    return 24 + std::size_t{2} * (id - cell_25_frame_id);
  if (id >= first_cells_frame_id && id < temperatures_frame_id) return std::size_t{2} * (id - first_cells_frame_id);
  if (id >= cell_17_frame_id && id < large_pack_time_frame_id) return 16 + std::size_t{2} * (id - cell_17_frame_id);
  return std::nullopt;
}

/// Range of a starting point's sigma. No estimate is better than the first; 1 / sqrt(12) is that of an unknown soc.
inline constexpr std::int32_t min_start_sigma_ppb = 1'000'000, max_start_sigma_ppb = 289'000'000;

/// Returns true if the identifier belongs to a sample or a starting point.
constexpr bool is_sample_frame(const can::Frame& frame) {
  return !frame.long_id && frame.id >= first_sample_frame_id && frame.id <= last_sample_frame_id;
}

/// Adds identifier and data of one frame to a CRC-32 (IEEE 802.3); initial value ~0, final value inverted.
constexpr std::uint32_t update_crc(std::uint32_t crc, const can::Frame& frame) {
  const auto add_byte = [&](std::uint8_t byte) {
    crc ^= byte;
    for (int k = 0; k < 8; ++k) crc = crc >> 1 ^ ((crc & 1) != 0 ? 0xEDB8'8320U : 0U);
  };
  add_byte(static_cast<std::uint8_t>(frame.id & 0xFF));
  add_byte(static_cast<std::uint8_t>(frame.id >> 8));
  for (const std::uint8_t byte : frame.data) add_byte(byte);
  return crc;
}

constexpr std::array<can::Frame, 2> frames_of(const measurement::Sample& s) {
  std::array<can::Frame, 2> frames{{{reading_frame_id, 8, {}}, {time_frame_id, 8, {}}}};
  put_bytes(frames[0].data, 0, s.current_ua);
  put_bytes(frames[0].data, 4, s.voltage_uv);
  put_bytes(frames[1].data, 0, s.time_us, 6);
  put_bytes(frames[1].data, 6, s.temperature_cdegc);
  return frames;
}

/// Number of frames of a pack's sample: check, current, DC link, cells in pairs, temperatures, time.
template <std::size_t Cells>
inline constexpr std::size_t pack_frames = 5 + (Cells + 1) / 2;

/// link_plus_uv, link_minus_uv: no_reading if unknown. counter: sequence number of the sample, any start value.
template <std::size_t Cells>
constexpr std::array<can::Frame, pack_frames<Cells>> frames_of(const measurement::PackSample<Cells>& s,
                                                               std::int32_t link_plus_uv, std::uint16_t counter,
                                                               std::int32_t link_minus_uv = 0) {
  static_assert(Cells <= 32);
  std::array<can::Frame, pack_frames<Cells>> frames{};
  std::size_t n = 1;
  const auto pair = [&](std::uint16_t id, std::int32_t first, std::int32_t second) {
    can::Frame& frame = frames[n++];
    frame = {id, 8, {}};
    put_bytes(frame.data, 0, first);
    put_bytes(frame.data, 4, second);
  };
  pair(reading_frame_id, s.current_ua, s.pack_uv);
  pair(dc_link_frame_id, link_plus_uv, link_minus_uv);
  for (std::size_t k = 0; k < Cells; k += 2)
    pair(cells_frame_id(k), s.cell_uv[k], k + 1 < Cells ? s.cell_uv[k + 1] : measurement::no_reading);
  can::Frame& temperatures = frames[n++];
  temperatures = {temperatures_frame_id, 8, {}};
  for (std::size_t k = 0; k < measurement::max_temperatures; ++k)
    put_bytes(temperatures.data, 2 * k, s.temperature_cdegc[k]);
  frames[n] = {completing_frame_id<Cells>, 8, {}};
  put_bytes(frames[n].data, 0, s.time_us, 6);
  put_bytes(frames[n].data, 6, measurement::no_temperature);
  std::sort(frames.begin() + 1, frames.end(), [](const can::Frame& a, const can::Frame& b) { return a.id < b.id; });
  std::uint32_t crc = ~0U;
  for (std::size_t k = 1; k < frames.size(); ++k) crc = update_crc(crc, frames[k]);
  frames[0] = {check_frame_id, 8, {}};
  put_bytes(frames[0].data, 0, ~crc);
  put_bytes(frames[0].data, 4, static_cast<std::uint16_t>(frames.size() - 1));
  put_bytes(frames[0].data, 6, counter);
  return frames;
}

constexpr can::Frame frame_of(const measurement::StartingPoint& p) {
  can::Frame frame{start_frame_id, 8, {}};
  put_bytes(frame.data, 0, p.soc_ppb);
  put_bytes(frame.data, 4, p.soc_sigma_ppb);
  return frame;
}

/// Returns the starting point of a frame, or nothing if it is another frame or a value is out of range.
constexpr std::optional<measurement::StartingPoint> starting_point_of(const can::Frame& frame) {
  if (frame.long_id || frame.id != start_frame_id || frame.length != 8) return std::nullopt;
  const measurement::StartingPoint p{get_bytes<std::int32_t>(frame.data, 0), get_bytes<std::int32_t>(frame.data, 4)};
  const bool in_range = p.soc_ppb >= 0 && p.soc_ppb <= 1'000'000'000 && p.soc_sigma_ppb >= min_start_sigma_ppb &&
                        p.soc_sigma_ppb <= max_start_sigma_ppb;
  return in_range ? std::optional(p) : std::nullopt;
}

/// Assembles samples from frames.
template <std::size_t Cells>
class SampleFrames {
 public:
  /// Returns true if `frame` completed a valid sample, which sample() holds until the next call. Frames with another
  /// length or identifier change nothing, and neither do those of a pack of another size (up to 16, 24 or 32 cells).
  constexpr bool receive(const can::Frame& frame) {
    if (const auto start = starting_point_of(frame)) start_ = start;
    if (frame.length != 8 || frame.long_id || frame.id <= start_frame_id) return false;
    if (frame.id > completing_frame_id<Cells> || (Cells > 16 && frame.id == time_frame_id) ||
        (Cells > 24 && frame.id == large_pack_time_frame_id))
      return false;
    if (done_) begin();
    if (frame.id == check_frame_id) {
      begin();
      checked_ = true;
      expected_crc_ = get_bytes<std::uint32_t>(frame.data, 0);
      expected_frames_ = get_bytes<std::uint16_t>(frame.data, 4);
      return false;
    }
    crc_ = update_crc(crc_, frame);
    ++frames_;
    if (frame.id == reading_frame_id) {
      building_.current_ua = get_bytes<std::int32_t>(frame.data, 0);
      building_.pack_uv = get_bytes<std::int32_t>(frame.data, 4);
      if constexpr (Cells == 1) building_.cell_uv[0] = building_.pack_uv;
    } else if (frame.id == dc_link_frame_id) {
      link_plus_uv_ = get_bytes<std::int32_t>(frame.data, 0);
      link_minus_uv_ = get_bytes<std::int32_t>(frame.data, 4);
    } else if (const auto first = first_cell_of<Cells>(frame.id)) {
      if (*first < Cells) building_.cell_uv[*first] = get_bytes<std::int32_t>(frame.data, 0);
      if (*first + 1 < Cells) building_.cell_uv[*first + 1] = get_bytes<std::int32_t>(frame.data, 4);
    } else if (frame.id == temperatures_frame_id) {
      for (std::size_t k = 0; k < measurement::max_temperatures; ++k)
        building_.temperature_cdegc[k] = get_bytes<std::int16_t>(frame.data, 2 * k);
    }
    if (frame.id != completing_frame_id<Cells>) return false;
    building_.time_us = get_bytes<std::uint64_t>(frame.data, 0, 6);
    if (const auto cdegc = get_bytes<std::int16_t>(frame.data, 6); cdegc != measurement::no_temperature)
      building_.temperature_cdegc[0] = cdegc;
    done_ = true;
    if (!checked_ || (~crc_ == expected_crc_ && frames_ == expected_frames_)) return true;
    ++rejected_;
    return false;
  }

  constexpr const measurement::PackSample<Cells>& sample() const { return building_; }
  constexpr std::int32_t link_plus_uv() const { return link_plus_uv_; }  ///< [uV]; no_reading: not received
  constexpr std::int32_t link_minus_uv() const { return link_minus_uv_; }
  constexpr std::uint32_t rejected() const { return rejected_; }  ///< samples with a wrong CRC or frame count
  /// The last valid starting point that was received, if any.
  constexpr const std::optional<measurement::StartingPoint>& starting_point() const { return start_; }

 private:
  constexpr void begin() {
    building_ = {};
    link_plus_uv_ = link_minus_uv_ = measurement::no_reading;
    crc_ = ~0U;
    frames_ = 0;
    checked_ = done_ = false;
  }

  measurement::PackSample<Cells> building_{};
  std::optional<measurement::StartingPoint> start_;
  std::int32_t link_plus_uv_ = measurement::no_reading, link_minus_uv_ = measurement::no_reading;
  std::uint32_t crc_ = ~0U, expected_crc_ = 0, rejected_ = 0;
  std::uint16_t frames_ = 0, expected_frames_ = 0;
  bool checked_ = false, done_ = false;
};

}  // namespace bms::hal
