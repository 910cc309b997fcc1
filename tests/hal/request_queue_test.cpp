// The places of received frames: none can be taken by frames of another kind.
#include "hal/request_queue.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace bms::hal {
namespace {

can::Frame frame(std::uint32_t id, std::uint64_t bits, std::uint8_t counter = 0) {
  can::Frame f{id, 8, {}};
  can::set_bits(f, bits);
  can::protect(f, static_cast<std::uint16_t>(id), counter);
  return f;
}
can::Frame command(std::uint64_t code, std::uint64_t argument = 0, std::uint8_t counter = 0) {
  return frame(0x1A0, code << 12 | argument << 20, counter);
}
can::Frame drive(std::uint64_t freshness) { return frame(0x1B2, 1 << 12 | freshness << 16); }

std::vector<can::Frame> drained(RequestQueue& queue) {
  std::vector<can::Frame> all;
  for (can::Frame f; queue.pop(f);) all.push_back(f);
  return all;
}

TEST(RequestQueue, TakesOnlyWholeStandardFramesWithTheRightCrcAndCounter) {
  RequestQueue queue;
  for (const std::uint32_t id : {0x0A0U, 0x1A0U, 0x1B0U, 0x1B1U, 0x1B2U}) {
    for (std::size_t bit = 0; bit < 64; ++bit) {
      can::Frame f = frame(id, 0x1234'5678'9ABC'0000);
      f.data[bit / 8] = static_cast<std::uint8_t>(f.data[bit / 8] ^ 1 << bit % 8);
      queue.push(f);
    }
    for (const std::uint8_t length : std::array<std::uint8_t, 2>{0, 7}) {
      can::Frame f = frame(id, 0);
      f.length = length;
      queue.push(f);
    }
    queue.push(frame(id, 0, 15));
    can::Frame extended = frame(id, 0);
    extended.long_id = true;
    queue.push(extended);
  }
  EXPECT_TRUE(drained(queue).empty());
  queue.push(command(2));
  EXPECT_EQ(drained(queue).size(), 1U);
}

TEST(RequestQueue, PassesAStopOnBeforeAllElseWhateverElseArrives) {
  for (const can::Frame& stop : {frame(0x0A0, 0), command(4, 0), frame(0x1B2, 0)}) {
    RequestQueue queue;
    for (int k = 0; k < 200; ++k) {
      queue.push(command(4, 1));
      queue.push(drive(static_cast<std::uint64_t>(k)));
      queue.push(command(1, 1));
      queue.push({0x600, 8, {}});
      if (k == 77) queue.push(stop);
    }
    can::Frame first;
    ASSERT_TRUE(queue.pop(first));
    EXPECT_EQ(first.id, stop.id);
    EXPECT_EQ(first.data, stop.data);
  }
}

/// Request 0 ends the request of the truck only, so it must not take the place of a stop.
TEST(RequestQueue, ARequestForNothingDoesNotPushOutAStop) {
  RequestQueue queue;
  queue.push(frame(0x0A0, 0));
  for (int k = 0; k < 100; ++k) queue.push(k % 2 == 0 ? command(4, 0) : frame(0x1B2, 0));
  const auto all = drained(queue);
  ASSERT_EQ(all.size(), 2U);
  EXPECT_EQ(all[0].id, 0x0A0U);
  EXPECT_EQ(all[1].id, 0x1B2U) << "the newest";
}

TEST(RequestQueue, PassesTheNewestDriveRequestOnFirstAndDropsTheOldest) {
  RequestQueue queue;
  for (std::uint64_t k = 1; k <= 100; ++k) queue.push(drive(k));
  const auto all = drained(queue);
  ASSERT_EQ(all.size(), RequestQueue::drive_requests);
  for (std::size_t k = 0; k < all.size(); ++k) EXPECT_EQ(can::get_raw(all[k], 16, 16), 100 - k);
}

TEST(RequestQueue, KeepsTheNewestPlainRequestTheOldestCommandsAndTheNetworkApart) {
  RequestQueue queue;
  queue.push(command(2, 1));
  for (std::uint8_t k = 0; k < 100; ++k) {
    queue.push(command(4, 1 + k % 2, k % 15));
    queue.push({0x701, 1, {k}});
    queue.push(command(9, k, k % 15));
  }
  const auto all = drained(queue);
  ASSERT_EQ(all.size(), 1 + 8U);
  EXPECT_EQ(can::get_raw(all[0], 20, 32), 2U) << "the newest";
  EXPECT_EQ(can::get_raw(all[1], 12, 8), 2U) << "the oldest command";
  EXPECT_EQ(can::get_raw(all[2], 20, 32), 0U);
  can::Frame network;
  for (std::uint8_t k = 0; k < 8; ++k) {
    ASSERT_TRUE(queue.pop_network(network));
    EXPECT_EQ(network.data[0], k);
  }
  EXPECT_FALSE(queue.pop_network(network));
}

}  // namespace
}  // namespace bms::hal
