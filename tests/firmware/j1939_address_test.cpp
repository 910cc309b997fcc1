// The claim of a J1939 address, and nodes that contend for one.
#include "firmware/j1939_address.hpp"

#include <deque>

#include <gtest/gtest.h>

namespace bms::hal {

namespace {
std::deque<can::Frame> sent;
bool full = false;
}  // namespace
bool can_send(const can::Frame& frame) {
  if (full) return false;
  sent.push_back(frame);
  return true;
}

}  // namespace bms::hal

namespace bms::firmware::j1939 {
namespace {

can::Frame claim_of(std::uint64_t name, std::uint8_t address) {
  can::Frame frame{0x18EEFF00U | address, 8, {}, true};
  for (unsigned k = 0; k < 8; ++k) frame.data[k] = static_cast<std::uint8_t>(name >> (8 * k));
  return frame;
}
constexpr can::Frame request(std::uint8_t to) { return {0x18EA0021U | std::uint32_t{to} << 8, 3, {0, 0xEE, 0}, true}; }

class J1939Address : public ::testing::Test {
 protected:
  void SetUp() override {
    hal::sent.clear();
    hal::full = false;
  }
  static std::size_t claims() { return hal::sent.size(); }
  static can::Frame last() { return hal::sent.back(); }
};

/// Bits of NAME by J1939-81, figure 1, counted by hand.
TEST_F(J1939Address, IsClaimedWithItsNameBeforeAnythingElse) {
  EXPECT_EQ(
      (Name{.identity = 1, .manufacturer = 0x123, .instances = 0x45, .function = 0x67, .vehicle_system = 0x2A}).value(),
      0x8054'6745'2460'0001U);
  Address a(0x8000'0000'0000'1234U);
  EXPECT_FALSE(a.update(1'000'000));
  ASSERT_EQ(claims(), 1U);
  EXPECT_EQ(last().id, 0x18EEFF80U);
  EXPECT_EQ(last().data[0], 0x34);
  EXPECT_EQ(last().data[7], 0x80);
  EXPECT_FALSE(a.update(1'200'000));
  EXPECT_TRUE(a.update(1'250'000));
  EXPECT_EQ(claims(), 1U);
}

TEST_F(J1939Address, IsDefendedAgainstALargerNameAndGivenToASmallerOne) {
  Address a(0x8000'0000'0000'1234U);
  a.update(0);
  a.receive(claim_of(0x8000'0000'0000'9999U, 0x80), 100'000);
  EXPECT_EQ(claims(), 2U) << "says again whose it is";
  EXPECT_EQ(a.value(), 0x80);
  EXPECT_TRUE(a.update(250'000));
  a.receive(claim_of(0x8000'0000'0000'0001U, 0x80), 300'000);
  EXPECT_EQ(a.value(), 0x81);
  EXPECT_EQ(last().id, 0x18EEFF81U);
  EXPECT_FALSE(a.update(500'000)) << "the new one may be taken, too";
  EXPECT_TRUE(a.update(550'000));
  a.receive(claim_of(0x8000'0000'0000'0001U, 0x80), 600'000);
  EXPECT_EQ(a.value(), 0x81) << "no longer its own";
}

TEST_F(J1939Address, IsClaimedAgainAfterAPauseAndIfTheClaimWasNotSent) {
  Address a(7);
  hal::full = true;
  EXPECT_FALSE(a.update(0));
  EXPECT_FALSE(a.update(1'000'000)) << "the claim is not on the bus";
  hal::full = false;
  EXPECT_FALSE(a.update(1'100'000));
  EXPECT_EQ(claims(), 1U);
  EXPECT_TRUE(a.update(1'350'000));
  a.stop();
  EXPECT_FALSE(a.update(9'000'000));
  EXPECT_EQ(claims(), 2U);
  EXPECT_TRUE(a.update(9'250'000));
  hal::full = true;
  a.receive(claim_of(1, 0x80), 9'300'000);
  hal::full = false;
  EXPECT_FALSE(a.update(9'600'000)) << "the claim of the next address was lost";
  EXPECT_EQ(last().id, 0x18EEFF81U);
  EXPECT_TRUE(a.update(9'850'000));
}

TEST_F(J1939Address, ThatNobodyLeftFreeIsTriedAgainAfterAPause) {
  Address a(7);
  a.update(0);
  for (std::uint64_t us = 1; a.value() != Address::null; us += 1'000) a.receive(claim_of(1, a.value()), us);
  EXPECT_FALSE(a.update(10'000'000));
  a.stop();
  EXPECT_FALSE(a.update(20'000'000));
  EXPECT_TRUE(a.update(20'250'000));
  EXPECT_EQ(a.value(), Address::first);
  a.receive(claim_of(1, a.value()), 20'300'000);
  EXPECT_EQ(a.value(), Address::first + 1) << "and as often as before";
}

TEST_F(J1939Address, IsAnsweredToARequestForIt) {
  Address a(7);
  a.receive(request(0xFF), 0);
  EXPECT_EQ(claims(), 0U) << "nothing is claimed yet";
  a.update(0);
  a.receive(request(0xFF), 1);
  a.receive(request(0x80), 2);
  EXPECT_EQ(claims(), 3U);
  a.receive(request(0x81), 3);
  can::Frame other = request(0xFF);
  other.data[1] = 0xFE;
  a.receive(other, 4);
  other = request(0xFF);
  other.length = 2;
  a.receive(other, 5);
  EXPECT_EQ(claims(), 3U);
}

TEST_F(J1939Address, OfAFullBusIsNone) {
  Address a(0xFFFF'FFFF'FFFF'FFFEU);
  a.update(0);
  for (unsigned k = 0; k < 200 && a.value() != Address::null; ++k) a.receive(claim_of(1, a.value()), k);
  EXPECT_EQ(a.value(), Address::null);
  EXPECT_EQ(last().id, 0x18EEFFFEU) << "cannot claim";
  EXPECT_EQ(claims(), 121U) << "120 addresses, each once";
  EXPECT_FALSE(a.update(10'000'000));
  a.receive(request(0xFF), 1);
  EXPECT_EQ(last().id, 0x18EEFFFEU);
}

}  // namespace
}  // namespace bms::firmware::j1939
