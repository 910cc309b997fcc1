// All reachable states of the contactors under all classes of inputs, and flipped bits in their state.
#include "protection/contactors.hpp"

#include <array>
#include <cstring>
#include <set>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "tests/firmware/protection/contactor_bench.hpp"

namespace bms::protection {
namespace {

using enum ContactorState;

/// The bytes that determine all later steps. Outputs uses the lower half of its byte, and the compiler leaves anything
/// in the upper one: without the mask each state counts up to 16 times.
std::array<std::uint8_t, sizeof(Contactors)> bytes(const Contactors& c) {
  std::array<std::uint8_t, sizeof(Contactors)> all{};
  std::memcpy(all.data(), &c, sizeof c);
  const auto at = reinterpret_cast<std::uintptr_t>(&c.outputs()) - reinterpret_cast<std::uintptr_t>(&c);
  all.at(at) &= 0x0F;
  return all;
}

struct Poles {
  std::int32_t plus_uv, minus_uv;
};
constexpr std::int32_t unknown = measurement::no_reading;
/// Not measured; floating and empty; floating and full; plus closed on an empty DC link; plus closed and half full;
/// minus closed and half full, 12 %, 1 % below the pack; both closed.
constexpr Poles pole_classes[] = {{unknown, unknown},       {1'278'000, 1'278'000},   {22'300'000, -30'500'000},
                                  {52'800'000, 52'800'000}, {52'800'000, 26'000'000}, {26'000'000, 0},
                                  {46'500'000, 0},          {52'300'000, 0},          {52'800'000, 0}};
constexpr AuxiliaryContacts auxiliary_classes[] = {
    {},
    {.fitted = true},
    {.fitted = true, .main_plus_closed = true},
    {.fitted = true, .main_minus_closed = true},
    {.fitted = true, .main_plus_closed = true, .main_minus_closed = true}};

/// One input of each class that the contactors can distinguish.
std::vector<ContactorInput> input_classes() {
  std::vector<ContactorInput> inputs;
  for (const Request r : {Request::none, Request::drive, Request::charge}) {
    for (int faults = 0; faults < 16; ++faults) {
      for (const std::int32_t current_ua : {unknown, -3'000'000, 0, 3'000'000}) {
        for (const Poles& poles : pole_classes) {
          inputs.push_back({.request = r,
                            .open = (faults & 1) != 0,
                            .open_now = (faults & 2) != 0,
                            .charge_forbidden = (faults & 4) != 0,
                            .discharge_forbidden = (faults & 8) != 0,
                            .current_ua = current_ua,
                            .pack_uv = rested_pack_uv,
                            .link_plus_uv = poles.plus_uv,
                            .link_minus_uv = poles.minus_uv,
                            .step_us = 1'000'000});
        }
      }
    }
  }
  // The other inputs do not depend on the current and on its faults.
  for (const Request r : {Request::none, Request::drive}) {
    for (const bool open_now : {false, true}) {
      for (const Poles& poles : pole_classes) {
        for (const AuxiliaryContacts& auxiliary : auxiliary_classes) {
          for (const bool lost : {false, true}) {
            inputs.push_back({.request = r,
                              .open_now = open_now,
                              .contact_lost = lost,
                              .current_ua = 0,
                              .pack_uv = rested_pack_uv,
                              .link_plus_uv = poles.plus_uv,
                              .link_minus_uv = poles.minus_uv,
                              .auxiliary = auxiliary,
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

/// What must hold in every step.
void expect_safe(const Contactors& from, const Contactors& to, const ContactorInput& in, const ContactorPlan& plan) {
  const Outputs before = from.outputs(), out = to.outputs();
  ASSERT_FALSE(in.open_now && out.any_closed()) << contactor_state_names[static_cast<std::size_t>(to.state())];
  ASSERT_FALSE(out.main_plus && !out.main_minus);
  ASSERT_FALSE(out.charge_enable && (in.charge_forbidden || !out.main_plus || in.request == Request::none));
  ASSERT_EQ(out.main_plus, to.state() == drive || to.state() == charge || to.state() == unloading);
  if (from.state() != to.state() && to.state() == self_test) {
    ASSERT_FALSE(in.open || in.open_now || in.request == Request::none);
  }
  const bool opened =
      in.contact_lost || (in.auxiliary.fitted && ((before.main_plus && !in.auxiliary.main_plus_closed) ||
                                                  (before.main_minus && !in.auxiliary.main_minus_closed)));
  ASSERT_FALSE((before.main_plus || before.main_minus) && opened && out.any_closed()) << "a contact is open";
  ASSERT_FALSE(in.auxiliary.fitted && in.auxiliary.main_plus_closed && !before.main_plus && out.main_plus);
  if (out.main_plus && out.precharge) {
    ASSERT_EQ(from.state(), precharge) << "the relay stays closed for one sample";
  }
  if (!out.main_plus || before.main_plus) return;
  ASSERT_FALSE(in.open);
  if (plan.dc_link) {
    ASSERT_TRUE(before.precharge && before.main_minus && out.precharge) << "make before break";
    ASSERT_TRUE(in.link_minus_uv == 0 && in.link_plus_uv >= rested_pack_uv - 9'000'000) << "onto an empty DC link";
  }
}

void walk(const ContactorPlan& plan, const Transitions& listed) {
  const std::vector<ContactorInput> inputs = input_classes();
  std::set<std::array<std::uint8_t, sizeof(Contactors)>> known;
  std::vector<Contactors> open{Contactors(plan)};
  std::set<ContactorState> visited;
  Transitions transitions;
  std::size_t steps = 0;
  while (!open.empty()) {
    const Contactors from = open.back();
    open.pop_back();
    visited.insert(from.state());
    for (const ContactorInput& in : inputs) {
      Contactors c = from;
      c.update(in);
      ++steps;
      transitions.insert({from.state(), c.state()});
      expect_safe(from, c, in, plan);
      if (::testing::Test::HasFatalFailure()) return;
      if (known.insert(bytes(c)).second) open.push_back(c);
    }
    ASSERT_LT(known.size(), 200'000U);
  }
  EXPECT_EQ(visited.size(), plan.dc_link ? contactor_state_count : contactor_state_count - 2);
  EXPECT_EQ(transitions, listed) << "an unlisted transition, or a listed one that never happens";
  EXPECT_GT(steps, 100'000U);
  ::testing::Test::RecordProperty("reached", static_cast<int>(known.size()));
}

constexpr ContactorPlan coarse{.test_us = 1'000'000,
                               .half_time_constant_us = 500'000,
                               .rest_ua = 120'000,
                               .max_closing_gap_uv = 9'000'000,
                               .dc_link = true};  // few different times

TEST(ContactorWalk, NeverClosesAgainstASevereFaultInAnyReachableStateUnderAnyInput) {
  walk(coarse, listed_transitions);
}

TEST(ContactorWalk, WithoutADcLinkNeverClosesAgainstASevereFaultEither) {
  ContactorPlan single = coarse;
  single.dc_link = false;
  walk(single, {{off, off},
                {off, drive},
                {off, charge},
                {off, safe},
                {drive, drive},
                {drive, unloading},
                {drive, opening},
                {charge, charge},
                {charge, unloading},
                {charge, opening},
                {unloading, unloading},
                {unloading, opening},
                {opening, opening},
                {opening, off},
                {opening, safe},
                {safe, safe},
                {safe, off}});
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
