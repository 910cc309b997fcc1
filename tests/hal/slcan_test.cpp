#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <random>
#include <string>

#include "hal/sample_frames.hpp"
#include "hal/slcan/codec.hpp"

namespace bms::hal {
namespace {

std::string encoded(const can::Frame& frame) {
  std::array<char, slcan::longest_frame> text;
  return std::string(slcan::encode(frame, text));
}

// examples of the transmit command in the Lawicel CAN232 manual
TEST(Slcan, EncodesTheExamplesOfTheManual) {
  EXPECT_EQ(encoded({0x100, 0, {}}), "t1000\r");
  EXPECT_EQ(encoded({0x10, 2, {0x11, 0x22}}), "t01021122\r");
  EXPECT_EQ(encoded({0x7FF, 8, {0xDE, 0xAD, 0xBE, 0xEF, 0, 1, 2, 3}}), "t7FF8DEADBEEF00010203\r");
  EXPECT_EQ(encoded({0x100, 0, {}, true}), "T000001000\r");
  EXPECT_EQ(encoded({0x10, 2, {0x11, 0x22}, true}), "T0000001021122\r");
}

TEST(Slcan, EveryFrameIsDecodedAsEncoded) {
  std::mt19937_64 random(1);
  for (int run = 0; run < 10'000; ++run) {
    const bool long_id = run % 3 == 0;
    can::Frame sent{static_cast<std::uint32_t>(random() % (long_id ? 1U << 29 : 1U << 11)),
                    static_cast<std::uint8_t>(random() % 9),
                    {},
                    long_id};
    for (std::size_t k = 0; k < sent.length; ++k) sent.data[k] = static_cast<std::uint8_t>(random());
    std::string text = encoded(sent);
    text.pop_back();
    if (run % 2 == 0)
      std::transform(text.begin() + 1, text.end(), text.begin() + 1,
                     [](char c) { return static_cast<char>(std::tolower(c)); });
    can::Frame received;
    ASSERT_TRUE(slcan::decode(text, received)) << text;
    ASSERT_EQ(received.id, sent.id);
    ASSERT_EQ(received.long_id, sent.long_id);
    ASSERT_EQ(received.length, sent.length);
    ASSERT_EQ(received.data, sent.data);
  }
}

TEST(Slcan, RejectsLinesWithoutAFrameAndLeavesTheLastFrameUnchanged) {
  for (const char* line :
       {"",           "t",          "t100",        "t1009",          "t10021",  "t1002112", "t100211223",
        "t8001",      "t80000",     "tG000",       "t1001G1",        "t1001 1", "T1000",    "T00000100",
        "T200000000", "T0000010G0", "T0000010011", "T0000010011122", "r1000",   "x1000"}) {
    can::Frame frame{0x123, 1, {7}};
    EXPECT_FALSE(slcan::decode(line, frame)) << line;
    EXPECT_EQ(frame.id, 0x123);
    EXPECT_EQ(frame.data[0], 7);
  }
}

TEST(Slcan, RandomBytesHaveNoEffectOnTheNextLine) {
  std::mt19937_64 random(2);
  slcan::LineReader reader;
  for (int run = 0; run < 2'000; ++run) {
    for (std::size_t k = 0, n = random() % 100; k < n; ++k) {
      if (!reader.push(static_cast<char>(random()))) continue;
      can::Frame frame;
      if (slcan::decode(reader.line(), frame)) {
        ASSERT_LE(frame.length, 8);
      }
      slcan::is_other_frame(reader.line());
    }
    reader.push('\r');
    for (const char c : std::string("t12327B2A")) ASSERT_FALSE(reader.push(c));
    ASSERT_TRUE(reader.push('\r'));
    can::Frame frame;
    ASSERT_TRUE(slcan::decode(reader.line(), frame));
    ASSERT_EQ(frame.data[1], 0x2A);
  }
}

TEST(SampleFrames, CarryASampleAndAStartingPoint) {
  measurement::Sample sent;
  sent.time_us = (std::uint64_t{1} << 48) - 5;
  sent.current_ua = -123'456'789;
  sent.voltage_uv = measurement::no_reading;
  sent.temperature_cdegc = -4'000;
  SampleFrames<1> received;
  const auto frames = frames_of(sent);
  EXPECT_FALSE(received.receive(frames[0]));
  EXPECT_TRUE(received.receive(frames[1]));
  EXPECT_EQ(received.sample().time_us, sent.time_us);
  EXPECT_EQ(received.sample().current_ua, sent.current_ua);
  EXPECT_EQ(received.sample().cell_uv[0], measurement::no_reading);
  EXPECT_EQ(received.sample().temperature_cdegc[0], -4'000);
  const can::Frame start = frame_of(measurement::StartingPoint{800'000'000, 20'000'000});
  EXPECT_FALSE(received.receive(start));
  ASSERT_TRUE(received.starting_point());
  EXPECT_EQ(received.starting_point()->soc_ppb, 800'000'000);
  EXPECT_EQ(received.starting_point()->soc_sigma_ppb, 20'000'000);
}

TEST(SampleFrames, IgnoreAStartingPointThatIsOutOfRange) {
  const std::vector<can::Frame> of_others = {
      {0x310, 8, {0x00, 0x94, 0x35, 0x77, 0x01, 0x00, 0x00, 0x00}},  // process data: would be 200 %, sigma 1e-9
      frame_of({1'000'000'001, 20'000'000}),
      frame_of({-1, 20'000'000}),
      frame_of({500'000'000, 999'999}),
      frame_of({500'000'000, 289'000'001}),
      frame_of({500'000'000, 0}),
      frame_of({500'000'000, -20'000'000}),
      {0x310, 7, frame_of({500'000'000, 20'000'000}).data},
      {0x310, 8, frame_of({500'000'000, 20'000'000}).data, true},
      {0x311, 8, frame_of({500'000'000, 20'000'000}).data}};
  SampleFrames<1> received;
  for (const can::Frame& frame : of_others) {
    received.receive(frame);
    EXPECT_FALSE(received.starting_point());
  }
  for (const measurement::StartingPoint at_the_end :
       {measurement::StartingPoint{0, 1'000'000}, {1'000'000'000, 289'000'000}}) {
    SampleFrames<1> others;
    others.receive(frame_of(at_the_end));
    EXPECT_TRUE(others.starting_point());
  }
}

measurement::PackSample<16> some_pack() {
  measurement::PackSample<16> p;
  p.time_us = 123'456'789;
  p.current_ua = -98'765'432;
  p.pack_uv = 52'345'678;
  for (std::size_t k = 0; k < 16; ++k) p.cell_uv[k] = 3'200'000 + static_cast<std::int32_t>(k);
  p.cell_uv[5] = measurement::no_reading;
  p.temperature_cdegc = {2'500, -1'000, measurement::no_temperature, 4'000};
  return p;
}

TEST(SampleFrames, CarryAPack) {
  const auto sent = some_pack();
  SampleFrames<16> received;
  const auto frames = frames_of(sent, 51'000'000, 7, -2'000'000);
  EXPECT_TRUE(std::ranges::is_sorted(frames, {}, &can::Frame::id)) << "a node that sends by identifier keeps the order";
  for (std::size_t k = 0; k < frames.size(); ++k) EXPECT_EQ(received.receive(frames[k]), k + 1 == frames.size()) << k;
  EXPECT_EQ(received.sample().time_us, sent.time_us);
  EXPECT_EQ(received.sample().current_ua, sent.current_ua);
  EXPECT_EQ(received.sample().pack_uv, sent.pack_uv);
  EXPECT_EQ(received.sample().cell_uv, sent.cell_uv);
  EXPECT_EQ(received.sample().temperature_cdegc, sent.temperature_cdegc);
  EXPECT_EQ(received.link_plus_uv(), 51'000'000);
  EXPECT_EQ(received.link_minus_uv(), -2'000'000);
  EXPECT_EQ(received.rejected(), 0U);
}

template <std::size_t Cells>
measurement::PackSample<Cells> pack_of() {
  measurement::PackSample<Cells> p;
  p.time_us = 987'654'321;
  p.current_ua = 12'345'678;
  p.pack_uv = 3'300'000 * static_cast<std::int32_t>(Cells);
  for (std::size_t k = 0; k < Cells; ++k) p.cell_uv[k] = 3'300'000 + static_cast<std::int32_t>(k);
  p.temperature_cdegc = {2'500, 2'600, 2'700, 2'800};
  return p;
}

template <std::size_t Cells>
void expect_carried(const std::vector<std::uint32_t>& expected_ids) {
  const auto frames = frames_of(pack_of<Cells>(), 51'000'000, 7);
  std::vector<std::uint32_t> ids;
  SampleFrames<Cells> received;
  for (std::size_t k = 0; k < frames.size(); ++k) {
    ids.push_back(frames[k].id);
    EXPECT_EQ(received.receive(frames[k]), k + 1 == frames.size()) << k;
  }
  EXPECT_EQ(ids, expected_ids) << Cells;
  EXPECT_EQ(received.sample().time_us, 987'654'321U);
  EXPECT_EQ(received.sample().cell_uv, pack_of<Cells>().cell_uv);
  EXPECT_EQ(received.sample().temperature_cdegc, pack_of<Cells>().temperature_cdegc);
}

TEST(SampleFrames, CarryPacksOfEachSizeWithoutFramesOfAbsentCells) {
  expect_carried<8>({0x311, 0x312, 0x313, 0x314, 0x315, 0x316, 0x317, 0x31C, 0x31D});
  expect_carried<15>({0x311, 0x312, 0x313, 0x314, 0x315, 0x316, 0x317, 0x318, 0x319, 0x31A, 0x31B, 0x31C, 0x31D});
  expect_carried<24>({0x311, 0x312, 0x313, 0x314, 0x315, 0x316, 0x317, 0x318, 0x319, 0x31A, 0x31B, 0x31C, 0x31E, 0x31F,
                      0x320, 0x321, 0x322});
  expect_carried<25>({0x311, 0x312, 0x313, 0x314, 0x315, 0x316, 0x317, 0x318, 0x319, 0x31A, 0x31B, 0x31C, 0x31E, 0x31F,
                      0x320, 0x321, 0x323, 0x327});
  expect_carried<32>({0x311, 0x312, 0x313, 0x314, 0x315, 0x316, 0x317, 0x318, 0x319, 0x31A, 0x31B,
                      0x31C, 0x31E, 0x31F, 0x320, 0x321, 0x323, 0x324, 0x325, 0x326, 0x327});
}

TEST(SampleFrames, OfASmallPackCompleteNoSampleOfALargeOneNorTheOtherWayRound) {
  SampleFrames<24> large;
  for (const can::Frame& frame : frames_of(pack_of<16>(), 0, 1)) EXPECT_FALSE(large.receive(frame));
  SampleFrames<16> small;
  for (const can::Frame& frame : frames_of(pack_of<24>(), 0, 1)) EXPECT_FALSE(small.receive(frame));
  for (const can::Frame& frame : frames_of(pack_of<16>(), 0, 2)) small.receive(frame);
  EXPECT_EQ(small.sample().cell_uv, pack_of<16>().cell_uv);
  EXPECT_EQ(small.rejected(), 0U);
  SampleFrames<32> largest;
  for (const can::Frame& frame : frames_of(pack_of<24>(), 0, 1)) EXPECT_FALSE(largest.receive(frame));
  for (const can::Frame& frame : frames_of(pack_of<32>(), 0, 1)) large.receive(frame);
  for (const can::Frame& frame : frames_of(pack_of<24>(), 0, 2)) large.receive(frame);
  EXPECT_EQ(large.sample().cell_uv, pack_of<24>().cell_uv);
}

TEST(SampleFrames, ACheckedSampleWithAFlippedBitOrALostFrameIsRejected) {
  const auto frames = frames_of(some_pack(), 51'000'000, 7);
  for (std::size_t broken = 0; broken < frames.size(); ++broken) {
    for (unsigned bit = 0; bit < 64; ++bit) {
      if (broken == 0 && bit >= 48) continue;  // the counter is not covered by the check
      SampleFrames<16> received;
      bool complete = false;
      for (std::size_t k = 0; k < frames.size(); ++k) {
        can::Frame frame = frames[k];
        if (k == broken) frame.data[bit / 8] = static_cast<std::uint8_t>(frame.data[bit / 8] ^ (1U << bit % 8));
        complete = received.receive(frame) || complete;
      }
      EXPECT_FALSE(complete) << broken << " " << bit;
    }
    if (broken == 0) continue;  // without a check frame nothing is rejected
    SampleFrames<16> received;
    bool complete = false;
    for (std::size_t k = 0; k < frames.size(); ++k) complete = (k != broken && received.receive(frames[k])) || complete;
    EXPECT_FALSE(complete) << broken;
    // the next complete sample is accepted
    for (const can::Frame& frame : frames) complete = received.receive(frame);
    EXPECT_TRUE(complete) << broken;
  }
}

TEST(SampleFrames, ALostFrameMakesItsReadingMissingInsteadOfRepeatingTheLastOne) {
  measurement::Sample s{1, -5, 3'300'000, 2'500};
  SampleFrames<1> received;
  for (const can::Frame& frame : frames_of(s)) received.receive(frame);
  EXPECT_TRUE(received.receive(frames_of(s)[1]));
  EXPECT_EQ(received.sample().current_ua, measurement::no_reading);
  EXPECT_EQ(received.sample().cell_uv[0], measurement::no_reading);
}

}  // namespace
}  // namespace bms::hal
