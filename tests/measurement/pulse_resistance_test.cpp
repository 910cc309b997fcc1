// Pulse resistances of a recording whose voltage is computed here: R0 and one RC pair at a constant OCV.
#include "measurement/pulse_resistance.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace bms::measurement {
namespace {

constexpr double capacity_ah = 10, r0_ohm = 0.002, r1_ohm = 0.001, tau_s = 12, ocv_v = 3.3;

double expected_ohm(double after_s) { return r0_ohm + r1_ohm * (1 - std::exp(-after_s / tau_s)); }

/// A rest of 60 s, a pulse, a rest of 40 s; rows every step_s. begin_s: of the pulse.
Recording one_pulse(double current_a, double begin_s, double duration_s, double step_s) {
  Recording r;
  std::vector<double> time_s, i, v;
  for (double t = 0; t <= begin_s + duration_s + 40 + 1e-9; t += step_s) {
    const double on_s = std::max(0.0, std::min(t, begin_s + duration_s) - std::max(t - step_s, begin_s));
    const double since_s = t - begin_s;
    const double drop_v = since_s <= 0 || since_s > duration_s + 1e-9 ? 0 : current_a * expected_ohm(since_s);
    time_s.push_back(t);
    i.push_back(current_a * on_s / step_s);
    v.push_back(ocv_v + drop_v);
  }
  r.time_s = time_s;
  r.current_a = i;
  r.voltage_v = v;
  return r;
}

TEST(PulseResistance, IsVoltageStepOverCurrentStepAtItsTimes) {
  for (const double current_a : {-20.0, 15.0}) {
    const auto found = pulses_of(one_pulse(current_a, 60, 30, 1), capacity_ah, {0, 0.8});
    ASSERT_EQ(found.size(), 1U);
    const Pulse& p = found.front();
    EXPECT_EQ(p.charges(), current_a > 0);
    EXPECT_NEAR(p.current_a, current_a, 1e-9);
    EXPECT_NEAR(p.duration_s, 30, 1e-9);
    EXPECT_NEAR(p.start_voltage_v, ocv_v, 1e-12);
    EXPECT_NEAR(p.soc, 0.8, 1e-12);
    EXPECT_TRUE(std::isnan(p.temperature_c));
    ASSERT_EQ(p.at.size(), 3U);  // 30 s is its end
    for (const double after_s : {1.0, 10.0, 30.0}) {
      ASSERT_NE(p.after(after_s), nullptr);
      EXPECT_NEAR(p.after(after_s)->resistance_ohm, expected_ohm(after_s), 1e-9) << after_s;
    }
  }
}

/// Row k has the mean current of its interval: a first row with 30 % of the current begins 70 % into it.
TEST(PulseResistance, BeginsInsideAnInterval) {
  const auto found = pulses_of(one_pulse(-20, 60.7, 29.3, 1), capacity_ah, {0, 0.8});
  ASSERT_EQ(found.size(), 1U);
  EXPECT_NEAR(found.front().begin_s, 60.7, 1e-6);
  ASSERT_NE(found.front().after(10), nullptr);
  EXPECT_NEAR(found.front().after(10)->resistance_ohm, expected_ohm(10), 5e-6);
}

TEST(PulseResistance, OfAShortPulseEndsWithThePulse) {
  const auto found = pulses_of(one_pulse(20, 60, 18, 2), capacity_ah, {0, 0.5});
  ASSERT_EQ(found.size(), 1U);
  const Pulse& p = found.front();
  EXPECT_EQ(p.after(1), nullptr) << "the first reading is after 2 s";
  EXPECT_NE(p.after(10), nullptr);
  EXPECT_EQ(p.after(30), nullptr);
  EXPECT_NEAR(p.at.back().after_s, 18, 1e-9);
  EXPECT_NEAR(p.at.back().resistance_ohm, expected_ohm(18), 1e-9);
}

TEST(PulseResistance, NeedsARestAndAConstantCurrent) {
  Recording r = one_pulse(-20, 60, 30, 1);
  for (std::size_t k = 50; k < 58; ++k) r.current_a.edit()[k] = -5;  // 3 s of rest before the pulse
  EXPECT_EQ(pulses_of(r, capacity_ah, {0, 0.8}).size(), 1U) << "the step of 5 A is the only pulse after a rest";
  Recording ramp = one_pulse(-20, 60, 30, 1);
  for (std::size_t k = 61; k <= 90; ++k) ramp.current_a.edit()[k] = -static_cast<double>(k - 60);
  const auto of_ramp = pulses_of(ramp, capacity_ah, {0, 0.8});
  for (const Pulse& p : of_ramp) EXPECT_EQ(p.after(10), nullptr);
}

TEST(PulseResistance, CountsTheStateOfChargeFromWhereItIsKnown) {
  Recording r = one_pulse(-20, 60, 30, 1);
  const std::size_t rows = r.rows();
  Recording two = r;
  for (std::size_t k = 0; k < rows; ++k) {
    two.time_s.edit().push_back(r.time_s[k] + r.time_s.back() + 1);
    two.current_a.edit().push_back(r.current_a[k]);
    two.voltage_v.edit().push_back(r.voltage_v[k]);
  }
  const double per_pulse = 20.0 * 30 / 3'600 / capacity_ah;
  const auto found = pulses_of(two, capacity_ah, {100, 0.4});  // after the first pulse
  ASSERT_EQ(found.size(), 2U);
  EXPECT_NEAR(found[0].soc, 0.4 + per_pulse, 1e-9);
  EXPECT_NEAR(found[1].soc, 0.4, 1e-9);
  two.soc_ref = std::vector<double>(two.rows(), 0.6);
  EXPECT_EQ(pulses_of(two, capacity_ah, {100, 0.4})[0].soc, 0.6);
}

}  // namespace
}  // namespace bms::measurement
