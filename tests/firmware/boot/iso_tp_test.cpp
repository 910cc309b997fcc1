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
  ASSERT_TRUE(side_.send(bytes));
  EXPECT_FALSE(side_.send(bytes)) << "one message at a time";
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
  ASSERT_TRUE(side_.send(std::vector<std::uint8_t>(30, 7)));
  frames();
  frames(1'000'001);
  EXPECT_FALSE(side_.sending());
}

TEST_F(IsoTpTest, WhatIsNoFrameOfThisConnectionIsIgnored) {
  can::Frame extended = frame({0x01, 0x3E});
  extended.long_id = true;
  for (const auto& f : {frame({0x01, 0x3E}, 3), extended, frame({}), frame({0x00, 1, 2}),
                        frame({0x08, 1, 2, 3, 4, 5, 6, 7}), frame({0x03, 1, 2}), frame({0x21, 1, 2}), frame({0x40, 1}),
                        frame({0x10, 0x07, 1, 2, 3, 4, 5, 6}), frame({0x10, 0x0A, 1, 2, 3, 4, 5})}) {
    side_.receive(f, 0);
    EXPECT_TRUE(message().empty());
    EXPECT_TRUE(frames().empty());
  }
  side_.receive(frame({0x10, 0x08, 1, 2, 3, 4, 5, 6}), 0);
  EXPECT_EQ(frames().size(), 1U) << "the shortest message that needs two frames";
  side_.receive(frame({0x21, 7, 8}), 0);
  EXPECT_EQ(message().size(), 8U);
}

TEST_F(IsoTpTest, SingleFramesHaveOneToSevenBytes) {
  for (std::uint8_t size = 1; size <= 7; ++size) {
    std::vector<std::uint8_t> bytes{size, 1, 2, 3, 4, 5, 6, 7};
    bytes.resize(size + 1U);
    side_.receive(frame(bytes), 0);
    EXPECT_EQ(message(), std::vector<std::uint8_t>(bytes.begin() + 1, bytes.end()));
    side_.taken();
  }
}

TEST_F(IsoTpTest, AMessageThatWaitsIsNotOverwritten) {
  side_.receive(frame({0x02, 1, 2}), 0);
  side_.receive(frame({0x02, 3, 4}), 0);
  side_.receive(frame({0x10, 0x0A, 1, 2, 3, 4, 5, 6}), 0);
  EXPECT_TRUE(frames().empty()) << "no flow control for what has no room";
  EXPECT_EQ(message(), (std::vector<std::uint8_t>{1, 2}));
  side_.taken();
  EXPECT_TRUE(message().empty());
}

TEST_F(IsoTpTest, ASingleFrameEndsAMessageOfSeveral) {
  side_.receive(frame({0x10, 0x0A, 1, 2, 3, 4, 5, 6}), 0);
  side_.receive(frame({0x01, 0x3E}), 0);
  EXPECT_EQ(message(), std::vector<std::uint8_t>{0x3E});
  side_.taken();
  side_.receive(frame({0x21, 7, 8, 9, 10}), 0);
  EXPECT_TRUE(message().empty());
}

TEST_F(IsoTpTest, AConsecutiveFrameThatIsTooShortEndsTheMessage) {
  side_.receive(frame({0x10, 0x0A, 1, 2, 3, 4, 5, 6}), 0);
  side_.receive(frame({0x21, 7, 8, 9}), 0);
  side_.receive(frame({0x21, 7, 8, 9, 10}), 0);
  EXPECT_TRUE(message().empty());
}

/// Of a message of 70 bytes 64 come in ten frames; flow control asks for eight at a time, without a pause.
TEST_F(IsoTpTest, FlowControlAsksForEightFramesAndATimeoutCountsFromTheLast) {
  side_.receive(frame({0x10, 70, 1, 2, 3, 4, 5, 6}), 0);
  for (std::uint8_t k = 0; k <= 9; ++k) {
    const auto flow = frames();
    ASSERT_EQ(flow.size(), k % 8 == 0 ? 1U : 0U) << int{k};
    if (!flow.empty()) {
      EXPECT_EQ(flow[0].length, 8);
      EXPECT_EQ((std::vector<std::uint8_t>(flow[0].data.begin(), flow[0].data.begin() + 3)),
                (std::vector<std::uint8_t>{0x30, 8, 0}));
    }
    side_.receive(frame({static_cast<std::uint8_t>(0x20 | ((k + 1) & 15)), 0, 1, 2, 3, 4, 5, 6}), (k + 1) * 1'000'000U);
  }
  EXPECT_EQ(message().size(), 70U);
}

TEST_F(IsoTpTest, TheSequenceBeginsAgainAfterFifteen) {
  side_.receive(frame({0x10, 6 + 7 * 18, 1, 2, 3, 4, 5, 6}), 0);
  for (int k = 1; k <= 18; ++k)
    side_.receive(frame({static_cast<std::uint8_t>(0x20 | (k & 15)), 0, 1, 2, 3, 4, 5, 6}), 0);
  EXPECT_EQ(message().size(), 6U + 7 * 18);
  const std::vector<std::uint8_t> bytes(6 + 7 * 18, 9);
  ASSERT_TRUE(side_.send(bytes));
  frames();
  side_.receive(frame({0x30, 0, 0}), 0);
  const auto sent = frames();
  ASSERT_EQ(sent.size(), 18U);
  for (int k = 1; k <= 18; ++k) EXPECT_EQ(sent[static_cast<std::size_t>(k - 1)].data[0], 0x20 | (k & 15));
}

/// ISO 15765-2:2016, table 20.
TEST_F(IsoTpTest, TheSeparationTimeIsThatOfTheStandard) {
  for (const auto& [st_min, us] : {std::pair{0x00, 0},
                                   {0x01, 1'000},
                                   {0x7F, 127'000},
                                   {0x80, 127'000},
                                   {0xF0, 127'000},
                                   {0xF1, 100},
                                   {0xF9, 900},
                                   {0xFA, 127'000},
                                   {0xFF, 127'000}}) {
    IsoTp side(1, 2);
    ASSERT_TRUE(side.send(std::vector<std::uint8_t>(30, 7)));
    can::Frame f;
    ASSERT_TRUE(side.next_frame(f, 0));
    const std::uint64_t begin = 500'000;
    side.receive(frame({0x30, 0, static_cast<std::uint8_t>(st_min)}), begin);
    ASSERT_TRUE(side.next_frame(f, begin)) << st_min;
    const auto due = begin + static_cast<std::uint64_t>(us);
    EXPECT_TRUE(us == 0 || !side.next_frame(f, due - 1)) << st_min;
    EXPECT_TRUE(side.next_frame(f, due)) << st_min;
  }
}

TEST_F(IsoTpTest, FlowControlCountsOnlyWhereItIsWaitedFor) {
  side_.receive(frame({0x30, 0, 0}), 0);
  EXPECT_FALSE(side_.sending());
  ASSERT_TRUE(side_.send(std::vector<std::uint8_t>(30, 7)));
  side_.receive(frame({0x30, 0, 0}), 0);
  const auto first = frames();
  ASSERT_EQ(first.size(), 1U) << "the first frame has not been sent yet";
  EXPECT_EQ((std::vector<std::uint8_t>(first[0].data.begin(), first[0].data.begin() + 3)),
            (std::vector<std::uint8_t>{0x10, 30, 7}));
  side_.receive(frame({0x30, 0}), 0);
  EXPECT_TRUE(frames().empty()) << "too short";
  side_.receive(frame({0x33, 0, 0}), 0);
  EXPECT_FALSE(side_.sending()) << "reserved";
}

/// Each wait gives the receiver another second; the eleventh in a row is one too many.
TEST_F(IsoTpTest, AReceiverMayAskToWaitTenTimes) {
  ASSERT_TRUE(side_.send(std::vector<std::uint8_t>(30, 7)));
  frames();
  for (unsigned k = 1; k <= 10; ++k) {
    EXPECT_TRUE(frames(k * 1'000'000).empty());
    ASSERT_TRUE(side_.sending()) << k;
    side_.receive(frame({0x31, 0, 0}), k * 1'000'000);
  }
  EXPECT_TRUE(side_.sending());
  side_.receive(frame({0x31, 0, 0}), 10'000'001);
  EXPECT_FALSE(side_.sending());
}

TEST_F(IsoTpTest, LongMessagesStateTheirLengthInTwelveBits) {
  ASSERT_TRUE(side_.send(std::vector<std::uint8_t>(0x3AB, 7)));
  const auto first = frames();
  ASSERT_EQ(first.size(), 1U);
  EXPECT_EQ(first[0].data[0], 0x13);
  EXPECT_EQ(first[0].data[1], 0xAB);
  EXPECT_FALSE(side_.send({}));
}

TEST(IsoTp, EveryLengthArrives) {
  for (std::size_t size = 1; size <= IsoTp::longest; size += size < 40 ? 1 : 41) {
    IsoTp from(1, 2), to(2, 1);
    std::vector<std::uint8_t> bytes(size);
    for (std::size_t k = 0; k < size; ++k) bytes[k] = static_cast<std::uint8_t>(k * 7 + size);
    ASSERT_TRUE(from.send(bytes));
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
  EXPECT_FALSE(IsoTp(1, 2).send(std::vector<std::uint8_t>(IsoTp::longest + 1)));
}

}  // namespace
}  // namespace bms::boot
