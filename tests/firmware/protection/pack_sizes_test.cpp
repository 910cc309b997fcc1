// Packs of 8, 15 and 24 cells: every cell is protected and balanced, and limits of the pack follow its size.
#include <gtest/gtest.h>

#include "protection/protection.hpp"
#include "tests/firmware/protection/expected_rows.hpp"

namespace bms::protection {
namespace {

constexpr PackDesign design_of(std::size_t cells) {
  PackDesign d = forklift;
  d.cells = static_cast<std::uint8_t>(cells);
  return d;
}

/// A pack of table9 cells at rest, contactors open. Its readings always change a little.
template <std::size_t Cells>
struct RestingPack {
  static constexpr ProtectionPlan plan = protection_plan(design_of(Cells));
  static constexpr std::size_t last = Cells - 1;

  RestingPack() { run_s(2); }
  /// Runs with a sample every 0.1 s.
  void run_s(int seconds) {
    for (int k = 0; k < 10 * seconds; ++k) {
      measurement::PackSample<Cells> s;
      s.time_us = time_us += 100'000;
      s.current_ua = 0;
      const auto ripple_uv = static_cast<std::int32_t>(time_us / 100'000 % 3 * 500);
      s.pack_uv = 0;
      for (std::size_t c = 0; c < Cells; ++c) {
        s.cell_uv[c] = (c == last ? last_uv : base_uv) + ripple_uv;
        s.pack_uv += s.cell_uv[c];
      }
      s.pack_uv += pack_error_uv;
      for (std::size_t t = 0; t < 4; ++t)
        s.temperature_cdegc[t] = static_cast<std::int16_t>(2'500 + time_us / 100'000 % 5);
      protection.update(s, estimate, {});
    }
  }
  bool has(Fault f) const { return (protection.decision().faults & bit(f)) != 0; }

  Protection<Cells> protection{plan};
  PackEstimate<Cells> estimate;
  std::uint64_t time_us = 0;
  std::int32_t base_uv = 3'300'000, last_uv = 3'300'000, pack_error_uv = 0;
};

template <class Pack>
class PackOfCells : public ::testing::Test {};
using Sizes = ::testing::Types<RestingPack<8>, RestingPack<15>, RestingPack<24>>;
TYPED_TEST_SUITE(PackOfCells, Sizes);

TYPED_TEST(PackOfCells, RaisesNoFaultAtRest) {
  TypeParam pack;
  pack.run_s(60);
  EXPECT_EQ(pack.protection.decision().faults, 0U);
}

TYPED_TEST(PackOfCells, DetectsOverAndUndervoltageOfItsLastCell) {
  TypeParam high;
  high.last_uv = 3'830'000;
  high.run_s(1);
  EXPECT_TRUE(high.has(Fault::cell_overvoltage_severe));
  TypeParam low;
  low.last_uv = 1'790'000;
  low.run_s(1);
  EXPECT_TRUE(low.has(Fault::cell_undervoltage_severe));
}

/// Of 16 cells the limit is 58.93 V, 3.683 V per cell (firmware/protection/README.md).
TYPED_TEST(PackOfCells, LimitsThePackVoltageByItsNumberOfCells) {
  TypeParam below, above;
  below.base_uv = below.last_uv = 3'672'000;
  above.base_uv = above.last_uv = 3'694'000;
  below.run_s(5);
  above.run_s(5);
  EXPECT_FALSE(below.has(Fault::pack_overvoltage));
  EXPECT_TRUE(above.has(Fault::pack_overvoltage));
}

TYPED_TEST(PackOfCells, DetectsAPackReadingThatLacksOneCell) {
  TypeParam pack;
  pack.pack_error_uv = -3'300'000;
  pack.run_s(60);
  EXPECT_TRUE(pack.has(Fault::sum_mismatch));
}

TYPED_TEST(PackOfCells, BalancesItsLastCell) {
  TypeParam pack;
  pack.base_uv = pack.last_uv = 3'400'000;
  pack.estimate.soc_ppb = 970'000'000;
  pack.estimate.soc_sigma_ppb = 1'000'000;
  pack.estimate.cell_soc_ppb.fill(0);
  pack.estimate.cell_sigma_ppb.fill(1'000'000);
  pack.estimate.cell_soc_ppb[TypeParam::last] = 25'000'000;
  std::uint32_t bled = 0;
  for (int k = 0; k < 20; ++k) {
    pack.run_s(1);
    bled |= pack.protection.decision().bleed;
  }
  EXPECT_EQ(bled, 1U << TypeParam::last);
}

}  // namespace
}  // namespace bms::protection
