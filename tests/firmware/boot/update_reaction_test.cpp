// Reaction times of the protections on the emulated forklift board, with and without the transfer of an image. A
// transfer goes on only at rest, so it is the message Faults whose time counts: no contactor is closed.
#include <gtest/gtest.h>

#include <fmt/format.h>

#include "can/generated/can_messages.hpp"
#include "tests/firmware/boot/board_bus.hpp"
#include "tests/firmware/protection/simulated_truck.hpp"
#include "update/update_run.hpp"

namespace bms::boot {
namespace {

using protection::expected_rows;

/// The rows with the shortest delays that samples alone can cause while the contactors are open, in groups that do not
/// disturb each other: of the rows of one reading the most severe one comes last and causes the others too. One group
/// is the end of the samples.
constexpr std::size_t samples_missing = 29;
const std::vector<std::vector<std::size_t>> groups{
    {0, 1, 2, 3, 4, 5, 20, 22}, {10, 11, 13, 12, 15, 14, 16, 19}, {6, 23}, {7}, {samples_missing}};

std::uint32_t faults_in(const can::Frame& f) {
  return f.data[2] | std::uint32_t{f.data[3]} << 8 | std::uint32_t{f.data[4]} << 16 | std::uint32_t{f.data[5]} << 24;
}

/// Milliseconds from the sample with which the conditions hold to the message with the fault, by row.
std::map<std::size_t, double> reactions(const std::vector<std::size_t>& rows, bool transfer) {
  LoaderBoard battery;
  battery.board.longest_sleep_us = 500;
  battery.erase_target();
  BoardBus bus(battery.board);
  bus.pass(1'500);
  bus.load_bus(0.5);
  int delay_ms = 0;
  for (const std::size_t k : rows) delay_ms = std::max(delay_ms, expected_rows[k].delay_ms);
  const double fault_ms = battery.board.now_ms() + 500, end_ms = fault_ms + delay_ms + 1'000;
  protection::TruckPack truck(1);
  bus.change = [&](measurement::PackSample<BoardBus::cells>& pack) {
    if (battery.board.now_ms() < fault_ms) return true;
    if (rows.front() == samples_missing) return false;
    protection::PackEstimate<BoardBus::cells> estimate;
    for (const std::size_t k : rows) inject(k, protection::levels(expected_rows[k]).just_above, truck, pack, estimate);
    if (!truck.pack_follows) return true;
    pack.pack_uv = truck.pack_offset_uv;
    for (const std::int32_t uv : pack.cell_uv) pack.pack_uv += uv == measurement::no_reading ? 3'290'000 : uv;
    return true;
  };
  std::uint32_t sent_then = 0, sent = 0;
  update::UpdateWish wish;
  wish.containers = {signed_image(1, 0x000300)};
  wish.progress = [&](std::uint32_t done, std::uint32_t) {
    sent = done;
    if (battery.board.now_ms() < fault_ms) sent_then = done;
  };
  bus.end_ms = end_ms;
  if (transfer) run_update(bus, wish);
  while (battery.board.now_ms() < end_ms) bus.pass(1);
  EXPECT_TRUE(!transfer || (sent_then > 0 && sent > sent_then)) << "no transfer during the faults";
  EXPECT_TRUE(battery.running() == 0 && battery.board.resets.empty());

  std::uint64_t condition_bit = 0;
  std::map<std::size_t, double> ms;
  const double bits_a_ms = battery.board.can.bits_per_second / 1e3;
  for (const auto& f : battery.board.can.seen) {
    if (condition_bit == 0 && static_cast<double>(f.begin_bit) / bits_a_ms >= fault_ms) condition_bit = f.begin_bit;
    if (condition_bit == 0 || !f.from_board || f.frame.id != can::Faults::id) continue;
    for (const std::size_t k : rows) {
      if ((faults_in(f.frame) >> k & 1) != 0)
        ms.try_emplace(k, static_cast<double>(f.end_bit - condition_bit) / bits_a_ms);
    }
  }
  return ms;
}

class ReactionsInATransfer : public ::testing::TestWithParam<std::size_t> {};

TEST_P(ReactionsInATransfer, AreThoseWithoutOne) {
  const auto& rows = groups[GetParam()];
  const auto alone = reactions(rows, false), beside = reactions(rows, true);
  for (const std::size_t k : rows) {
    const auto& row = expected_rows[k];
    ASSERT_TRUE(alone.contains(k)) << row.name;
    ASSERT_TRUE(beside.contains(k)) << row.name;
    std::printf("%-24s delay %5d ms: published after %7.1f ms, in a transfer %7.1f ms\n", row.name, row.delay_ms,
                alone.at(k), beside.at(k));
    // Programming of a block stops the core for 17 ms; a frame takes 0.6 ms.
    EXPECT_LT(std::abs(beside.at(k) - alone.at(k)), 18) << row.name;
  }
}

INSTANTIATE_TEST_SUITE_P(Groups, ReactionsInATransfer, ::testing::Range(std::size_t{0}, groups.size()));

}  // namespace
}  // namespace bms::boot
