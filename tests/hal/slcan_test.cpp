#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <random>
#include <string>

#include "hal/sample_frames.hpp"
#include "hal/slcan/codec.hpp"

namespace bms::hal {
namespace {

std::string encoded(const CanFrame& frame) {
  std::array<char, slcan::longest_frame> text;
  return std::string(slcan::encode(frame, text));
}

// the examples of the Lawicel CAN232 manual's transmit command
TEST(Slcan, WritesWhatTheManualShows) {
  EXPECT_EQ(encoded({0x100, 0, {}}), "t1000\r");
  EXPECT_EQ(encoded({0x10, 2, {0x11, 0x22}}), "t01021122\r");
  EXPECT_EQ(encoded({0x7FF, 8, {0xDE, 0xAD, 0xBE, 0xEF, 0, 1, 2, 3}}), "t7FF8DEADBEEF00010203\r");
}

TEST(Slcan, EveryFrameComesBack) {
  std::mt19937_64 random(1);
  for (int run = 0; run < 10'000; ++run) {
    CanFrame sent{static_cast<std::uint16_t>(random() % 2048), static_cast<std::uint8_t>(random() % 9), {}};
    for (std::size_t k = 0; k < sent.length; ++k) sent.data[k] = static_cast<std::uint8_t>(random());
    std::string text = encoded(sent);
    text.pop_back();
    if (run % 2 == 0) std::transform(text.begin(), text.end(), text.begin(), [](char c) { return static_cast<char>(std::tolower(c)); });
    CanFrame received;
    ASSERT_TRUE(slcan::decode(text, received)) << text;
    ASSERT_EQ(received.id, sent.id);
    ASSERT_EQ(received.length, sent.length);
    ASSERT_EQ(received.data, sent.data);
  }
}

TEST(Slcan, RefusesWhatIsNoFrameAndLeavesTheLastOneAlone) {
  for (const char* line : {"", "t", "t100", "t1009", "t10021", "t1002112", "t100211223", "t8001", "t80000", "tG000", "t1001G1", "t1001 1", "T1000", "r1000", "x1000"}) {
    CanFrame frame{0x123, 1, {7}};
    EXPECT_FALSE(slcan::decode(line, frame)) << line;
    EXPECT_EQ(frame.id, 0x123);
    EXPECT_EQ(frame.data[0], 7);
  }
}

TEST(Slcan, AnyBytesNeverDoHarmAndTheNextLineIsRead) {
  std::mt19937_64 random(2);
  slcan::LineReader reader;
  for (int run = 0; run < 2'000; ++run) {
    for (std::size_t k = 0, n = random() % 100; k < n; ++k) {
      if (!reader.take(static_cast<char>(random()))) continue;
      CanFrame frame;
      if (slcan::decode(reader.line(), frame)) {
        ASSERT_LE(frame.length, 8);
      }
      slcan::is_other_frame(reader.line());
    }
    reader.take('\r');
    for (const char c : std::string("t12327B2A")) ASSERT_FALSE(reader.take(c));
    ASSERT_TRUE(reader.take('\r'));
    CanFrame frame;
    ASSERT_TRUE(slcan::decode(reader.line(), frame));
    ASSERT_EQ(frame.data[1], 0x2A);
  }
}

TEST(SampleFrames, CarryASampleAndAStart) {
  Sample sent;
  sent.time_us = (std::uint64_t{1} << 48) - 5;
  sent.current_ua = -123'456'789;
  sent.voltage_uv = no_reading;
  sent.temperature_cdegc = -4'000;
  Sample received;
  const auto frames = frames_of(sent);
  EXPECT_FALSE(completes(frames[0], received));
  EXPECT_TRUE(completes(frames[1], received));
  EXPECT_EQ(received.time_us, sent.time_us);
  EXPECT_EQ(received.current_ua, sent.current_ua);
  EXPECT_EQ(received.voltage_uv, no_reading);
  EXPECT_EQ(received.temperature_cdegc, -4'000);
  const CanFrame start = frame_of(StartingPoint{800'000'000, 20'000'000});
  EXPECT_TRUE(is_start(start));
  EXPECT_EQ(start_of(start).soc_ppb, 800'000'000);
  EXPECT_EQ(start_of(start).soc_sigma_ppb, 20'000'000);
  EXPECT_FALSE(is_start({start.id, 7, start.data}));
}

}  // namespace
}  // namespace bms::hal
