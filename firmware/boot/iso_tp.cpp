#include "boot/iso_tp.hpp"

#include <algorithm>

namespace bms::boot {

namespace {

constexpr std::uint8_t padding = 0xCC, most_waits = 10;
constexpr std::size_t in_single = 7, in_first = 6;

/// STmin (ISO 15765-2, table 20); reserved values count as the longest time.
std::uint64_t separation_us(std::uint8_t st_min) {
  if (st_min <= 0x7F) return st_min * 1'000U;
  if (st_min >= 0xF1 && st_min <= 0xF9) return (st_min - 0xF0U) * 100U;
  return 127'000;
}

}  // namespace

void IsoTp::receive(const can::Frame& frame, std::uint64_t now_us) {
  if (frame.long_id || frame.id != receive_id_ || frame.length == 0) return;
  if (receiving_ && now_us - in_since_us_ > timeout_us) receiving_ = false;
  switch (frame.data[0] >> 4) {
    case 0: {
      const std::size_t size = frame.data[0] & 15U;
      if (complete_ || size == 0 || size > in_single || size >= frame.length) return;
      receiving_ = false;
      std::copy_n(frame.data.begin() + 1, size, in_.begin());
      in_size_ = size;
      complete_ = true;
      return;
    }
    case 1:
      return first_frame(frame, now_us);
    case 2:
      return consecutive_frame(frame, now_us);
    case 3:
      return flow_control(frame, now_us);
    default:
      return;
  }
}

void IsoTp::first_frame(const can::Frame& frame, std::uint64_t now_us) {
  const std::size_t size = (frame.data[0] & 15U) << 8 | frame.data[1];
  if (complete_ || frame.length != 8 || (size <= in_single && size != 0)) return;
  receiving_ = false;
  if (size > longest || size == 0) {  // 0: a length of 32 bits follows
    flow_ = Flow::overflow;
    return;
  }
  std::copy_n(frame.data.begin() + 2, in_first, in_.begin());
  in_size_ = size;
  in_done_ = in_first;
  in_sequence_ = 1;
  in_block_ = 0;
  in_since_us_ = now_us;
  receiving_ = true;
  flow_ = Flow::go_on;
}

void IsoTp::consecutive_frame(const can::Frame& frame, std::uint64_t now_us) {
  if (!receiving_) return;
  const std::size_t bytes = std::min(in_size_ - in_done_, in_single);
  if ((frame.data[0] & 15U) != in_sequence_ || frame.length < bytes + 1) {
    receiving_ = false;
    return;
  }
  std::copy_n(frame.data.begin() + 1, bytes, in_.begin() + static_cast<std::ptrdiff_t>(in_done_));
  in_done_ += bytes;
  in_sequence_ = (in_sequence_ + 1) & 15U;
  in_since_us_ = now_us;
  if (in_done_ == in_size_) {
    receiving_ = false;
    complete_ = true;
  } else if (++in_block_ == block_size) {
    in_block_ = 0;
    flow_ = Flow::go_on;
  }
}

void IsoTp::flow_control(const can::Frame& frame, std::uint64_t now_us) {
  if (out_ != Out::waiting || frame.length < 3) return;
  switch (frame.data[0] & 15U) {
    case 0:
      out_limited_ = frame.data[1] != 0;
      out_block_ = frame.data[1];
      separation_us_ = separation_us(frame.data[2]);
      out_since_us_ = now_us - separation_us_;
      waits_ = 0;
      out_ = Out::consecutive;
      return;
    case 1:
      out_since_us_ = now_us;
      if (++waits_ > most_waits) out_ = Out::idle;
      return;
    default:
      out_ = Out::idle;
  }
}

bool IsoTp::send(std::span<const std::uint8_t> message) {
  if (sending() || message.empty() || message.size() > longest) return false;
  std::ranges::copy(message, out_bytes_.begin());
  out_size_ = message.size();
  out_done_ = 0;
  waits_ = 0;
  out_ = Out::first;
  return true;
}

can::Frame IsoTp::frame_of(std::size_t head, std::size_t bytes) {
  can::Frame frame{send_id_, 8, {}};
  frame.data.fill(padding);
  std::copy_n(out_bytes_.begin() + static_cast<std::ptrdiff_t>(out_done_), bytes,
              frame.data.begin() + static_cast<std::ptrdiff_t>(head));
  out_done_ += bytes;
  return frame;
}

bool IsoTp::next_frame(can::Frame& frame, std::uint64_t now_us) {
  if (flow_ != Flow::none) {
    frame = {send_id_, 8, {}};
    frame.data.fill(padding);
    frame.data[0] = flow_ == Flow::go_on ? 0x30 : 0x32;
    frame.data[1] = block_size;
    frame.data[2] = 0;
    flow_ = Flow::none;
    return true;
  }
  if (out_ == Out::first && out_size_ <= in_single) {
    frame = frame_of(1, out_size_);
    frame.data[0] = static_cast<std::uint8_t>(out_size_);
    out_ = Out::idle;
    return true;
  }
  if (out_ == Out::first) {
    frame = frame_of(2, in_first);
    frame.data[0] = static_cast<std::uint8_t>(0x10 | out_size_ >> 8);
    frame.data[1] = static_cast<std::uint8_t>(out_size_);
    out_sequence_ = 1;
    out_since_us_ = now_us;
    out_ = Out::waiting;
    return true;
  }
  if (out_ == Out::waiting && now_us - out_since_us_ > timeout_us) out_ = Out::idle;
  if (out_ != Out::consecutive || now_us - out_since_us_ < separation_us_) return false;
  frame = frame_of(1, std::min(out_size_ - out_done_, in_single));
  frame.data[0] = static_cast<std::uint8_t>(0x20 | out_sequence_);
  out_sequence_ = (out_sequence_ + 1) & 15U;
  out_since_us_ = now_us;
  if (out_done_ == out_size_)
    out_ = Out::idle;
  else if (out_limited_ && --out_block_ == 0)
    out_ = Out::waiting;
  return true;
}

}  // namespace bms::boot
