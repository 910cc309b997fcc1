// Quantities that the table compares, from samples: against the oracle, and by hand.
#include "protection/pack_quantities.hpp"

#include <gtest/gtest.h>

#include "plant/random.hpp"
#include "tests/firmware/protection/fault_rig.hpp"

namespace bms::protection {
namespace {

/// Random readings in which every cell and every sensor is sometimes the highest, the lowest, missing, stuck, or
/// shifted against its neighbour.
TEST(Quantities, OfAnySampleEqualTheirDefinitions) {
  plant::Random random(23);
  const auto whole = [&](int from, int to) { return from + static_cast<int>(random.uniform() * (to - from + 1)); };
  int shifted = 0, stuck_cells = 0, stuck_sensors = 0;
  for (int run = 0; run < 60; ++run) {
    PackQuantities<16> quantities(forklift_plan.limits);
    QuantityOracle oracle;
    measurement::PackSample<16> s;
    const double missing = run % 3 == 0 ? 0 : 0.05, same = run % 2 == 0 ? 0.2 : 0.9;
    for (int step = 0; step < 100; ++step) {
      const int level_uv = 3'300'000 + whole(-60, 60) * 1'000, level_cdegc = 2'000 + whole(-800, 800);
      for (auto& uv : s.cell_uv) {
        if (random.uniform() < same && uv != measurement::no_reading) continue;
        if (random.uniform() < missing)
          uv = measurement::no_reading;
        else
          uv = random.uniform() < 0.1 ? whole(-500'000, 5'000'000) : level_uv + whole(-20'000, 20'000);
      }
      if (random.uniform() < 0.3) {  // a broken wire anywhere, or an impossible reading next to a possible one
        const auto k = static_cast<std::size_t>(whole(0, 14));
        const int by = random.uniform() < 0.2 ? whole(-4'500'000, 4'500'000) : whole(-400'000, 400'000);
        s.cell_uv[k] = level_uv + by;
        s.cell_uv[k + 1] = level_uv - by + whole(-100'000, 100'000);
      }
      for (auto& t : s.temperature_cdegc) {
        if (random.uniform() < same && t != measurement::no_temperature) continue;
        t = random.uniform() < 2 * missing ? measurement::no_temperature
                                           : static_cast<std::int16_t>(level_cdegc + whole(-3'000, 3'000));
      }
      s.current_ua = random.uniform() < missing ? measurement::no_reading : whole(-40'000'000, 40'000'000);
      s.pack_uv = random.uniform() < missing ? measurement::no_reading : 16 * level_uv + whole(-1'000'000, 1'000'000);
      Quantities q = unknown_quantities();
      quantities.update(s, step_us, q);
      const auto expected = oracle.check(s, false);
      for (std::size_t k = 0; k < fault_count; ++k) {
        if (!visible_in_samples(k) || k == 18) continue;  // row 18 comes from the estimator
        ASSERT_EQ(at(q, forklift_plan.rules[k].quantity), expected[k].value_or(measurement::no_reading))
            << expected_rows[k].name << ", run " << run << ", sample " << step;
      }
      shifted += expected[16].value_or(0) > 0 ? 1 : 0;
      stuck_cells += expected[21].value_or(0) > 0 ? 1 : 0;
      stuck_sensors += expected[24].value_or(0) > 0 ? 1 : 0;
      std::int64_t sum = 0;
      for (const std::int32_t uv : s.cell_uv)
        sum = uv < -500'000 || uv > 6'000'000 || sum == measurement::no_reading ? measurement::no_reading : sum + uv;
      ASSERT_EQ(quantities.sum_uv(), sum);
    }
  }
  EXPECT_GT(shifted, 500);
  EXPECT_GT(stuck_cells, 500);
  EXPECT_GT(stuck_sensors, 100);
}

TEST(Quantities, OfImpossibleReadingsAreMissing) {
  struct Case {
    std::int32_t cell_uv;
    std::int16_t cdegc;
    bool there;
  };
  for (const Case& c : {Case{-500'000, -6'000, true}, Case{6'000'000, 15'000, true}, Case{-500'001, -6'001, false},
                        Case{6'000'001, 15'001, false}}) {
    PackQuantities<16> quantities(forklift_plan.limits);
    measurement::PackSample<16> s;
    s.cell_uv.fill(3'300'000);
    s.temperature_cdegc.fill(2'500);
    s.pack_uv = 0;  // a shorted pack is a reading
    s.cell_uv[15] = c.cell_uv;
    s.temperature_cdegc[3] = c.cdegc;
    Quantities q = unknown_quantities();
    quantities.update(s, step_us, q);
    EXPECT_EQ(at(q, Quantity::voltages_missing), c.there ? 0 : 1) << c.cell_uv;
    EXPECT_EQ(at(q, Quantity::temperatures_missing), c.there ? 0 : 1) << c.cdegc;
    EXPECT_EQ(at(q, Quantity::pack_uv), 0);
  }
}

/// With too few other cells, the pack's own reading shows whether they moved.
template <std::size_t Cells>
std::int32_t stuck_in_a_small_pack(std::int32_t others_move_uv, bool pack_known, bool one_missing = false) {
  PackQuantities<Cells> quantities(forklift_plan.limits);
  measurement::PackSample<Cells> s;
  Quantities q = unknown_quantities();
  for (int k = 0; k < 7; ++k) {
    const std::int32_t moved_uv = k < 6 ? 0 : others_move_uv;
    for (std::size_t c = 0; c < Cells; ++c)
      s.cell_uv[c] = 3'300'000 + static_cast<std::int32_t>(c) * 100 + (c == 0 ? 0 : moved_uv + k % 2);
    if (one_missing) s.cell_uv[Cells - 1] = measurement::no_reading;
    s.pack_uv = pack_known ? static_cast<std::int32_t>(Cells) * (3'300'000 + moved_uv) : measurement::no_reading;
    quantities.update(s, step_us, q);
  }
  return at(q, Quantity::voltages_stuck);
}

TEST(Quantities, OfLessThanFourCellsUseThePacksOwnReading) {
  EXPECT_EQ(stuck_in_a_small_pack<1>(20'000, true), 0);
  EXPECT_EQ(stuck_in_a_small_pack<1>(20'001, true), 1);
  EXPECT_EQ(stuck_in_a_small_pack<2>(-20'001, true), 1);
  EXPECT_EQ(stuck_in_a_small_pack<3>(-20'001, true), 1);
  EXPECT_EQ(stuck_in_a_small_pack<3>(-20'001, false), measurement::no_reading);
  EXPECT_EQ(stuck_in_a_small_pack<4>(20'100, false), 1) << "four cells are sufficient";
  EXPECT_EQ(stuck_in_a_small_pack<4>(20'100, false, true), measurement::no_reading)
      << "three of four are not sufficient";
  EXPECT_EQ(stuck_in_a_small_pack<4>(20'001, true, true), 1);
}

TEST(Quantities, OfOneReadableCellAreItsOwnAndOfNoCellAreUnknown) {
  PackQuantities<16> quantities(forklift_plan.limits);
  measurement::PackSample<16> s;
  Quantities q = unknown_quantities();
  s.cell_uv[6] = 3'300'000;
  quantities.update(s, step_us, q);
  EXPECT_EQ(at(q, Quantity::highest_cell_uv), 3'300'000);
  EXPECT_EQ(at(q, Quantity::lowest_cell_uv), 3'300'000);
  EXPECT_EQ(at(q, Quantity::spread_uv), 0);
  EXPECT_EQ(at(q, Quantity::opposite_shift_uv), 0);
  EXPECT_EQ(at(q, Quantity::voltages_missing), 16) << "fifteen cells and the pack";
  s.cell_uv[6] = measurement::no_reading;
  s.pack_uv = 52'800'000;
  quantities.update(s, step_us, q);
  for (const Quantity of : {Quantity::highest_cell_uv, Quantity::lowest_cell_uv, Quantity::spread_uv,
                            Quantity::opposite_shift_uv, Quantity::voltages_stuck, Quantity::sum_error_uv})
    EXPECT_EQ(at(q, of), measurement::no_reading);
  EXPECT_EQ(at(q, Quantity::voltages_missing), 16);
  EXPECT_EQ(at(q, Quantity::pack_uv), 52'800'000);
}

TEST(Quantities, OfACellThatMustNotBeChargedOverloadWithAnyCurrent) {
  PackDesign d = forklift;
  d.limits.charge_current_max_a = 0;
  PackQuantities<16> quantities(pack_limits(d));
  measurement::PackSample<16> s;
  s.current_ua = 2'560;
  Quantities q = unknown_quantities();
  quantities.update(s, 1'000'000, q);
  EXPECT_EQ(at(q, Quantity::charge_overload_i2t_us), 99'000'000) << "saturated at ten times the limit";
}

TEST(Quantities, IgnoreSensorsThatAreNotFitted) {
  PackDesign d = forklift;
  d.temperatures = 2;
  PackQuantities<16> quantities(pack_limits(d));
  measurement::PackSample<16> s;
  s.temperature_cdegc = {2'500, measurement::no_temperature, 9'000, -5'000};
  Quantities q = unknown_quantities();
  quantities.update(s, step_us, q);
  EXPECT_EQ(at(q, Quantity::temperatures_missing), 1);
  EXPECT_EQ(at(q, Quantity::highest_cdegc), 2'500);
  EXPECT_EQ(at(q, Quantity::lowest_cdegc), 2'500);
  EXPECT_EQ(at(q, Quantity::temperatures_stuck), measurement::no_reading) << "a single sensor is not compared";
  d.temperatures = 9;
  EXPECT_EQ(pack_limits(d).temperatures, 4) << "limited to the sensors of a sample";
}

/// A sensor that warms alone, next to a burning terminal, does not make the constant ones stuck, nor do two of four. A
/// sensor that stays while most of the others warm is stuck.
TEST(Quantities, CallATemperatureStuckOnlyIfMostOthersMove) {
  for (const int fitted : {2, 3, 4}) {
    for (int moving = 1; moving < fitted; ++moving) {
      PackDesign d = forklift;
      d.temperatures = static_cast<std::uint8_t>(fitted);
      PackQuantities<16> quantities(pack_limits(d));
      Quantities q = unknown_quantities();
      measurement::PackSample<16> s;
      s.temperature_cdegc = {2'500, 2'500, 2'500, 2'500};
      for (int k = 0; k < 30; ++k) {
        for (int warm = 0; warm < moving; ++warm)
          s.temperature_cdegc[static_cast<std::size_t>(warm)] = static_cast<std::int16_t>(2'500 + 100 * k + warm);
        quantities.update(s, step_us, q);
      }
      const bool found = 2 * moving > fitted || fitted == 2;
      EXPECT_EQ(at(q, Quantity::temperatures_stuck), found ? fitted - moving : 0) << moving << " of " << fitted;
    }
  }
}

/// Integral of (I / limit)^2 - 1 with 1.05 times the continuous limit; not below 0, saturated at ten times the limit.
TEST(OverloadIntegral, ACurrentIntegratesItsSquareOverTheLimit) {
  for (const double limit_a : {6.0, 300.0}) {
    PackDesign d = forklift;
    d.limits.charge_current_max_a = limit_a;
    d.limits.discharge_current_max_a = 2 * limit_a;
    for (const int sign : {1, -1}) {
      const double from_a = 1.05 * (sign > 0 ? limit_a : 2 * limit_a);
      const Quantity mine = sign > 0 ? Quantity::charge_overload_i2t_us : Quantity::discharge_overload_i2t_us,
                     other = sign > 0 ? Quantity::discharge_overload_i2t_us : Quantity::charge_overload_i2t_us;
      PackQuantities<16> quantities(pack_limits(d));
      measurement::PackSample<16> s;
      Quantities q = unknown_quantities();
      const auto overload_s = [&](double times, std::uint32_t us) {
        s.current_ua = sign * static_cast<std::int32_t>(1e6 * times * from_a);
        quantities.update(s, us, q);
        return at(q, mine) / 1e6;
      };
      EXPECT_NEAR(overload_s(2, 1'000'000), 3, 0.05);
      EXPECT_NEAR(overload_s(0, 1'000'000), 2, 0.05) << "at rest it decreases by the time";
      EXPECT_NEAR(overload_s(0.5, 1'000'000), 1.25, 0.06);
      EXPECT_EQ(at(q, other), 0);
      EXPECT_NEAR(overload_s(-2, 1'000'000), 0.25, 0.06) << "the other direction counts as rest";
      EXPECT_EQ(overload_s(0, 10'000'000), 0) << "not below 0";
      if (from_a > 200) continue;  // outside the range of a reading
      EXPECT_NEAR(overload_s(10, 100'000), 9.9, 0.1);
      EXPECT_NEAR(overload_s(0, 9'900'000), 0, 0.1);
      EXPECT_NEAR(overload_s(14, 100'000), 9.9, 0.1) << "saturated: a short circuit";
      s.current_ua = measurement::no_reading;
      quantities.update(s, 100'000, q);
      EXPECT_EQ(at(q, mine), measurement::no_reading);
      EXPECT_NEAR(overload_s(1, 100'000), 9.9, 0.1) << "unchanged while the current is unknown";
      for (int k = 0; k < 100; ++k) overload_s(10, 60'000'000);
      EXPECT_EQ(at(q, mine), 2'000'000'000) << "saturates";
    }
  }
}

TEST(OverloadIntegral, ARestReducesItByExactlyItsTime) {
  PackQuantities<16> quantities(forklift_plan.limits);
  measurement::PackSample<16> s;
  Quantities q = unknown_quantities();
  s.current_ua = 12'000'000;
  quantities.update(s, 1'000'000, q);
  const std::int32_t before = at(q, Quantity::charge_overload_i2t_us);
  s.current_ua = 0;
  for (int k = 0; k < 10; ++k) quantities.update(s, 100'000, q);
  EXPECT_EQ(at(q, Quantity::charge_overload_i2t_us), before - 1'000'000);
}

}  // namespace
}  // namespace bms::protection
