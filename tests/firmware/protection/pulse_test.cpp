// Pulses that the maker of a cell rates for 10 s and 30 s. How long each may last is calculated here from the table of
// the maker: up to the rating for 30 s 30 s, up to that for 10 s 10 s, above both one second.
#include <algorithm>
#include <cmath>
#include <string>
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
constexpr Rated ratings[] = {{3, 2},   {3, 0},     {0, 2}, {2.3, 2}, {4.5, 1.2}, {1.5, 1.25},
                             {4.4, 3}, {1.004, 0}, {1, 1}, {0, 4.5}, {4, 4},     {12, 7}};

constexpr double from_c = 10;

PackDesign pack_of(const Rated& rated, double limit_a = 100, double capacity_ah = 100) {
  PackDesign d = forklift;
  d.capacity_ah = capacity_ah;
  d.limits.charge_current_max_a = d.limits.discharge_current_max_a = limit_a;
  d.current_range_a = 2'000;
  d.pulses.temperature_min_c = from_c;
  d.pulses.charge = d.pulses.discharge = {rated.for_10s * limit_a, rated.for_30s * limit_a};
  return d;
}
std::string name_of(const Rated& r) { return fmt::format("{:g} for 10 s, {:g} for 30 s", r.for_10s, r.for_30s); }

/// Seconds of a current until its direction is forbidden, and until a contact opens; most_s: not until then.
struct Lasts {
  double until_fault_s, until_open_s;
};
Lasts lasts(const PackDesign& design, double current_a, double most_s, double temperature_c = 25,
            std::int32_t model_ua = measurement::no_reading) {
  const ProtectionPlan plan = protection_plan(design);
  ProtectionBench b(0, plan);
  b.estimate.model_charge_ua = b.estimate.model_discharge_ua = model_ua;
  b.drive_off();
  b.change = [&](auto& s) {
    for (std::size_t k = 0; k < 4; ++k)
      s.temperature_cdegc[k] = static_cast<std::int16_t>(std::lround(100 * temperature_c) + ((b.count + k) % 3 == 0));
  };
  b.run(150);  // allowed currents move slowly
  b.load_ua = static_cast<std::int32_t>(1e6 * current_a);
  Lasts found{most_s, most_s};
  constexpr FaultSet forbids = bit(Fault::charge_overcurrent) | bit(Fault::discharge_overcurrent) |
                               bit(Fault::charge_limit_exceeded) | bit(Fault::discharge_limit_exceeded);
  for (int k = 1; 0.1 * k < most_s && found.until_open_s == most_s; ++k) {
    const Decision& d = b.step();
    if ((d.faults & forbids) != 0 && found.until_fault_s == most_s) found.until_fault_s = 0.1 * k;
    if (!d.outputs.any_closed()) found.until_open_s = 0.1 * k;
  }
  return found;
}

TEST(Pulses, OfARatingLastTheirTimeAndNoLonger) {
  int cases = 0;
  for (const Rated& rated : ratings) {
    for (const double sign : {-1.0, 1.0}) {
      for (const auto& [times, seconds] : {std::pair(rated.for_10s, 10.0), {rated.for_30s, 30.0}}) {
        if (times <= 1.06 || times * 1.04 > 5) continue;
        const double lasts_s = seconds == 10 && rated.for_30s == rated.for_10s ? 30 : seconds;
        for (const double sensor : {1.0, 1.04}) {
          const Lasts found = lasts(pack_of(rated), sign * 100 * times * sensor, 60);
          EXPECT_GE(found.until_fault_s, lasts_s) << name_of(rated) << ", " << times;
          EXPECT_LE(found.until_fault_s, 1.03 * lasts_s + 0.2) << name_of(rated) << ", " << times;
          ++cases;
        }
      }
    }
  }
  EXPECT_EQ(cases, 60);
}

TEST(Pulses, AboveTheLargestRatingAreForbiddenWithinASecondAndOpenWithinSix) {
  int cases = 0, fastest = 0;
  for (const Rated& rated : ratings) {
    const double top = std::max(rated.for_10s, rated.for_30s);
    for (const double c_rate : {0.2, 1.0, 3.0}) {
      for (const double times : {1.07 * top, 0.5 * (1.07 * top + 4.9), 4.9}) {
        if (times < 1.06 * top || times > 4.96) continue;
        const Lasts found = lasts(pack_of(rated, 100 * c_rate), -100 * c_rate * times, 10);
        EXPECT_LT(found.until_fault_s, 1.15) << name_of(rated) << ", " << times << " of " << c_rate << "C";
        EXPECT_LT(found.until_open_s, 6.3) << name_of(rated) << ", " << times << " of " << c_rate << "C";
        if (times == 4.9) {
          EXPECT_LT(found.until_open_s, 3.5) << name_of(rated) << " of " << c_rate << "C";
          ++fastest;
        }
        ++cases;
      }
    }
  }
  EXPECT_EQ(cases, 99);
  EXPECT_EQ(fastest, 33);
}

/// Seconds that a direction stays forbidden if the truck is at zero 1 s after it is asked.
double forbidden_s(const PackDesign& design, double current_a) {
  const ProtectionPlan plan = protection_plan(design);
  ProtectionBench b(0, plan);
  b.drive_off();
  b.run(150);
  b.load_ua = static_cast<std::int32_t>(1e6 * current_a);
  int asked = 0, ended = 0;
  for (int k = 1; k < 30'000 && ended == 0; ++k) {
    const bool forbidden = (b.step().faults & bit(Fault::discharge_overcurrent)) != 0;
    if (forbidden && asked == 0) asked = k;
    if (asked != 0 && k >= asked + 10) b.load_ua = 0;
    if (asked != 0 && !forbidden) ended = k;
  }
  return ended == 0 ? -1 : 0.1 * (ended - asked);
}

/// 30 s of recovery time of the row, 15 s of the integral at rest, 1 s of reaction: a truck is not held in an aisle.
TEST(Pulses, AboveTheLargestRatingDoNotHoldATruckThatReactsWithinASecond) {
  int cases = 0;
  for (const Rated& rated :
       {Rated{4.5, 1.2}, Rated{1.06, 0}, Rated{1.1, 1.05}, Rated{3, 2}, Rated{1, 1}, Rated{0, 2}}) {
    for (const double times : {2.2, 3.3, 4.8}) {
      if (times < 1.06 * std::max(rated.for_10s, rated.for_30s)) continue;
      const double held_s = forbidden_s(pack_of(rated), -100 * times),
                   plain_s = forbidden_s(pack_of({0, 0}), -100 * times);
      EXPECT_GE(held_s, 30) << name_of(rated) << ", " << times;
      EXPECT_LE(held_s, std::max(plain_s, 47.0)) << name_of(rated) << ", " << times;
      ++cases;
    }
  }
  EXPECT_EQ(cases, 1 + 3 + 3 + 2 + 3 + 3);
}

/// One sample of noise is not a pulse: 10 of them in a row act within a second.
TEST(Pulses, OfOneSampleAboveARatingCountAsThreeSeconds) {
  for (const Rated& rated : {Rated{1.06, 0}, Rated{1.1, 1.05}, Rated{1.004, 0}, Rated{1.5, 1.25}, Rated{1, 1}}) {
    for (const double times : {1.1, 2.0, 3.0, 5.0}) {
      PackQuantities<16> quantities(pack_limits(pack_of(rated)));
      measurement::PackSample<16> s;
      s.current_ua = static_cast<std::int32_t>(-105'000'000 * times);
      s.temperature_cdegc.fill(2'500);
      Quantities q = unknown_quantities();
      quantities.update(s, 100'000, q);
      EXPECT_LE(at(q, Quantity::discharge_overload_i2t_us), 3'000'001) << name_of(rated) << ", " << times;
    }
  }
}

/// Cycles of a load and a rest, repeated for hours, as the largest integral. Currents as multiples of 100 A.
struct Cycle {
  double times, for_s, rest_times, rest_s;
};
double largest_integral_s(const Rated& rated, const std::vector<Cycle>& cycles, double temperature_c = 25) {
  PackQuantities<16> quantities(pack_limits(pack_of(rated)));
  measurement::PackSample<16> s;
  s.temperature_cdegc.fill(static_cast<std::int16_t>(100 * temperature_c));
  Quantities q = unknown_quantities();
  double largest_s = 0;
  const auto flows = [&](double times, double seconds) {
    s.current_ua = static_cast<std::int32_t>(-1e8 * times);
    for (int k = 0; k < std::lround(10 * seconds); ++k) {
      quantities.update(s, 100'000, q);
      largest_s = std::max(largest_s, 1e-6 * at(q, Quantity::discharge_overload_i2t_us));
    }
  };
  for (const Cycle& c : cycles) {
    flows(c.times, c.for_s);
    flows(c.rest_times, c.rest_s);
  }
  return largest_s;
}

TEST(Pulses, OfAShiftWithARootMeanSquareBelowTheLimitAreNeverForbidden) {
  EXPECT_LT(largest_integral_s({4.5, 0}, std::vector<Cycle>(120, {1.3, 20, 0.5, 40})), 30) << "0.85 of the limit";
  EXPECT_LT(largest_integral_s({3, 2}, std::vector<Cycle>(120, {1.5, 10, 0.5, 30})), 30) << "0.87 of the limit";
  plant::Random random(7);
  int shifts = 0;
  for (const Rated& rated : {Rated{3, 2}, Rated{4.5, 0}, Rated{4.5, 1.2}, Rated{1.5, 1.25}, Rated{2.3, 2}, Rated{0, 2},
                             Rated{1.2, 0}, Rated{4.4, 3}, Rated{0, 4.5}, Rated{1.3, 1.15}}) {
    const double top = std::max(rated.for_10s, rated.for_30s);
    for (const double temperature_c : {from_c + 15, from_c - 1}) {
      for (int shift = 0; shift < 10; ++shift) {
        std::vector<Cycle> cycles;
        for (int k = 0; k < 60; ++k) {
          const double times = 1.06 + (top - 1.06) * random.uniform(), of_l = times / 1.05, heat = of_l * of_l - 1;
          const double rated_s = times <= rated.for_30s ? 30 : 10,
                       most_s = temperature_c < from_c ? std::min(rated_s, 30 / heat) : rated_s;
          const double for_s = 0.1 * std::floor(9.5 * most_s * random.uniform()), rest_times = 0.9 * random.uniform();
          const double rest = rest_times / 1.05;
          cycles.push_back({times, for_s, rest_times, 0.2 + 1.03 * heat * for_s / (1 - rest * rest)});
        }
        EXPECT_LT(largest_integral_s(rated, cycles, temperature_c), 30) << name_of(rated) << " at " << temperature_c;
        ++shifts;
      }
    }
  }
  EXPECT_EQ(shifts, 10 * 2 * 10);
}

/// The model computes in 24 bits, so its limit is some microamperes below that of the file for many cells.
TEST(Pulses, AreNotDeratedByALimitOfTheModelThatIsRounded) {
  plant::Random random(11);
  int below = 0;
  for (int k = 0; k < 60; ++k) {
    const double limit_a = 5 + 395 * random.uniform();
    const std::int32_t model_ua = static_cast<std::int32_t>(static_cast<float>(limit_a) * 1e6F + 0.5F);
    below += model_ua < in_micro(limit_a) ? 1 : 0;
    const Lasts found = lasts(pack_of({3, 2}, limit_a, limit_a), -2 * limit_a, 40, 25, model_ua);
    EXPECT_GE(found.until_fault_s, 30) << limit_a << " A, the model's " << model_ua << " uA";
  }
  EXPECT_GT(below, 10);
  const Lasts derated = lasts(pack_of({3, 2}), -200, 40, 25, 99'000'000);
  EXPECT_LT(derated.until_fault_s, 5) << "1 % below is derated";
}

TEST(Pulses, InTheColdLastNoLongerThanWithoutRatings) {
  for (const Rated& rated : ratings) {
    for (const double times : {1.3, 1.9, 2.8, 4.3}) {
      if (times > 1.05 * std::max(rated.for_10s, rated.for_30s)) continue;
      const Lasts cold = lasts(pack_of(rated), -100 * times, 60, from_c - 1),
                  none = lasts(pack_of({0, 0}), -100 * times, 60);
      EXPECT_LE(cold.until_fault_s, none.until_fault_s) << name_of(rated) << ", " << times;
      EXPECT_LE(cold.until_open_s, none.until_open_s) << name_of(rated) << ", " << times;
    }
  }
  EXPECT_GE(lasts(pack_of({3, 2}), -200, 60, from_c + 1).until_fault_s, 30);
  EXPECT_LT(lasts(pack_of({3, 2}), -200, 60, from_c - 1).until_fault_s, 12);
}

TEST(Pulses, AreNotRatedWithoutATemperature) {
  PackQuantities<16> quantities(pack_limits(pack_of({3, 2})));
  measurement::PackSample<16> s;
  s.current_ua = -200'000'000;
  Quantities q = unknown_quantities();
  quantities.update(s, 1'000'000, q);
  EXPECT_NEAR(at(q, Quantity::discharge_overload_i2t_us), 2'628'000, 20'000);
}

/// Currents that are far above a derated limit, of packs whose limit is less than 1C, too.
TEST(Pulses, OfADeratedLimitLastNoLongerThanWithoutRatings) {
  int cases = 0;
  for (const Rated& rated : {Rated{3, 2}, Rated{4.5, 4.5}, Rated{4.5, 1.2}}) {
    for (const double c_rate : {0.3, 1.0, 3.0}) {
      PackDesign with = pack_of(rated, 100 * c_rate), without = pack_of({0, 0}, 100 * c_rate);
      with.pulses.temperature_min_c = with.limits.temperature_min_c;
      for (const double sign : {-1.0, 1.0}) {
        for (const double temperature_c : {-15.0, -6.0, 2.0, 5.0, 9.5, 40.5, 44.0, 51.0, 58.0}) {
          const bool derated =
              sign > 0 ? temperature_c > 0 && temperature_c < 45 : temperature_c < 0 || temperature_c > 50;
          if (!derated) continue;
          for (const double times : {1.2, 2.0, 3.0, 4.4}) {
            const double a = sign * 100 * c_rate * times;
            const Lasts rates = lasts(with, a, 60, temperature_c), plain = lasts(without, a, 60, temperature_c);
            EXPECT_LT(plain.until_open_s, 60)
                << name_of(rated) << ' ' << c_rate << "C " << temperature_c << ' ' << times;
            EXPECT_LE(rates.until_fault_s, plain.until_fault_s)
                << name_of(rated) << ' ' << c_rate << "C " << temperature_c;
            EXPECT_LE(rates.until_open_s, plain.until_open_s)
                << name_of(rated) << ' ' << c_rate << "C " << temperature_c;
            ++cases;
          }
        }
      }
    }
  }
  EXPECT_EQ(cases, 3 * 3 * 4 * 9);
}

/// From the definition, in double precision: the integral over its recovery is never less than the heat of the current,
/// whatever flows, and whether or not it is forbidden. So no pattern heats more than L and one rating do.
TEST(Pulses, OfAnyPatternHeatNoMoreThanTheContinuousCurrentAndOneRating) {
  plant::Random random(2'911);
  double fullest_s = 0;
  for (const Rated& rated : ratings) {
    const PackDesign design = pack_of(rated);
    const OverloadPlan plan = pack_limits(design).discharge_overload;
    double one_rating_s = 30;
    for (const auto& [times, seconds] : {std::pair(rated.for_10s, 10.0), {rated.for_30s, 30.0}})
      one_rating_s = std::max(one_rating_s, (times * times - 1) * seconds);
    EXPECT_LE(30 / (plan.recovery_32768ths / 32'768.0), 1.03 * one_rating_s + 4) << name_of(rated);
    for (int pattern = 0; pattern < 20; ++pattern) {
      PackQuantities<16> quantities(pack_limits(design));
      double heat_s = 0, times = 0, until_s = 0;
      for (int k = 0; k < 6'000; ++k) {
        if (0.1 * k >= until_s) {
          times = random.uniform() < 0.5 ? 1.2 * random.uniform() : 5 * random.uniform();
          until_s = 0.1 * k + (random.uniform() < 0.7 ? 3 : 40) * random.uniform();
        }
        measurement::PackSample<16> s;
        s.current_ua = static_cast<std::int32_t>(-105'000'000 * times);
        s.temperature_cdegc.fill(k % 700 < 500 ? 2'500 : 500);
        Quantities q = unknown_quantities();
        quantities.update(s, 100'000, q);
        const double seen = std::floor(256 * times) / 256;
        heat_s = std::max(0.0, heat_s + 0.1 * (seen * seen - 1));
        const double h_s = 1e-6 * at(q, Quantity::discharge_overload_i2t_us);
        fullest_s = std::max(fullest_s, h_s);
        if (h_s >= 2'000) break;  // a minute of a current that opens within six seconds
        ASSERT_GE(32'768.0 / plan.recovery_32768ths * h_s, 0.98 * heat_s - 1) << name_of(rated) << " at " << 0.1 * k;
      }
    }
  }
  EXPECT_GT(fullest_s, 300) << "beyond full";
}

TEST(Pulses, WithoutARatingTheOverloadIntegralIsThatOfTheContinuousLimit) {
  plant::Random random(5);
  PackQuantities<16> quantities(pack_limits(pack_of({0, 0})));
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

/// A rate that is not monotone would let a larger current flow longer.
TEST(Pulses, OfALargerCurrentNeverLastLonger) {
  for (const Rated& rated : ratings) {
    const OverloadPlan plan = pack_limits(pack_of(rated)).charge_overload;
    for (const bool holds : {false, true}) {
      for (std::int32_t t = 0; t < most_times_256; ++t)
        ASSERT_LE(overload_rates(plan, t, holds).largest(), overload_rates(plan, t + 1, holds).largest())
            << name_of(rated) << ' ' << t;
    }
  }
}

TEST(Pulses, OfALimitThatAWorkshopLowersAreLoweredWithIt) {
  PackLimits limits = pack_limits(pack_of({3, 2}));
  limits.discharge_ua_256th /= 2;  // parameters/tightened_plan.hpp
  PackQuantities<16> quantities(limits);
  double until_full_s = -1;
  for (int k = 1; k < 400 && until_full_s < 0; ++k) {
    measurement::PackSample<16> s;
    s.current_ua = -150'000'000;
    s.temperature_cdegc.fill(2'500);
    Quantities q = unknown_quantities();
    quantities.update(s, 100'000, q);
    if (at(q, Quantity::discharge_overload_i2t_us) >= full_overload_us) until_full_s = 0.1 * k;
  }
  EXPECT_NEAR(until_full_s, 10, 0.15) << "three times 50 A";
}

}  // namespace
}  // namespace bms::protection
