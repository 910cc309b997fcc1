// SDO transfers of the CANopen node, against a client that is written from CiA 301.
#include "firmware/canopen.hpp"

#include <deque>
#include <optional>
#include <string>

#include <gtest/gtest.h>

namespace bms::hal {

namespace {
std::deque<can::Frame> sent;
}
bool can_send(const can::Frame& frame) {
  sent.push_back(frame);
  return true;
}

}  // namespace bms::hal

namespace bms::firmware::canopen {
namespace {

constexpr std::uint8_t node_id = 5;

/// Texts at 0x2000 + length, a number at 0x1000.
struct Objects {
  std::string all = std::string("abcdefghijklmnopqrstuvwxyz0123456789");

  Entry read(std::uint16_t index, std::uint8_t) const {
    if (index == 0x1000) return {418, 4};
    if (index <= 0x2000 || index > 0x2000U + all.size()) return {.abort_code = AbortCode::no_such_object};
    return {.text = std::string_view(all).substr(0, index - 0x2000U)};
  }
  AbortCode write(std::uint16_t, std::uint8_t, std::uint32_t, std::uint8_t) { return AbortCode::read_only; }
};

class Sdo : public ::testing::Test {
 protected:
  void SetUp() override {
    hal::sent.clear();
    node_.update_heartbeat(0);
    hal::sent.clear();
  }
  can::Frame answer(const std::array<std::uint8_t, 8>& request) {
    hal::sent.clear();
    node_.receive({0x600U + node_id, 8, request}, objects_);
    EXPECT_EQ(hal::sent.size(), 1U);
    return hal::sent.empty() ? can::Frame{} : hal::sent.back();
  }
  can::Frame begin(std::uint16_t index) {
    return answer({0x40, static_cast<std::uint8_t>(index), static_cast<std::uint8_t>(index >> 8), 0});
  }
  static std::uint32_t code(const can::Frame& f) {
    return f.data[4] | std::uint32_t{f.data[5]} << 8 | std::uint32_t{f.data[6]} << 16 | std::uint32_t{f.data[7]} << 24;
  }
  /// The whole text, as a client reads it; nothing if the server aborts.
  std::optional<std::string> text(std::uint16_t index) {
    const can::Frame first = begin(index);
    if (first.data[0] != 0x41) return std::nullopt;
    std::string read;
    for (std::uint8_t toggle = 0;; toggle ^= 0x10) {
      const can::Frame f = answer({static_cast<std::uint8_t>(0x60 | toggle)});
      if ((f.data[0] & 0xF0) != toggle) return std::nullopt;
      const unsigned unused = f.data[0] >> 1 & 7;
      for (unsigned k = 0; k < 7 - unused; ++k) read += static_cast<char>(f.data[1 + k]);
      if ((f.data[0] & 1) != 0) break;
    }
    EXPECT_EQ(read.size(), code(first)) << "the length that was announced";
    return read;
  }

  Objects objects_;
  Node node_{node_id};
};

TEST_F(Sdo, ReadsTextsOfEveryLengthInSegments) {
  for (std::uint16_t length = 1; length <= objects_.all.size(); ++length)
    EXPECT_EQ(text(static_cast<std::uint16_t>(0x2000 + length)), objects_.all.substr(0, length));
}

TEST_F(Sdo, RefusesASegmentWithoutATransferOrWithTheWrongToggle) {
  EXPECT_EQ(code(answer({0x60})), 0x05040001U);
  EXPECT_EQ(begin(0x2014).data[0], 0x41);
  const can::Frame refused = answer({0x70});
  EXPECT_EQ(code(refused), 0x05030000U);
  EXPECT_EQ(refused.data[0], 0x80);
  EXPECT_EQ(refused.data[1] | refused.data[2] << 8 | refused.data[3] << 16, 0x2014) << "the transfer that it ends";
  EXPECT_EQ(code(answer({0x60})), 0x05040001U) << "the transfer has ended";
  EXPECT_EQ(begin(0x2014).data[0], 0x41);
  answer({0x60});
  EXPECT_EQ(begin(0x1000).data[0], 0x43) << "a new transfer";
  EXPECT_EQ(code(answer({0x70})), 0x05040001U);
  EXPECT_EQ(text(0x2014), objects_.all.substr(0, 20));
  EXPECT_EQ(code(answer({0x21, 0, 0x20, 0, 20})), 0x05040001U) << "nothing is written in segments";
}

}  // namespace
}  // namespace bms::firmware::canopen
