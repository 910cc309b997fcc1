// All reachable states of the contactors under all classes of inputs, and flipped bits in their state.
#include "protection/contactors.hpp"

#include <array>
#include <cstring>
#include <set>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "tests/protection/contactor_bench.hpp"

namespace bms::protection {
namespace {

using enum ContactorState;

/// The bytes that determine all later steps.
std::array<std::uint8_t, sizeof(Contactors)> bytes(const Contactors& c) {
  std::array<std::uint8_t, sizeof(Contactors)> all{};
  std::memcpy(all.data(), &c, sizeof c);
  return all;
}

/// One input of each class that the contactors can distinguish.
std::vector<ContactorInput> input_classes() {
  constexpr std::int32_t unknown = measurement::no_reading;
  std::vector<ContactorInput> inputs;
  for (const Request r : {Request::none, Request::drive, Request::charge}) {
    for (int faults = 0; faults < 16; ++faults) {
      for (const std::int32_t current_ua : {unknown, -3'000'000, 0, 3'000'000}) {
        for (const std::int32_t dc_link_uv : {unknown, 0, 30'000'000, 46'000'000, 49'000'000, 52'800'000}) {
          for (const std::int32_t stack_uv : {unknown, rested_pack_uv}) {
            if (stack_uv == unknown && dc_link_uv > 0) continue;
            inputs.push_back({.request = r,
                              .open = (faults & 1) != 0,
                              .open_now = (faults & 2) != 0,
                              .charge_forbidden = (faults & 4) != 0,
                              .discharge_forbidden = (faults & 8) != 0,
                              .current_ua = current_ua,
                              .pack_uv = stack_uv,
                              .dc_link_uv = dc_link_uv,
                              .step_us = 1'000'000});
          }
        }
      }
    }
  }
  return inputs;
}

using Transitions = std::set<std::pair<ContactorState, ContactorState>>;
// clang-format off
const Transitions listed_transitions = {
    {off, off}, {off, self_test}, {off, safe},
    {self_test, self_test}, {self_test, precharge}, {self_test, opening},
    {precharge, precharge}, {precharge, drive}, {precharge, charge}, {precharge, opening},
    {drive, drive}, {drive, unloading}, {drive, opening},
    {charge, charge}, {charge, unloading}, {charge, opening},
    {unloading, unloading}, {unloading, opening},
    {opening, opening}, {opening, off}, {opening, safe},
    {safe, safe}, {safe, off}};
// clang-format on

TEST(ContactorWalk, NeverClosesAgainstASevereFaultInAnyReachableStateUnderAnyInput) {
  const std::vector<ContactorInput> inputs = input_classes();
  constexpr ContactorPlan coarse{.test_us = 1'000'000,
                                 .half_time_constant_us = 500'000,
                                 .dc_link_discharge_us = 3'000'000,
                                 .rest_ua = 120'000};  // few different times
  std::set<std::array<std::uint8_t, sizeof(Contactors)>> known;
  std::vector<Contactors> open{Contactors(coarse)};
  std::set<ContactorState> visited;
  Transitions transitions;
  std::size_t steps = 0;
  while (!open.empty()) {
    const Contactors from = open.back();
    open.pop_back();
    visited.insert(from.state());
    for (const ContactorInput& in : inputs) {
      Contactors c = from;
      const Outputs out = c.update(in);
      ++steps;
      transitions.insert({from.state(), c.state()});
      ASSERT_FALSE(in.open_now && out.any_closed()) << contactor_state_names[static_cast<std::size_t>(c.state())];
      ASSERT_FALSE(out.main_plus && out.precharge);
      ASSERT_FALSE(out.main_plus && !out.main_minus);
      ASSERT_FALSE(out.charge_enable && (in.charge_forbidden || !out.main_plus || in.request == Request::none));
      ASSERT_EQ(out.any_closed() && out.main_plus, c.state() == drive || c.state() == charge || c.state() == unloading);
      if (from.state() != c.state() && c.state() == self_test) {
        ASSERT_FALSE(in.open || in.open_now || in.request == Request::none);
      }
      if (out.main_plus && from.state() == precharge) {
        ASSERT_TRUE(in.dc_link_uv >= 49'000'000 && !in.open) << "closed onto an uncharged DC link";
      }
      if (known.insert(bytes(c)).second) open.push_back(c);
    }
    ASSERT_LT(known.size(), 200'000U);
  }
  EXPECT_EQ(visited.size(), contactor_state_count);
  EXPECT_EQ(transitions, listed_transitions) << "an unlisted transition, or a listed one that never happens";
  EXPECT_GT(steps, 100'000U);
  ::testing::Test::RecordProperty("reached", static_cast<int>(known.size()));
}

TEST(Contactors, InAnInvalidStateEndInSafeEvenIfAllCopiesAgree) {
  for (const std::uint32_t none : {8U, 9U, 0x8000'0003U, 0xFFFF'FFFFU}) {
    FedContactors f;
    f.to(drive);
    std::array<std::uint32_t, sizeof(Contactors) / 4> words{};
    std::memcpy(words.data(), static_cast<void*>(&f.contactors), sizeof(Contactors));
    std::size_t at = 0;
    while (at + 2 < words.size() && !(words[at] == 3 && words[at + 1] == ~3U)) ++at;
    ASSERT_LT(at + 2, words.size());
    words[at] ^= 3 ^ none;
    words[at + 1] ^= 3 ^ none;
    words[at + 2] ^= 3 ^ none;
    std::memcpy(static_cast<void*>(&f.contactors), words.data(), sizeof(Contactors));
    EXPECT_FALSE(f.contactors.intact()) << none;
    EXPECT_EQ(f.step(0.1, rested_pack_uv), safe) << none;
    EXPECT_EQ(f.contactors.outputs(), Outputs{});
  }
}

TEST(GuardedWord, DetectsAnyOneOrTwoFlippedBits) {
  static_assert(sizeof(Guarded) == 12);
  for (const std::uint32_t value : {0U, 3U, 7U, 0x8000'0001U, 0xFFFF'FFFFU}) {
    for (int a = 0; a < 96; ++a) {
      for (int b = a; b < 96; ++b) {
        Guarded g(value);
        std::array<std::uint32_t, 3> w{};
        std::memcpy(w.data(), &g, sizeof g);
        w[static_cast<std::size_t>(a / 32)] ^= 1U << (a % 32);
        if (b != a) w[static_cast<std::size_t>(b / 32)] ^= 1U << (b % 32);
        std::memcpy(static_cast<void*>(&g), w.data(), sizeof g);
        ASSERT_FALSE(g.intact()) << a << ' ' << b;
        ASSERT_EQ(g.any() & value, value) << "fewer than three flips lose no active fault";
      }
    }
  }
}

}  // namespace
}  // namespace bms::protection
