// Overloads from 1.2 to 20 times the continuous limit on packs of 40, 100 and 200 Ah, with current sensors whose
// reading stays at the end of their range: cause and time until the contactors are open.
#include <cmath>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "tests/firmware/protection/protection_bench.hpp"

namespace bms::protection {
namespace {

/// A pack whose continuous limit is 1C, with a sensor of the given range.
PackDesign pack_of(double capacity_ah, double range_a) {
  PackDesign d = forklift;
  d.capacity_ah = capacity_ah;
  d.limits.charge_current_max_a = d.limits.discharge_current_max_a = capacity_ah;
  d.current_range_a = range_a;
  return d;
}

struct Opening {
  double after_s = -1;
  bool current_missing = false;
  std::uint8_t cause = no_fault;
};

/// times: of the continuous limit, < 0 discharges. The reading ends at the range.
Opening open_under(const PackDesign& design, double times, double most_s) {
  const ProtectionPlan plan = protection_plan(design);
  ProtectionBench b(0, plan);
  b.drive_off();
  const double load_a = times * design.capacity_ah,
               reading_a = std::clamp(load_a, -design.current_range_a, design.current_range_a);
  b.load_ua = static_cast<std::int32_t>(1e6 * reading_a);
  Opening opening;
  for (int k = 1; 0.1 * k <= most_s && opening.after_s < 0; ++k) {
    const Decision& d = b.step();
    opening.current_missing = opening.current_missing || (d.faults & bit(Fault::current_missing)) != 0;
    if (!d.outputs.any_closed()) opening = {0.1 * k, opening.current_missing, d.first.fault};
  }
  return opening;
}

/// By hand: a reading above five times the limit or 0.9 of the range opens with its sample. Below, the integral
/// reaches 30 s after 30 s / (i^2 - 1), with i the reading over 1.05 of the limit. From this time on the current is
/// forbidden: 5 s of grace follow, or less until 10.8 s of 1C have flowed.
TEST(Overload, OfAnySizeOpensInTheTimeOfTheTableWithItsCauseAndIsNeverMissing) {
  fmt::print("pack, range of the sensor: seconds until open (* short circuit)\n");
  for (const double range_a : {327.67, 2'000.0}) {
    for (const double capacity_ah : {40.0, 100.0, 200.0}) {
      const PackDesign design = pack_of(capacity_ah, range_a);
      if (!current_sensor_suffices(design)) {
        EXPECT_EQ(capacity_ah, 200) << "1.5 times 200 A are above 0.9 of 327 A: no firmware is built";
        EXPECT_LT(range_a, 334);
        continue;
      }
      std::string line = fmt::format("{:3.0f} Ah, {:4.0f} A:", capacity_ah, range_a);
      for (const double times : {1.2, 1.5, 2.0, 3.0, 4.0, 4.9, 5.1, 8.0, 10.0, 20.0}) {
        for (const int sign : {-1, 1}) {
          const double read_a = std::min(times * capacity_ah, range_a), i = read_a / (1.05 * capacity_ah);
          const bool short_circuit = read_a > std::min(5 * capacity_ah, 0.9 * range_a);
          // the integral counts in 256ths of i, and time in samples
          const double integral_s = 30 / (i * i - 1), error_s = 0.1 + integral_s * 2 * i * i / (i * i - 1) / (256 * i);
          const Opening o = open_under(design, sign * times, integral_s + error_s + 6);
          const Fault overcurrent = sign < 0 ? Fault::discharge_overcurrent : Fault::charge_overcurrent;
          EXPECT_EQ(o.cause, static_cast<std::uint8_t>(short_circuit ? Fault::short_circuit : overcurrent))
              << line << ' ' << times;
          EXPECT_FALSE(o.current_missing) << line << ' ' << times;
          if (short_circuit) {
            EXPECT_NEAR(o.after_s, 0.1, 1e-9) << line << ' ' << times;
          } else {
            EXPECT_NEAR(o.after_s, integral_s + std::min(5.0, 10.8 / times) + 0.1, error_s + 0.1)
                << line << ' ' << times;
          }
          if (sign < 0) line += fmt::format(" {:g}x {:.1f}{}", times, o.after_s, short_circuit ? "*" : "");
        }
      }
      fmt::print("{}\n", line);
    }
  }
}

/// Cells for energy have limits far below 1C. The charge after the overload integral has forbidden them counts in
/// multiples of the limit, so they do not flow for the grace time.
TEST(Overload, OfALowLimitOpensAsSoonAsThatOfALimitOf1C) {
  for (const double c_rate : {0.1, 0.2, 0.3, 0.5, 1.0}) {
    PackDesign design = pack_of(200, 2'000);
    design.limits.charge_current_max_a = design.limits.discharge_current_max_a = 200 * c_rate;
    for (const int sign : {-1, 1}) {
      const Opening o = open_under(design, sign * 4.9 * c_rate, 10);
      EXPECT_GT(o.after_s, 0);
      EXPECT_LE(o.after_s, 4.0) << 4.9 << " times a limit of " << c_rate << "C";
      if (sign < 0) fmt::print("4.9 times a limit of {:g}C: {:.1f} s\n", c_rate, o.after_s);
    }
  }
}

TEST(Overload, BeyondTheRangeOfTheSensorIsAShortCircuit) {
  for (const double range_a : {20.0, 41.0, 327.67, 2'000.0, 2'147.48}) {
    for (const double share : {0.05, 0.2, 0.5, 0.59}) {
      const PackDesign design = pack_of(share * range_a, range_a);
      ASSERT_TRUE(current_sensor_suffices(design));
      const Rule rule = protection_plan(design).rule(Fault::short_circuit);
      EXPECT_LE(rule.threshold, 0.9e6 * range_a) << "a gain error of 10 % does not hide it";
      EXPECT_GE(rule.threshold, 1.5e6 * share * range_a * 0.999'999);
    }
  }
}

}  // namespace
}  // namespace bms::protection
