// Protection with corrupted memory: flipped bits, and the plan of another pack.
#include "protection/protection.hpp"

#include <array>
#include <cstring>

#include <gtest/gtest.h>

#include "plant/random.hpp"
#include "tests/firmware/protection/protection_bench.hpp"

namespace bms::protection {
namespace {

TEST(Protection, WithThePlanOfAnotherPackClosesNothing) {
  PackDesign other = forklift;
  other.cells = 15;
  const ProtectionPlan plan_of_15 = protection_plan(other);
  ProtectionBench b(0, plan_of_15);
  b.inputs.request = Request::drive;
  b.run(100);
  EXPECT_NE(b.protection.decision().faults & bit(Fault::internal_fault), 0U);
  EXPECT_FALSE(b.protection.decision().outputs.any_closed());
}

TEST(Protection, EndsInSafeWithAnInternalFaultAfterAnyOneOrTwoFlippedBitsOfTheState) {
  ProtectionBench closed;
  closed.drive_off();
  // The state: three words that contain drive, its inverse, and drive xor a pattern.
  std::array<std::uint32_t, sizeof(Contactors) / 4> words{};
  std::memcpy(words.data(), static_cast<void*>(&closed.protection.contactors()), sizeof(Contactors));
  std::size_t at = 0;
  while (at + 2 < words.size() && !(words[at] == 3 && words[at + 1] == ~3U)) ++at;
  ASSERT_LT(at + 2, words.size());
  std::size_t tried = 0;
  for (std::size_t a = 0; a < 96; ++a) {
    for (std::size_t b = a; b < 96; ++b) {
      ProtectionBench copy = closed;
      auto flipped = words;
      flipped[at + a / 32] ^= 1U << (a % 32);
      if (a != b) flipped[at + b / 32] ^= 1U << (b % 32);
      std::memcpy(static_cast<void*>(&copy.protection.contactors()), flipped.data(), sizeof(Contactors));
      const Decision& d = copy.step();
      ASSERT_EQ(d.state, ContactorState::safe) << a << ' ' << b;
      ASSERT_FALSE(d.outputs.any_closed());
      ASSERT_NE(d.faults & bit(Fault::internal_fault), 0U);
      ASSERT_EQ(d.allowed.discharge_ua, 0);
      ++tried;
    }
  }
  EXPECT_EQ(tried, 96U * 97 / 2);
}

TEST(Protection, EndsInSafeWithAnInternalFaultAfterAnyFlippedBitOfTheSetOfFaults) {
  ProtectionBench closed;
  closed.drive_off();
  using Words = std::array<FaultSet, sizeof(Protection<16>) / 8>;
  Words words{};
  std::memcpy(words.data(), static_cast<void*>(&closed.protection), sizeof words);
  std::size_t at = 0;  // no fault, its inverse, and its xor with the pattern
  while (at + 2 < words.size() &&
         !(words[at] == 0 && words[at + 1] == ~FaultSet{0} && words[at + 2] == 0x5A3C'96A5'5A3C'96A5))
    ++at;
  ASSERT_LT(at + 2, words.size());
  for (std::size_t a = 0; a < 192; ++a) {
    ProtectionBench copy = closed;
    Words flipped = words;
    flipped[at + a / 64] ^= FaultSet{1} << (a % 64);
    std::memcpy(static_cast<void*>(&copy.protection), flipped.data(), sizeof flipped);
    const Decision& d = copy.step();
    EXPECT_EQ(d.state, ContactorState::opening) << a;
    EXPECT_FALSE(d.outputs.any_closed());
    EXPECT_NE(d.faults & bit(Fault::internal_fault), 0U);
    copy.load_ua = 0;
    copy.run(60);
    EXPECT_EQ(copy.protection.decision().state, ContactorState::safe);
    EXPECT_NE(copy.protection.decision().faults & bit(Fault::internal_fault), 0U) << "until it is cleared";
  }
}

TEST(Protection, LosesNoFaultByAFlippedBit) {
  ProtectionBench b;
  b.drive_off();
  b.inputs.storage_fault = true;
  b.step();
  b.inputs.storage_fault = false;  // the fault stays until it is cleared
  b.step();
  constexpr FaultSet there = bit(Fault::storage_fault);
  std::array<FaultSet, sizeof(Protection<16>) / 8> words{};
  std::memcpy(words.data(), static_cast<void*>(&b.protection), sizeof words);
  std::size_t at = 0;
  while (at + 2 < words.size() &&
         !(words[at] == there && words[at + 1] == ~there && words[at + 2] == (there ^ 0x5A3C'96A5'5A3C'96A5)))
    ++at;
  ASSERT_LT(at + 2, words.size());
  for (std::size_t copy = 0; copy < 3; ++copy) {
    ProtectionBench flipped = b;
    auto with_flip = words;
    with_flip[at + copy] ^= there;
    std::memcpy(static_cast<void*>(&flipped.protection), with_flip.data(), sizeof with_flip);
    EXPECT_EQ(flipped.step().faults, there | bit(Fault::internal_fault)) << copy;
  }
}

/// The outputs are not stored redundantly: each sample derives them from the guarded state.
TEST(Protection, RepairsFlippedOutputsWithTheNextSample) {
  ProtectionBench closed;
  closed.drive_off();
  const Outputs expected = closed.protection.decision().outputs;
  for (unsigned bits = 1; bits < 16; ++bits) {
    ProtectionBench copy = closed;
    auto* byte = reinterpret_cast<unsigned char*>(const_cast<Outputs*>(&copy.protection.contactors().outputs()));
    *byte = static_cast<unsigned char>(*byte ^ bits);
    EXPECT_NE(copy.protection.contactors().outputs(), expected) << bits;
    EXPECT_EQ(copy.step().outputs, expected) << bits;
  }
}

/// A flip in any bit of the contactors, not only in the guarded ones: they open, or a later step repairs the bit.
TEST(Protection, NeverClosesAgainstASevereFaultAfterAnyFlippedBit) {
  ProtectionBench b;
  b.drive_off();
  b.change = [](auto& s) { s.cell_uv[0] = 4'000'000; };
  plant::Random random(11);
  for (int trial = 0; trial < 4'000; ++trial) {
    ProtectionBench copy = b;
    auto* byte = reinterpret_cast<unsigned char*>(&copy.protection.contactors());
    const std::size_t place =
        sizeof(void*) + static_cast<std::size_t>(
                            random.uniform() * (sizeof(Contactors) - sizeof(void*)));  // except the pointer to the plan
    byte[place] = static_cast<unsigned char>(byte[place] ^ (1U << (random.bits() % 8)));
    for (int k = 0; k < 4; ++k) copy.step();
    ASSERT_FALSE(copy.protection.decision().outputs.any_closed()) << place;
  }
}

}  // namespace
}  // namespace bms::protection
