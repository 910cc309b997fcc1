// The parts of the bxCAN back end without registers: bit timing against a search over all settings, filters, and the
// transmit queue.
#include "hal/bxcan/bit_timing.hpp"
#include "hal/bxcan/filter_banks.hpp"
#include "hal/bxcan/transmit_queue.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "hal/accepted_frames.hpp"

namespace bms::hal::bxcan {
namespace {

// STM32F405, calculated by hand: 42 MHz / 42 / 8 = 125 kbit/s, sample point after 7 of 8 quanta...
static_assert(bit_timing(42'000'000, 250'000) == BitTiming{21, 6, 1, 1});
static_assert(bit_timing(42'000'000, 125'000) == BitTiming{21, 13, 2, 2});
static_assert(bit_timing(42'000'000, 500'000, cia301_allows) == BitTiming{6, 11, 2, 2});
static_assert(bit_timing(42'000'000, 500'000, cia301_allows).sample_point_ppm() == 857'142);
static_assert(bit_timing(42'000'000, 250'000).btr() == (0U << 24 | 0U << 20 | 5U << 16 | 20U));
static_assert(bit_timing(40'000'000, 500'000) == BitTiming{5, 13, 2, 2}, "what a core at 160 MHz would reach");

/// True if bit_timing() compiles for these arguments.
template <std::uint32_t Clock, std::uint32_t Rate>
concept Reachable = requires {
  typename std::integral_constant<std::uint32_t, bit_timing(Clock, Rate).brp>;
};
static_assert(Reachable<42'000'000, 250'000> && Reachable<8'000'000, 500'000>);
static_assert(!Reachable<42'000'000, 500'000>, "84 cycles a bit: 85.7 % at best");
static_assert(!Reachable<42'000'000, 800'000>, "not a whole number of cycles");
static_assert(!Reachable<8'000'000, 1'000'001> && !Reachable<42'000'000, 0>);
static_assert(!Reachable<25'000'000, 7'000>);

/// Searches all register values that give the exact rate, by the definition of the bit in RM0090, without the header.
struct Found {
  double nearest = 1;   // distance of the sample point from 87.5 %
  int most_quanta = 0;  // at this distance
};
Found search(double clock_hz, double rate) {
  Found found;
  for (int brp = 1; brp <= 1024; ++brp) {
    for (int ts1 = 1; ts1 <= 16; ++ts1) {
      for (int ts2 = 1; ts2 <= 8; ++ts2) {
        const int quanta = 1 + ts1 + ts2;
        if (quanta < 8 || clock_hz != rate * brp * quanta) continue;
        const double distance = std::abs((1.0 + ts1) / quanta - 0.875);
        if (distance < found.nearest - 1e-9)
          found = {distance, quanta};
        else if (distance < found.nearest + 1e-9)
          found.most_quanta = std::max(found.most_quanta, quanta);
      }
    }
  }
  return found;
}

constexpr SamplePointRange anywhere{0, 1'000'000};

void is_the_best(std::uint32_t clock_hz, std::uint32_t rate, const BitTiming& t) {
  const Found found = search(clock_hz, rate);
  EXPECT_EQ(std::uint64_t{rate} * t.brp * t.quanta(), clock_hz);
  EXPECT_NEAR(std::abs((1.0 + t.ts1) / t.quanta() - 0.875), found.nearest, 1e-9)
      << clock_hz << " Hz, " << rate << " bit/s";
  EXPECT_EQ(static_cast<int>(t.quanta()), found.most_quanta) << clock_hz << " Hz, " << rate << " bit/s";
  EXPECT_LE(t.sjw, std::min(t.ts2, 4U));
  EXPECT_GE(t.sjw, 1U);
}

TEST(BitTiming, IsTheBestOfASearchOverAllRegisterValues) {
  is_the_best(42'000'000, 125'000, bit_timing(42'000'000, 125'000, anywhere));
  is_the_best(42'000'000, 250'000, bit_timing(42'000'000, 250'000, anywhere));
  is_the_best(42'000'000, 500'000, bit_timing(42'000'000, 500'000, anywhere));
  is_the_best(42'000'000, 1'000'000, bit_timing(42'000'000, 1'000'000, anywhere));
  is_the_best(45'000'000, 500'000, bit_timing(45'000'000, 500'000, anywhere));
  is_the_best(36'000'000, 250'000, bit_timing(36'000'000, 250'000, anywhere));
  is_the_best(8'000'000, 125'000, bit_timing(8'000'000, 125'000, anywhere));
  is_the_best(16'000'000, 500'000, bit_timing(16'000'000, 500'000, anywhere));
  is_the_best(25'000'000, 250'000, bit_timing(25'000'000, 250'000, anywhere));
}

/// 128 frames of 160 bits (29-bit identifier, 8 bytes, 29 stuff bits, intermission), by hand.
TEST(BitTiming, GivesTheRecoveryOnAFullBusItsTime) {
  EXPECT_EQ(longest_recovery_us(125'000), 163'840U);
  EXPECT_EQ(longest_recovery_us(250'000), 81'920U);
  EXPECT_EQ(longest_recovery_us(1'000'000), 20'480U);
}

TEST(FilterBanks, ContainEachIdentifierOnceInBits15To5AndRepeatTheLast) {
  constexpr std::array<std::uint16_t, 5> ids{0x310, 0x311, 0x312, 0x7FF, 0x001};
  ASSERT_EQ(bank_count(ids), 2U);
  EXPECT_EQ(filter_bank(ids, 0).fr1, 0x62206200U);
  EXPECT_EQ(filter_bank(ids, 0).fr2, 0xFFE06240U);
  EXPECT_EQ(filter_bank(ids, 1).fr1, 0x00200020U);
  EXPECT_EQ(filter_bank(ids, 1).fr2, 0x00200020U);
  EXPECT_FALSE(fits(std::array<std::uint16_t, 1>{0x800}, 0));
  EXPECT_TRUE(fits(std::array<std::uint16_t, 56>{}, 0));
  EXPECT_FALSE(fits(std::array<std::uint16_t, 57>{}, 0));
  EXPECT_FALSE(fits(std::array<std::uint16_t, 56>{}, 1)) << "a 29-bit identifier has a bank of its own";
  EXPECT_TRUE(fits(std::array<std::uint16_t, 48>{}, 2));
  EXPECT_FALSE(fits(std::array<std::uint16_t, 49>{}, 2));
}

/// On a CANopen bus, 0x310 to 0x31D are the process data of other devices (receive PDO 2 of nodes 16 to 29).
TEST(AcceptedFrames, OfABoardThatMeasuresItselfAreCommandsButNoFramesOfSamples) {
  EXPECT_EQ(std::ranges::count(request_ids, 0x1A0), 1);
  EXPECT_EQ(std::ranges::count(request_and_sample_ids, 0x1A0), 1);
  for (int id = 0x310; id <= 0x31D; ++id) {
    EXPECT_EQ(std::ranges::count(request_ids, id), 0) << id;
    EXPECT_EQ(std::ranges::count(request_and_sample_ids, id), 1) << id;
  }
}

/// ISO 11898-1, 10.4.2, bit by bit: eleven bits, then RTR and IDE of a standard frame (both 0), or SRR and IDE of a
/// 29-bit frame (both 1) and its other eighteen bits.
TEST(TransmitQueue, ReturnsStandardAnd29BitFramesInTheOrderOfArbitration) {
  const auto on_the_wire = [](const can::Frame& f) {
    std::vector<int> bits;
    for (int k = 10; k >= 0; --k) bits.push_back(static_cast<int>((f.long_id ? f.id >> 18 : f.id) >> k & 1));
    bits.insert(bits.end(), 2, f.long_id ? 1 : 0);
    for (int k = 17; k >= 0; --k) bits.push_back(f.long_id ? static_cast<int>(f.id >> k & 1) : 0);
    return bits;
  };
  std::mt19937 random(3);
  TransmitQueue<32> queue;
  std::vector<can::Frame> expected;
  for (std::uint32_t k = 0; k < 32; ++k) {
    const std::uint32_t base = 0x67E + static_cast<std::uint32_t>(random() % 3);
    can::Frame f{k % 2 == 0 ? base : base << 18 | static_cast<std::uint32_t>(random() % (1U << 18)), 0, {}, k % 2 != 0};
    f.data[0] = static_cast<std::uint8_t>(k);
    expected.push_back(f);
    ASSERT_TRUE(queue.insert({f, k}));
  }
  std::stable_sort(expected.begin(), expected.end(),
                   [&](const can::Frame& a, const can::Frame& b) { return on_the_wire(a) < on_the_wire(b); });
  for (const can::Frame& f : expected) {
    WaitingFrame out;
    ASSERT_TRUE(queue.pop(out, [](const WaitingFrame&) { return true; }));
    EXPECT_EQ(out.frame.data[0], f.data[0]);
  }
}

/// Reference: a list of all frames, sorted.
TEST(TransmitQueue, AlwaysReturnsTheMostUrgentFrameAndTheOldestOfOneIdentifier) {
  TransmitQueue<8> queue;
  std::vector<std::pair<unsigned, std::uint32_t>> expected;  // id, number
  std::mt19937 random(7);
  std::uint32_t number = 0xFFFFFF80;  // wraps during the test
  std::uint32_t first = number;
  unsigned given_up = 0;
  for (int k = 0; k < 20'000; ++k) {
    if (random() % 5 < 3) {
      const auto id = static_cast<std::uint16_t>(0x100 + random() % 6);
      const bool kept = queue.insert({{id, 0, {}}, number});
      expected.emplace_back(id, number - first);
      ++number;
      std::sort(expected.begin(), expected.end());
      EXPECT_EQ(kept, expected.size() <= 8);
      if (expected.size() > 8) expected.pop_back(), ++given_up;
    } else {
      const auto forbidden = static_cast<std::uint16_t>(0x100 + random() % 6);
      WaitingFrame out;
      const auto found =
          std::find_if(expected.begin(), expected.end(), [&](const auto& e) { return e.first != forbidden; });
      ASSERT_EQ(queue.pop(out, [&](const WaitingFrame& w) { return w.frame.id != forbidden; }),
                found != expected.end());
      if (found == expected.end()) continue;
      ASSERT_EQ(out.frame.id, found->first);
      ASSERT_EQ(out.number - first, found->second);
      expected.erase(found);
    }
    ASSERT_EQ(queue.size(), expected.size());
  }
  EXPECT_GT(given_up, 1000U);
}

}  // namespace
}  // namespace bms::hal::bxcan
