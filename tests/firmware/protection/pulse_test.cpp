// Pulses of cells whose maker rates them for 10 s and 30 s: each lasts its time, what is above ends, and no pattern of
// pulses heats the cell more than its continuous current and one rating do.
#include <algorithm>
#include <cmath>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "plant/random.hpp"
#include "tests/firmware/protection/protection_bench.hpp"

namespace bms::protection {
namespace {

/// Ratings as multiples of the continuous current; 0: not stated.
struct Rated {
  double for_10s, for_30s;
};
constexpr Rated usual[] = {{3, 2}, {3, 0}, {0, 2}, {2.3, 2}, {4.5, 1.2}, {1.5, 1.25}, {4.4, 3.8}, {1.2, 0}, {0, 4.5}};

PackDesign pack_of(const Rated& rated, double capacity_ah = 100, double continuous_c = 1) {
  PackDesign d = forklift;
  d.capacity_ah = capacity_ah;
  d.limits.charge_current_max_a = d.limits.discharge_current_max_a = continuous_c * capacity_ah;
  d.current_range_a = 2'000;
  const double limit_a = continuous_c * capacity_ah;
  d.pulses.charge = d.pulses.discharge = {rated.for_10s * limit_a, rated.for_30s * limit_a};
  return d;
}
std::string name_of(const Rated& r) { return fmt::format("{:g} for 10 s, {:g} for 30 s", r.for_10s, r.for_30s); }

/// Seconds of a current until the first fault, and until a contact opens; negative: not within most_s.
struct Lasts {
  double until_fault_s = -1, until_open_s = -1;
};
Lasts lasts(const PackDesign& design, double current_a, double most_s) {
  const ProtectionPlan plan = protection_plan(design);
  ProtectionBench b(0, plan);
  b.drive_off();
  b.load_ua = static_cast<std::int32_t>(1e6 * current_a);
  Lasts found;
  for (int k = 1; 0.1 * k <= most_s && found.until_open_s < 0; ++k) {
    const Decision& d = b.step();
    if (d.faults != 0 && found.until_fault_s < 0) found.until_fault_s = 0.1 * k;
    if (!d.outputs.any_closed()) found.until_open_s = 0.1 * k;
  }
  return found;
}

TEST(Pulses, OfARatingLastTheirTimeWithoutAFaultAndThenEnd) {
  for (const Rated& rated : usual) {
    ASSERT_EQ(model::first_fault(pack_of(rated).pulses, pack_of(rated).limits).what, nullptr) << name_of(rated);
    for (const double sign : {-1.0, 1.0}) {
      for (const auto& [times, seconds] : {std::pair(rated.for_10s, 10.0), {rated.for_30s, 30.0}}) {
        if (times == 0) continue;
        const Lasts exact = lasts(pack_of(rated), sign * 100 * times, 120),
                    with_error = lasts(pack_of(rated), sign * 100 * times * 1.04, 120);
        EXPECT_GE(with_error.until_fault_s, seconds) << name_of(rated) << ", " << times << ", a sensor 4 % off";
        EXPECT_LT(exact.until_fault_s, 1.65 * seconds + 0.2) << name_of(rated) << ", " << times;
        EXPECT_GT(exact.until_open_s, exact.until_fault_s) << name_of(rated) << ", " << times;
      }
    }
  }
}

/// The bursts of a truck that knows its ratings: none for 30 s after one of them.
TEST(Pulses, InAnyOrderOpenNothingIfTheMeanSquareIsThatOfTheContinuousCurrent) {
  for (const Rated& rated : usual) {
    plant::Random random(17);
    const ProtectionPlan plan = protection_plan(pack_of(rated));
    ProtectionBench b(0, plan);
    b.drive_off();
    for (int pulse = 0; pulse < 40; ++pulse) {
      const bool short_one = rated.for_30s == 0 || (rated.for_10s != 0 && random.uniform() < 0.5);
      const double times = short_one ? rated.for_10s : rated.for_30s, on_s = short_one ? 10 : 30,
                   rest_s = (times * times - 1) * on_s + 1;
      b.load_ua = static_cast<std::int32_t>(-1e8 * times);
      for (int k = 0; k < 10 * on_s; ++k) ASSERT_EQ(b.step().faults, 0U) << name_of(rated) << " pulse " << pulse;
      b.load_ua = 0;
      for (int k = 0; k < 10 * rest_s; ++k) ASSERT_EQ(b.step().faults, 0U) << name_of(rated) << " pulse " << pulse;
    }
  }
}

TEST(Pulses, AboveTheLargestRatingOpenWithinSixSeconds) {
  for (const Rated& rated : usual) {
    const double top = std::max(rated.for_10s, rated.for_30s);
    for (const double continuous_c : {0.3, 1.0, 3.0}) {
      const PackDesign design = pack_of(rated, 100, continuous_c);
      for (const double times : {1.06 * top, 0.5 * (1.06 * top + 4.95), 4.9}) {
        if (times < 1.059 * top || times > 4.96) continue;
        const Lasts found = lasts(design, -100 * continuous_c * times, 10);
        EXPECT_GT(found.until_open_s, 0) << name_of(rated) << ", " << times << " times " << continuous_c << "C";
        EXPECT_LT(found.until_open_s, 6) << name_of(rated) << ", " << times << " times " << continuous_c << "C";
      }
    }
  }
}

/// From the definition, in double precision: of any pattern that no row forbids, the mean square of the current over
/// the time since a rest is at most that of 1.05 of the continuous current and one rating above it.
TEST(Pulses, OfRandomPatternsHeatNoMoreThanTheContinuousCurrentAndOneRating) {
  plant::Random random(2'911);
  int full = 0, patterns = 0;
  for (const Rated& rated : usual) {
    const PackLimits limits = pack_limits(pack_of(rated));
    const auto heat = [](double times, double seconds) { return (times * times - 1) * seconds; };
    const double one_rating = std::max(heat(rated.for_10s, 10), heat(rated.for_30s, 30));
    for (int pattern = 0; pattern < 60; ++pattern, ++patterns) {
      PackQuantities<16> quantities(limits);
      double above = 0, longest_above_30s = 0, above_30s = 0, longest_at_10s = 0, at_10s = 0;
      bool is_full = false;
      for (int phase = 0; phase < 40 && !is_full; ++phase) {
        const double times = 5 * random.uniform() * random.uniform(), seconds = 40 * random.uniform();
        for (int k = 0; k < 10 * seconds && !is_full; ++k) {
          Quantities q = unknown_quantities();
          measurement::PackSample<16> sample;
          sample.current_ua = static_cast<std::int32_t>(-1e8 * times);
          quantities.update(sample, 100'000, q);
          is_full = at(q, Quantity::discharge_overload_i2t_us) > full_overload_us;
          const double i = times / 1.05;
          above = std::max(0.0, above + 0.1 * (i * i - 1));
          above_30s = rated.for_30s != 0 && i > rated.for_30s ? above_30s + 0.1 : 0;
          longest_above_30s = std::max(longest_above_30s, above_30s);
          at_10s = rated.for_10s != 0 && times >= rated.for_10s ? at_10s + 0.1 : 0;
          longest_at_10s = std::max(longest_at_10s, at_10s);
        }
      }
      full += is_full ? 1 : 0;
      EXPECT_LE(above, 1.02 * one_rating + 3) << name_of(rated);
      EXPECT_LE(longest_above_30s, rated.for_10s != 0 ? 31 : 0.7) << name_of(rated);
      EXPECT_LE(longest_at_10s, 16.5) << name_of(rated);
    }
  }
  fmt::print("{} of {} patterns end at a rating\n", full, patterns);
  EXPECT_GT(full, patterns / 4);
}

/// The integral without ratings, as it always was.
TEST(Pulses, WithoutARatingTheOverloadIntegralIsUnchanged) {
  plant::Random random(5);
  const PackDesign design = pack_of({0, 0});
  const PackLimits limits = pack_limits(design);
  PackQuantities<16> quantities(limits);
  std::int64_t expected_us = 0;
  for (int k = 0; k < 20'000; ++k) {
    const auto step_us = static_cast<std::uint32_t>(50'000 + 100'000 * random.uniform());
    measurement::PackSample<16> sample;
    sample.current_ua = static_cast<std::int32_t>(-3e8 * random.uniform() * random.uniform());
    Quantities q = unknown_quantities();
    quantities.update(sample, step_us, q);
    const std::int64_t times_256 = std::min(-sample.current_ua / (105'000'000 / 256), 2'560);
    expected_us =
        std::clamp<std::int64_t>(expected_us + (((times_256 * times_256 - 65'536) * step_us) >> 16), 0, 2'000'000'000);
    ASSERT_EQ(at(q, Quantity::discharge_overload_i2t_us), expected_us);
  }
}

/// Arithmetic at the ends of all ranges, at compile time: a wrapped integral does not compile.
constexpr bool ends_are_held(double ratio_10s, double ratio_30s) {
  const PulsePlan plan = pulse_plan({ratio_10s, ratio_30s}, 1);
  PulseIntegral integral;
  for (int k = 0; k < 100; ++k) {
    if (integral.update(plan, pulse_detail::unlimited_256, 60'000'000) < full_overload_us) return false;
  }
  for (int k = 0; k < 100; ++k) {
    if (integral.update(plan, 0, 60'000'000) < 0) return false;
  }
  return integral.update(plan, 0, 60'000'000) == 0;
}
static_assert(ends_are_held(1.2, 0) && ends_are_held(0, 1.2) && ends_are_held(4.5, 0) && ends_are_held(0, 4.5));
static_assert(ends_are_held(1.38, 1.2) && ends_are_held(4.5, 1.2) && ends_are_held(4.5, 4.5 / 1.15));

TEST(Pulses, OfALimitThatAWorkshopLowersAreLoweredWithIt) {
  PackLimits limits = pack_limits(pack_of({3, 2}));
  limits.discharge_ua_256th /= 2;  // parameters/tightened_plan.hpp
  PackQuantities<16> quantities(limits);
  double until_full_s = -1;
  for (int k = 1; k < 400 && until_full_s < 0; ++k) {
    measurement::PackSample<16> sample;
    sample.current_ua = -150'000'000;
    Quantities q = unknown_quantities();
    quantities.update(sample, 100'000, q);
    if (at(q, Quantity::discharge_overload_i2t_us) > full_overload_us) until_full_s = 0.1 * k;
  }
  EXPECT_NEAR(until_full_s, 12, 0.4) << "three times 50 A";
}

}  // namespace
}  // namespace bms::protection
