// ISO-TP against frames written from the standard, and two sides against each other.
#include "boot/iso_tp.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace bms::boot {
namespace {

can::Frame frame(std::vector<std::uint8_t> bytes, std::uint32_t id = 2) {
  can::Frame f{id, static_cast<std::uint8_t>(bytes.size()), {}};
  std::ranges::copy(bytes, f.data.begin());
  return f;
}

class IsoTpTest : public ::testing::Test {
 protected:
  std::vector<can::Frame> frames(std::uint64_t now_us = 0) {
    std::vector<can::Frame> out;
    can::Frame f;
    while (side_.next_frame(f, now_us)) out.push_back(f);
    return out;
  }
  std::vector<std::uint8_t> message() const { return {side_.message().begin(), side_.message().end()}; }
  IsoTp side_{1, 2};
};

TEST_F(IsoTpTest, ASingleFrameIsAMessage) {
  side_.receive(frame({0x03, 0x22, 0xF1, 0xA0, 0xCC, 0xCC, 0xCC, 0xCC}), 0);
  EXPECT_EQ(message(), (std::vector<std::uint8_t>{0x22, 0xF1, 0xA0}));
  EXPECT_TRUE(frames().empty());
}

TEST_F(IsoTpTest, AFirstFrameAsksForMoreAndTheRestFollowsInOrder) {
  side_.receive(frame({0x10, 0x0A, 1, 2, 3, 4, 5, 6}), 0);
  const auto answer = frames();
  ASSERT_EQ(answer.size(), 1U);
  EXPECT_EQ(answer[0].id, 1U);
  EXPECT_EQ(answer[0].data[0], 0x30);
  side_.receive(frame({0x21, 7, 8, 9, 10, 0xCC, 0xCC, 0xCC}), 0);
  EXPECT_EQ(message(), (std::vector<std::uint8_t>{1, 2, 3, 4, 5, 6, 7, 8, 9, 10}));
}

TEST_F(IsoTpTest, AMissingOrRepeatedFrameEndsTheMessage) {
  for (const std::uint8_t wrong : {std::uint8_t{0x22}, std::uint8_t{0x20}, std::uint8_t{0x2F}}) {
    side_.receive(frame({0x10, 0x0A, 1, 2, 3, 4, 5, 6}), 0);
    side_.receive(frame({wrong, 7, 8, 9, 10}), 0);
    side_.receive(frame({0x21, 7, 8, 9, 10}), 0);
    EXPECT_TRUE(message().empty());
  }
}

TEST_F(IsoTpTest, ATooLongMessageIsRefusedWithOverflow) {
  for (const auto& first : {frame({0x14, 0x03, 1, 2, 3, 4, 5, 6}), frame({0x10, 0x00, 0xFF, 0xFF, 0xFF, 0xFF, 5, 6})}) {
    side_.receive(first, 0);
    const auto answer = frames();
    ASSERT_EQ(answer.size(), 1U);
    EXPECT_EQ(answer[0].data[0], 0x32);
    side_.receive(frame({0x21, 7, 8, 9, 10, 11, 12, 13}), 0);
    EXPECT_TRUE(message().empty());
  }
}

TEST_F(IsoTpTest, EndlessFirstFramesLeaveTheNextMessageIntact) {
  for (int k = 0; k < 10'000; ++k) side_.receive(frame({0x10, 0x20, 1, 2, 3, 4, 5, 6}), 0);
  EXPECT_EQ(frames().size(), 1U);
  side_.receive(frame({0x02, 0x10, 0x02}), 0);
  EXPECT_EQ(message(), (std::vector<std::uint8_t>{0x10, 0x02}));
}

TEST_F(IsoTpTest, ASilentSenderIsGivenUpAfterASecond) {
  side_.receive(frame({0x10, 0x0A, 1, 2, 3, 4, 5, 6}), 0);
  side_.receive(frame({0x21, 7, 8, 9, 10}), 1'000'001);
  EXPECT_TRUE(message().empty());
}

TEST_F(IsoTpTest, SendsNoFasterThanTheReceiverAllows) {
  const std::vector<std::uint8_t> bytes(30, 7);
  ASSERT_TRUE(side_.send(bytes, 0));
  EXPECT_FALSE(side_.send(bytes, 0)) << "one message at a time";
  EXPECT_EQ(frames().size(), 1U);
  side_.receive(frame({0x30, 2, 10}), 0);  // two frames, 10 ms apart
  EXPECT_EQ(frames(0).size(), 1U);
  EXPECT_EQ(frames(9'999).size(), 0U);
  EXPECT_EQ(frames(10'000).size(), 1U);
  EXPECT_EQ(frames(99'000).size(), 0U) << "the block is over";
  side_.receive(frame({0x31, 0, 0}), 99'000);  // wait
  EXPECT_TRUE(side_.sending());
  side_.receive(frame({0x32, 0, 0}), 99'000);  // overflow
  EXPECT_FALSE(side_.sending());
}

TEST_F(IsoTpTest, ARespondentThatNeverAnswersIsGivenUp) {
  ASSERT_TRUE(side_.send(std::vector<std::uint8_t>(30, 7), 0));
  frames();
  frames(1'000'001);
  EXPECT_FALSE(side_.sending());
}

TEST(IsoTp, EveryLengthArrives) {
  for (std::size_t size = 1; size <= IsoTp::longest; size += size < 40 ? 1 : 41) {
    IsoTp from(1, 2), to(2, 1);
    std::vector<std::uint8_t> bytes(size);
    for (std::size_t k = 0; k < size; ++k) bytes[k] = static_cast<std::uint8_t>(k * 7 + size);
    ASSERT_TRUE(from.send(bytes, 0));
    can::Frame f;
    for (bool moved = true; moved;) {
      moved = false;
      while (from.next_frame(f, 0)) {
        to.receive(f, 0);
        moved = true;
      }
      while (to.next_frame(f, 0)) {
        from.receive(f, 0);
        moved = true;
      }
    }
    ASSERT_TRUE(std::ranges::equal(to.message(), bytes)) << size;
  }
  EXPECT_FALSE(IsoTp(1, 2).send(std::vector<std::uint8_t>(IsoTp::longest + 1), 0));
}

}  // namespace
}  // namespace bms::boot
