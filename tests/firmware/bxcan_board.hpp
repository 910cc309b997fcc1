// Fixture for the remote image of the forklift board on a core in Unicorn, with register models of CAN controller and
// flash interface and with other nodes on the bus.
#pragma once

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "files/cell_file.hpp"
#include "files/recording.hpp"
#include "firmware/application.hpp"
#include "images/firmware_image.hpp"
#include "tests/firmware/can/response_time.hpp"
#include "tests/firmware/host_board.hpp"
#include "tests/firmware/unicorn_board.hpp"

namespace bms::firmware {

using namespace host_hal;
using hal::CanState;
using ::testing::IsEmpty;

/// The cell of the images. After the first call, the application on this machine sends its hash.
inline const files::CellFile& table9() {
  static const files::CellFile cell = [] {
    files::CellFile read = files::read_cell("table9");
    cell_hash = read.hash;
    return read;
  }();
  return cell;
}

inline const std::filesystem::path& image() {
  static const auto path = images::firmware_image("stm32f405_forklift", table9(), images::Image::remote);
  return path;
}

/// A part of the recorded shift for sixteen cells. Neighbouring cells differ by a millivolt; their mean is the
/// recording.
inline std::vector<Pack> part_of_the_shift(std::size_t count) {
  const auto all =
      measurement::samples(files::read_recording(BMS_SOURCE_DIR "/evidence/recordings/forklift_shift.csv"));
  std::vector<Pack> part(count);
  for (std::size_t k = 0; k < count; ++k) {
    const measurement::Sample& s = all[3000 + k];
    part[k].time_us = s.time_us;
    part[k].current_ua = s.current_ua;
    for (std::size_t cell = 0; cell < Pack::cells; ++cell)
      part[k].cell_uv[cell] = s.voltage_uv - 7'500 + 1'000 * static_cast<std::int32_t>(cell);
    part[k].pack_uv = static_cast<std::int32_t>(Pack::cells) * s.voltage_uv;
    part[k].temperature_cdegc.fill(s.temperature_cdegc);
  }
  return part;
}

/// Flash content of a new chip after its first start: erased, then marked by the firmware.
inline const std::vector<std::uint8_t>& started_once() {
  static const auto bytes =
      HostBoard(std::vector<std::uint8_t>(FlashControllerModel::sectors * FlashControllerModel::sector_bytes, 0xFF))
          .flash();
  return bytes;
}

/// The frames that the application on this machine sends.
inline std::vector<can::Frame> expected_frames(const std::vector<Pack>& part) {
  HostBoard host(started_once());
  for (const Pack& p : part) host.process_sample({p, {0, 0}});
  return sent;
}

inline double ms_on_the_wire(const std::vector<can::Frame>& frames) {
  unsigned bits = 0;
  for (const can::Frame& f : frames) bits += bits_on_the_wire(wire_frame(f));
  return 1e3 * bits / 250e3;
}

inline constexpr std::size_t frames_of_a_sample = hal::pack_frames<Pack::cells>;
inline constexpr double longest_sample_ms = 1e3 * frames_of_a_sample * can_bus::worst_bits(8) / 250e3;
// After five sample periods without a sample the board makes an empty one, and then one in each period.
inline constexpr double patience_s = 0.5, period_s = 0.1;
/// Empty samples that the board makes at least in this time. One may be unfinished.
constexpr unsigned empty_samples_in(double s) { return static_cast<unsigned>((s - patience_s) / period_s) - 1; }

inline constexpr std::uint64_t bits_between_samples = 25'000;  // ten per second at 250 kbit/s
inline constexpr double shortest_watchdog_ms = 1'360;          // 2 s if the oscillator runs at 47 kHz (datasheet, LSI)

inline bool same(const can::Frame& a, const can::Frame& b) {
  return a.id == b.id && a.length == b.length && a.data == b.data;
}

inline void queue_for(UnicornBoard& board, const std::vector<Input>& inputs) {
  for (std::size_t k = 0; k < inputs.size(); ++k) {
    const std::uint64_t due = board.can.now_bit + bits_between_samples * (k + 1);
    if (inputs[k].command) board.can.others.push_back({wire_frame(*inputs[k].command), due - bits_between_samples / 2});
    for (const can::Frame& f :
         hal::frames_of(inputs[k].pack, inputs[k].link.plus_uv, static_cast<std::uint16_t>(k), inputs[k].link.minus_uv))
      board.can.others.push_back({wire_frame(f), due, true});
  }
}

/// The start tests the memories first. Frames that are sent before the board is on the bus get lost.
inline void run_until_it_listens(UnicornBoard& board) {
  ASSERT_TRUE(board.run_until([&] { return board.can.on_the_bus(); }, 200));
  board.run_for_ms(5);
}

inline ImageSize expect_within_budgets(const std::filesystem::path& of) {
  const ImageSize size = size_of(of);
  EXPECT_LE(size.text + size.data, 96U * 1024);  // the budget of the forklift board, whose variants these are
  EXPECT_LE(size.data + size.bss, 16U * 1024);
  EXPECT_THAT(forbidden_in(symbols_of(of)), IsEmpty());
  return size;
}

class BxcanBoard : public ::testing::Test {
 protected:
  void SetUp() override { board.flash.bytes = started_once(); }
  void TearDown() override {
    if (IsSkipped()) return;
    EXPECT_THAT(board.can.violations, IsEmpty());
    EXPECT_THAT(board.flash.violations, IsEmpty());
    EXPECT_LT(board.longest_unfed_ms, shortest_watchdog_ms);
  }

  /// Sends a sample every 100 ms over the bus, from now on.
  void queue(const std::vector<Pack>& some) {
    std::vector<Input> inputs;
    for (const Pack& p : some) inputs.push_back({p, {0, 0}});
    queue_for(board, inputs);
  }
  /// Delivers a sample without the bus, as fast as the firmware reads the controller.
  void deliver(const Pack& pack) {
    for (const can::Frame& f : hal::frames_of(pack, 0, 0)) {
      board.can.deliver(f);
      ASSERT_TRUE(board.run_until([&] { return !board.can.receive_interrupt(); }, 1));
    }
  }
  std::vector<can::Frame> of_board(unsigned id = 0) const {
    std::vector<can::Frame> out;
    for (const SeenFrame& s : board.can.seen) {
      if (s.from_board && (id == 0 || s.frame.id == id)) out.push_back(s.frame);
    }
    return out;
  }
  /// Expects that the firmware continues to estimate, whatever the bus does.
  void expect_estimates(double during_ms, unsigned at_least) {
    const unsigned before = board.estimates, fed = board.watchdog_feeds;
    board.run_for_ms(during_ms);
    EXPECT_GE(board.estimates - before, at_least);
    EXPECT_GE(board.watchdog_feeds - fed, at_least);
  }
  void expect_nothing_lost_within_an_id() const {
    for (const unsigned id : {0x180U, 0x181U, 0x182U, 0x183U, 0x186U, 0x189U, 0x190U, 0x196U, 0x1B8U}) {
      const auto frames = of_board(id);
      for (std::size_t k = 0; k < frames.size(); ++k) {
        ASSERT_TRUE(can::intact(frames[k], static_cast<std::uint16_t>(id)));
        ASSERT_EQ(can::counter_of(frames[k]), k % 15) << fmt::format("{:x}, frame {}", id, k);
      }
    }
  }

  UnicornBoard board{image()};
};

}  // namespace bms::firmware
