// The bus of the emulated forklift board as a source of frames for the host's tools: reading passes time on the board.
// Another node measures the cells and sends ten samples a second.
#pragma once

#include <algorithm>

#include "boot/update_server.hpp"
#include "hal/sample_frames.hpp"
#include "monitor/frame_source.hpp"
#include "tests/firmware/boot/loader_board.hpp"

namespace bms::boot {

class BoardBus final : public monitor::FrameSource {
 public:
  static constexpr std::size_t cells = 16;  // of the forklift board
  static constexpr firmware::WireFrame other_frame{.id = 0x2F0, .length = 8, .data = {1, 2, 3, 4, 5, 6, 7, 8}};

  explicit BoardBus(firmware::UnicornBoard& board) : board_(board), seen_(board.can.seen.size()) {}

  std::size_t read(std::span<monitor::BusFrame> room, int wait_ms) override {
    for (double until = board_.now_ms() + wait_ms; !answered() && board_.now_ms() < until;) pass(1);
    std::size_t n = 0;
    for (; seen_ < board_.can.seen.size() && n < room.size(); ++seen_) {
      const firmware::SeenFrame& f = board_.can.seen[seen_];
      if (!f.from_board) continue;
      room[n].kind = monitor::FrameKind::standard;
      room[n].id = f.frame.id;
      room[n].length = f.frame.length;
      std::ranges::copy(f.frame.data, room[n].data.begin());
      ++n;
    }
    return n;
  }
  bool ended() const override { return end_ms > 0 && board_.now_ms() >= end_ms; }
  bool live() const override { return true; }
  bool send(const can::Frame& frame) override {
    board_.can.others.push_back({firmware::wire_frame(frame), 0, false});
    return true;
  }
  /// Time passes without the tool.
  void pass(double ms) {
    for (; ms > 0; ms -= 1) {
      send_due();
      board_.run_for_ms(1);
    }
  }

  /// Share of the bus in use since a bit of the past.
  double load_since(std::uint64_t bit) const {
    std::uint64_t busy = 0;
    for (const auto& f : board_.can.seen) busy += f.begin_bit >= bit ? f.end_bit - f.begin_bit : 0;
    return static_cast<double>(busy) / static_cast<double>(board_.can.now_bit - bit);
  }
  /// Adds frames of other nodes until the bus has this load; before an update.
  void load_bus(double share) {
    const std::uint64_t begin = board_.can.now_bit;
    pass(1'000);
    bits_between_other_frames_ =
        static_cast<std::uint64_t>(bits_on_the_wire(other_frame) / (share - load_since(begin)));
  }
  /// Changes what is measured; false: nothing is sent.
  std::function<bool(measurement::PackSample<cells>&)> change;
  double end_ms = 0;  ///< the tool loses its adapter; 0: never

 private:
  bool answered() const {
    return std::any_of(board_.can.seen.begin() + static_cast<std::ptrdiff_t>(seen_), board_.can.seen.end(),
                       [](const auto& f) { return f.from_board && f.frame.id == update_response_id; });
  }
  void send_due() {
    if (bits_between_other_frames_ != 0 && next_other_bit_ < board_.can.now_bit) next_other_bit_ = board_.can.now_bit;
    const std::uint64_t until = board_.can.now_bit + board_.can.bits_per_second / 1'000;
    for (; bits_between_other_frames_ != 0 && next_other_bit_ < until; next_other_bit_ += bits_between_other_frames_)
      board_.can.others.push_back({other_frame, next_other_bit_, false});
    if (board_.now_ms() < next_sample_ms_) return;
    next_sample_ms_ = board_.now_ms() + 100;
    measurement::PackSample<cells> pack;
    pack.time_us = 100'000 * ++samples_;
    pack.current_ua = 0;
    pack.cell_uv.fill(3'290'000);
    pack.pack_uv = 3'290'000 * static_cast<std::int32_t>(cells);
    pack.temperature_cdegc.fill(2'500);
    if (change && !change(pack)) return;
    for (const can::Frame& f : hal::frames_of(pack, 0, static_cast<std::uint16_t>(samples_), 0))
      board_.can.others.push_back({firmware::wire_frame(f), 0, true});
  }

  firmware::UnicornBoard& board_;
  std::size_t seen_;
  std::uint64_t samples_ = 10, next_other_bit_ = 0, bits_between_other_frames_ = 0;
  double next_sample_ms_ = 0;
};

}  // namespace bms::boot
