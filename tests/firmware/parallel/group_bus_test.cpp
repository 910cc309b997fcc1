// The frames between batteries in parallel: what arrives, and what is refused.
#include "parallel/group_bus.hpp"

#include <gtest/gtest.h>

namespace bms::parallel {
namespace {

Presence battery(std::uint8_t node) {
  return {.node = node,
          .state = State::connected,
          .open_circuit_uv = 78'912'345,
          .current_ua = -123'456'789,
          .allowed_discharge_ua = 280'199'999,
          .allowed_charge_ua = 100'050'000,
          .leader = 1,
          .granted = 3,
          .charge_wanted = node % 2 == 0};
}

std::optional<Presence> received(GroupBus& to, const std::array<can::Frame, 2>& frames) {
  EXPECT_FALSE(to.receive(frames[0]).has_value());
  return to.receive(frames[1]);
}

TEST(GroupBus, BringsAPresenceOfEachNodeWithinItsResolution) {
  for (std::uint8_t node = 1; node <= most_batteries; ++node) {
    GroupBus from, to;
    const Presence sent = battery(node);
    const auto p = received(to, from.frames(sent));
    ASSERT_TRUE(p.has_value());
    EXPECT_EQ(p->node, node);
    EXPECT_EQ(p->state, State::connected);
    EXPECT_NEAR(p->open_circuit_uv, sent.open_circuit_uv, 1'000 + 10);
    EXPECT_NEAR(p->current_ua, sent.current_ua, 50'000 + 10);
    EXPECT_NEAR(p->allowed_discharge_ua, 280'100'000, 50) << "rounded down";
    EXPECT_NEAR(p->allowed_charge_ua, 100'000'000, 50);
    EXPECT_EQ(p->leader, 1);
    EXPECT_EQ(p->granted, 3);
    EXPECT_EQ(p->charge_wanted, node % 2 == 0);
  }
}

TEST(GroupBus, RefusesEveryFlippedBitAndEveryOtherIdentifier) {
  GroupBus from;
  const auto good = from.frames(battery(2));
  for (std::size_t which = 0; which < 2; ++which) {
    for (unsigned bit = 0; bit < 64; ++bit) {
      auto frames = good;
      frames[which].data[bit / 8] = static_cast<std::uint8_t>(frames[which].data[bit / 8] ^ 1U << bit % 8);
      GroupBus to;
      EXPECT_FALSE(received(to, frames).has_value()) << which << ' ' << bit;
    }
    for (std::uint32_t id = 0; id < 0x800; ++id) {
      auto frames = good;
      if (id == frames[which].id) continue;
      frames[which].id = id;
      GroupBus to;
      EXPECT_FALSE(received(to, frames).has_value()) << which << ' ' << id;
    }
    auto frames = good;
    frames[which].long_id = true;
    GroupBus to;
    EXPECT_FALSE(received(to, frames).has_value());
    frames = good;
    frames[which].length = 7;
    EXPECT_FALSE(received(to, frames).has_value());
  }
}

TEST(GroupBus, ABatteryThatRepeatsItselfIsNotAlive) {
  GroupBus from, to;
  const auto frames = from.frames(battery(2));
  EXPECT_TRUE(received(to, frames).has_value());
  for (int k = 0; k < 40; ++k) EXPECT_FALSE(received(to, frames).has_value());
  EXPECT_TRUE(received(to, from.frames(battery(2))).has_value());
}

TEST(GroupBus, FramesOfTwoPairsAreNoPresence) {
  GroupBus from, to;
  const auto first = from.frames(battery(2)), second = from.frames(battery(2));
  EXPECT_FALSE(to.receive(first[0]).has_value());
  EXPECT_FALSE(to.receive(second[1]).has_value()) << "the second half of the first pair was lost";
  EXPECT_FALSE(to.receive(second[0]).has_value());
  EXPECT_TRUE(to.receive(second[1]).has_value());
  EXPECT_FALSE(to.receive(second[1]).has_value());
  const auto third = from.frames(battery(2));
  EXPECT_FALSE(to.receive(third[1]).has_value()) << "the first half was lost";
}

TEST(GroupBus, ABatteryWithAnUnknownVoltageIsUnable) {
  for (const std::int32_t uv : {-1, 131'060'001, 2'000'000'000}) {
    GroupBus from, to;
    Presence own = battery(4);
    own.open_circuit_uv = uv;
    const auto p = received(to, from.frames(own));
    ASSERT_TRUE(p.has_value());
    EXPECT_EQ(p->state, State::unable) << uv;
  }
}

/// An intact frame with values that no battery sends: of a later version, or of a battery whose memory is wrong.
TEST(GroupBus, ImpossibleValuesMakeABatteryUnable) {
  for (const unsigned start : {12U, 14U, 17U}) {
    GroupBus from, to;
    auto frames = from.frames(battery(2));
    can::put_raw(frames[0], start, start == 12 ? 2 : 3, 7);
    can::protect(frames[0], static_cast<std::uint16_t>(frames[0].id), can::counter_of(frames[0]));
    const auto p = received(to, frames);
    ASSERT_TRUE(p.has_value());
    EXPECT_EQ(p->state, State::unable) << start;
    EXPECT_EQ(p->leader, 0);
    EXPECT_EQ(p->granted, 0);
  }
}

}  // namespace
}  // namespace bms::parallel
