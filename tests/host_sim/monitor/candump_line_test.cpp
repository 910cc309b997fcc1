#include "monitor/candump_line.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>
#include <string>

#include "monitor/slcan_stream.hpp"

namespace bms::monitor {
namespace {

BusFrame parsed(std::string_view line) {
  BusFrame frame;
  EXPECT_TRUE(parse_dump_line(line, frame)) << line;
  return frame;
}

// These lines are as can-utils writes them.
TEST(CandumpLine, ReadsEachKindOfFrame) {
  const BusFrame standard = parsed("(1436509052.249713) vcan0 044#2A366C2BBA");
  EXPECT_EQ(standard.kind, FrameKind::standard);
  EXPECT_EQ(standard.time_us, 1'436'509'052'249'713);
  EXPECT_EQ(standard.id, 0x44U);
  EXPECT_EQ(standard.length, 5);
  EXPECT_EQ(standard.data[4], 0xBA);

  const BusFrame extended = parsed("(0000000000.000001) can0 18FF50E5#0102030405060708");
  EXPECT_EQ(extended.kind, FrameKind::extended);
  EXPECT_TRUE(extended.long_id);
  EXPECT_EQ(extended.id, 0x18FF50E5U);
  EXPECT_EQ(parsed("(1.000000) can0 00000123#").kind, FrameKind::extended) << "an id of eight digits has 29 bits";

  EXPECT_EQ(parsed("(1.000000) can0 123#R").kind, FrameKind::remote);
  EXPECT_EQ(parsed("(1.000000) can0 12345678#R8").length, 8);

  const BusFrame error = parsed("(1436509053.650713) can0 20000004#000C000000005F00");
  EXPECT_EQ(error.kind, FrameKind::error);
  EXPECT_EQ(error.id, 4U);

  const BusFrame fd = parsed("(1436509053.850870) can0 213##311223344556677889900AABB");
  EXPECT_EQ(fd.kind, FrameKind::fd);
  EXPECT_EQ(fd.fd_flags, 3);
  EXPECT_EQ(fd.length, 12);

  EXPECT_EQ(parsed("(1.000000) can0 182#01.02.03 R").length, 3);
}

TEST(CandumpLine, RejectsOtherLinesAndLeavesTheFrameUnchanged) {
  for (const char* line : {"",
                           "(",
                           "()",
                           "can0 182#00",
                           "(1.0) can0 182#00",
                           "(1.000000)",
                           "(1.000000) can0",
                           "(1.000000) can0 ",
                           "(1.000000) can0 182",
                           "(1.000000) can0 182 00",
                           "(1.000000) can0 #00",
                           "(1.000000) can0 82#00",
                           "(1.000000) can0 1822#00",
                           "(1.000000) can0 800#00",
                           "(1.000000) can0 18G#00",
                           "(1.000000) can0 182#0",
                           "(1.000000) can0 182#0g",
                           "(1.000000) can0 182#00.",
                           "(1.000000) can0 182#.00",
                           "(1.000000) can0 182#000102030405060708",
                           "(1.000000) can0 182##",
                           "(1.000000) can0 182#R9",
                           "(1.000000) can0 182#R88",
                           "(1.000000) can0 182#00 X",
                           "(1.000000) can0 182#00 R R",
                           "(-1.000000) can0 182#00",
                           "(1.-00001) can0 182#00",
                           "(123456789012.000000) can0 182#00",
                           "(1.000000) can0 40000000#00",
                           "(1.000000) can0 3FFFFFFF#R",
                           "(1.000000)can0 182#00"}) {
    BusFrame frame;
    frame.id = 0x77;
    EXPECT_FALSE(parse_dump_line(line, frame)) << line;
    EXPECT_EQ(frame.id, 0x77U);
  }
}

TEST(CandumpLine, WrittenFramesAreReadBackUnchanged) {
  std::mt19937_64 random(3);
  for (int run = 0; run < 20'000; ++run) {
    BusFrame sent;
    sent.time_us = static_cast<std::int64_t>(random() % 9'999'999'999'000'000);
    sent.kind = static_cast<FrameKind>(random() % 5);
    sent.long_id = sent.kind == FrameKind::extended ||
                   ((sent.kind == FrameKind::remote || sent.kind == FrameKind::fd) && random() % 2 == 0);
    sent.id =
        static_cast<std::uint32_t>(random() & (sent.long_id || sent.kind == FrameKind::error ? 0x1FFF'FFFF : 0x7FF));
    sent.length = static_cast<std::uint8_t>(random() % (sent.kind == FrameKind::fd ? 65 : 9));
    sent.fd_flags = sent.kind == FrameKind::fd ? static_cast<std::uint8_t>(random() % 16) : 0;
    for (std::size_t k = 0; k < sent.length && sent.kind != FrameKind::remote; ++k)
      sent.data[k] = static_cast<std::uint8_t>(random());
    std::string line;
    append_dump_line(line, sent, "can0");
    ASSERT_LE(line.size(), longest_dump_line);
    line.pop_back();
    const BusFrame back = parsed(line);
    ASSERT_EQ(back.time_us, sent.time_us) << line;
    ASSERT_EQ(back.kind, sent.kind) << line;
    ASSERT_EQ(back.long_id, sent.long_id) << line;
    ASSERT_EQ(back.id, sent.id) << line;
    ASSERT_EQ(back.length, sent.length) << line;
    ASSERT_EQ(back.fd_flags, sent.fd_flags) << line;
    ASSERT_EQ(back.data, sent.data) << line;
  }
}

TEST(DumpLines, AHugeLineIsTooLongAndTheNextIsReadInFull) {
  DumpLines lines;
  for (int k = 0; k < 1'000'000; ++k) ASSERT_FALSE(lines.push('('));
  ASSERT_TRUE(lines.push('\n'));
  EXPECT_TRUE(lines.too_long());
  EXPECT_EQ(lines.line(), "");
  for (const char c : std::string("next\r")) ASSERT_FALSE(lines.push(c));
  EXPECT_TRUE(lines.pending());
  ASSERT_TRUE(lines.push('\n'));
  EXPECT_FALSE(lines.too_long());
  EXPECT_EQ(lines.line(), "next");
}

/// The frames and the number of malformed lines in the bytes of an adapter.
struct Decoded {
  std::vector<BusFrame> frames;
  std::uint64_t malformed = 0;
};
Decoded decode(std::string_view bytes) {
  Decoded decoded;
  SlcanStream stream;
  BusFrame frame;
  for (const char c : bytes) {
    if (stream.push(c, frame)) decoded.frames.push_back(frame);
  }
  decoded.malformed = stream.malformed();
  return decoded;
}

TEST(SlcanStream, ReadsFramesBetweenTheAdaptersAnswers) {
  const Decoded decoded = decode("\r\a\rt1238DEADBEEF01020304\rz\rV1010\rT18FF50E521122\rr1234\rR000001238\r\at0440\r");
  EXPECT_EQ(decoded.malformed, 0U);
  ASSERT_EQ(decoded.frames.size(), 5U);
  EXPECT_EQ(decoded.frames[0].kind, FrameKind::standard);
  EXPECT_EQ(decoded.frames[0].data[3], 0xEF);
  EXPECT_EQ(decoded.frames[1].kind, FrameKind::extended);
  EXPECT_EQ(decoded.frames[1].id, 0x18FF50E5U);
  EXPECT_EQ(decoded.frames[1].length, 2);
  EXPECT_EQ(decoded.frames[1].data[1], 0x22);
  EXPECT_EQ(decoded.frames[2].kind, FrameKind::remote);
  EXPECT_EQ(decoded.frames[2].id, 0x123U);
  EXPECT_EQ(decoded.frames[2].length, 4);
  EXPECT_TRUE(decoded.frames[3].long_id);
  EXPECT_EQ(decoded.frames[4].id, 0x44U) << "\\a before it has no effect";
}

TEST(SlcanStream, CountsMalformedLinesAndContinues) {
  const Decoded decoded = decode("t12\rt1239\r\xff\xfe\rtGGG0\r" + std::string(100'000, 't') + "\rx\rt0440\r");
  ASSERT_EQ(decoded.frames.size(), 1U);
  EXPECT_EQ(decoded.malformed, 5U) << "the huge line counts as empty";
}

}  // namespace
}  // namespace bms::monitor
