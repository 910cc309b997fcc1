#include "estimator/soc_estimator.hpp"

#include <ceres/jet.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "tests/cells.hpp"
#include "tests/starting_point.hpp"

namespace bms::estimator {
namespace {

template <class S>
auto table9() {
  return tests::prepared<S>();
}

/// Samples of an hour of work at 1 Hz. The voltage is a coarse model on purpose (R0 only): these tests are about the
/// behaviour of the filter.
std::vector<measurement::Sample> work(std::size_t count) {
  std::vector<measurement::Sample> samples(count);
  std::mt19937 random(5);
  double soc = 0.8;
  for (std::size_t k = 0; k < count; ++k) {
    constexpr std::int32_t phases_ua[] = {-5'000'000, 1'000'000, -200'000};
    const std::int32_t current_ua = k < 60 ? 0 : phases_ua[(k / 40) % 3];
    soc += current_ua * 1e-6 / 3'600 / 6;
    const double voltage_v = 3.25 + 0.09 * soc + 0.015 * current_ua * 1e-6;
    samples[k] = {k * 1'000'000, current_ua,
                  static_cast<std::int32_t>(voltage_v * 1e6) + static_cast<std::int32_t>(random() % 2'000) - 1'000,
                  2'500};
  }
  return samples;
}

template <class S>
std::vector<Estimate<S>> run(const std::vector<measurement::Sample>& samples,
                             SocEstimator<S> estimator = SocEstimator<S>()) {
  const auto cell = table9<S>();
  std::vector<Estimate<S>> estimates;
  for (const measurement::Sample& s : samples) estimates.push_back(estimator.step(cell, s));
  return estimates;
}

void expect_finite(const Estimate<float>& e, const std::string& where) {
  EXPECT_TRUE(std::isfinite(e.soc) && std::isfinite(e.soc_sigma) && std::isfinite(e.v_rc_v) &&
              std::isfinite(e.voltage_predicted_v))
      << where;
  EXPECT_GT(e.soc_sigma, 0) << where;
}

TEST(SocEstimator, StateOfOneCellFitsIn24Bytes) { EXPECT_EQ(sizeof(CellState<float, model::OneRc>), 24U); }

TEST(SocEstimator, EveryScalarGivesTheSameEstimates) {
  const auto samples = work(1'000);
  // between two edges of the table: on an edge, the last bit decides which slope holds
  const measurement::StartingPoint start = starting_at(0.77, 0.005);
  const auto float32 = run<float>(samples, SocEstimator<float>(start));
  const auto float64 = run<double>(samples, SocEstimator<double>(start));
  const auto fixed = run<arithmetic::FixedPoint>(samples, SocEstimator<arithmetic::FixedPoint>(start));
  using Jet = ceres::Jet<double, 3>;
  const auto jets = run<Jet>(samples, SocEstimator<Jet>(start));
  for (std::size_t k = 0; k < samples.size(); ++k) {
    ASSERT_NEAR(float32[k].soc, float64[k].soc, 2e-5) << k;
    ASSERT_NEAR(arithmetic::as_double(fixed[k].soc), float64[k].soc, 1e-4)
        << k;  // a tenth of what is asked of fixed point in the end
    ASSERT_NEAR(arithmetic::as_double(fixed[k].soc_sigma), float64[k].soc_sigma, 1e-4) << k;
    ASSERT_NEAR(jets[k].soc.a, float64[k].soc, 1e-5)
        << k;  // Charge<Jet> does not cut its corrections to counts of 4e-9
    ASSERT_NEAR(jets[k].voltage_predicted_v.a, float64[k].voltage_predicted_v, 1e-5) << k;
  }
}

TEST(SocEstimator, FirstEstimateIsTheStartingPointWhereNoVoltageHelps) {
  const auto cell = table9<float>();
  SocEstimator<float> without_voltage(starting_at(0.65, 0.05));
  auto e = without_voltage.step(cell, {0, 0, measurement::no_reading, 2'500});
  EXPECT_NEAR(e.soc, 0.65, 1e-6);
  EXPECT_NEAR(e.soc_sigma, 0.05, 1e-6);
  SocEstimator<float> sure(starting_at(0.65, 0.005));
  e = sure.step(cell, {0, 0, 3'300'000, 2'500});
  EXPECT_NEAR(e.soc, 0.65, 1e-6);
  EXPECT_NEAR(e.soc_sigma, 0.005, 1e-6);
}

/// The bank of hypotheses has the chance that a start is entirely wrong, sigma has not.
TEST(SocEstimator, AStartThatTheVoltageAgreesWithIsAsSureAsItWasGiven) {
  const auto cell = table9<float>();
  for (const double sigma : {0.01, 0.02, 0.028}) {
    for (const double off : {-1.5, 0.0, 1.5}) {  // on the plateau: 8 mV in a quarter of the charge
      SocEstimator<float> estimator(starting_at(0.5 + off * sigma, sigma));
      const auto e = estimator.step(cell, {0, 0, 3'287'000, 2'500});
      EXPECT_NEAR(e.soc, 0.5 + off * sigma, 0.2 * sigma) << sigma;
      EXPECT_LT(e.soc_sigma, 1.1 * sigma) << off;
    }
  }
}

TEST(SocEstimator, AStartingPointBeyondTheEndsIsClampedToThem) {
  const std::vector<measurement::Sample> no_voltage = {{0, 0, measurement::no_reading, 2'500}};
  const auto first = [&](const measurement::StartingPoint& from) {
    return run<float>(no_voltage, SocEstimator<float>(from)).front();
  };
  EXPECT_EQ(first({2'000'000'000, 1}).soc, first({1'000'000'000, 1}).soc);
  EXPECT_EQ(first({-300'000'000, 1}).soc, first({0, 1}).soc);
  EXPECT_EQ(first({500'000'000, -20'000'000}).soc_sigma, first({500'000'000, 0}).soc_sigma);
}

TEST(SocEstimator, AWidePriorAndTheFirstVoltageAreCombined) {
  const auto cell = table9<float>();
  const auto started = [&](double soc, double sigma, std::int32_t voltage_uv) {
    return SocEstimator<float>(starting_at(soc, sigma)).step(cell, {0, 0, voltage_uv, 2'500});
  };
  // 3.23 V is 16 %: where the curve is steep the voltage decides
  auto e = started(0.4, 0.2, 3'230'000);
  EXPECT_NEAR(e.soc, 0.16, e.soc_sigma);
  EXPECT_LT(e.soc_sigma,
            0.04);  // R1 is 18 mohm at 16 %: 1.2 A before may have left 22 mV, over 0.39 V, but steep below
  // 3.283 V is anything from 37 to 53 %: there the belief does
  e = started(0.45, 0.03, 3'285'000);
  EXPECT_NEAR(e.soc, 0.45, 0.01);
  EXPECT_NEAR(e.soc_sigma, 0.03, 0.006);
  // a belief that the voltage flatly contradicts was wrong altogether
  e = started(0.98, 0.02, 3'230'000);
  EXPECT_NEAR(e.soc, 0.16, 0.03);
}

/// A wide start above the knee at 90 %, where the curve is 130 times as steep as below it.
TEST(SocEstimator, ACorrectionOverAKneeIsNotSurerThanTheFlatSideAllows) {
  const auto cell = table9<double>();
  for (const double truth : {0.55, 0.65, 0.75, 0.85}) {
    const auto at = model::look_up(cell, truth);
    SocEstimator<double> estimator(starting_at(0.93, 0.15));
    Estimate<double> e = estimator.step(cell, {0, 0, measurement::no_reading, 2'500});
    for (std::uint64_t s = 1; s <= 600; ++s)
      e = estimator.step(cell, {s * 1'000'000, 0, static_cast<std::int32_t>(1e6 * at.ocv_v), 2'500});
    EXPECT_LE(std::abs(e.soc - truth), 3 * e.soc_sigma) << truth;
  }
}

/// The start is 20 % with a small sigma, the truth is 98 %: the voltage stays 150 mV too high. The monitor
/// estimates the SOC again.
TEST(SocEstimator, AContradictedStartIsGivenUp) {
  const auto cell = table9<double>();
  const auto at = model::look_up(cell, 0.98);
  SocEstimator<double> estimator(starting_at(0.2, 0.002));
  estimator.step(cell, {0, 0, measurement::no_reading, 2'500});
  Estimate<double> e;
  std::uint32_t flags = 0;
  for (std::uint64_t s = 1; s <= 1'800; ++s) {
    e = estimator.step(cell, {s * 1'000'000, 0, static_cast<std::int32_t>(1e6 * at.ocv_v), 2'500});
    flags |= e.flags;
  }
  EXPECT_EQ(flags, voltage_rejected | soc_ambiguous | soc_contradicted);
  EXPECT_NEAR(e.soc, 0.98, 0.02);
  EXPECT_LE(std::abs(e.soc - 0.98), 2 * e.soc_sigma);
}

TEST(SocEstimator, OneOutlierIsFlaggedAndChangesNothing) {
  auto samples = work(1'000);
  const SocEstimator<float> estimator(starting_at(0.8, 0.005));
  const auto without = run<float>(samples, estimator);
  samples[500].voltage_uv += 300'000;
  const auto with = run<float>(samples, estimator);
  EXPECT_EQ(with[500].flags, voltage_rejected);
  EXPECT_EQ(with[501].flags, 0U);
  EXPECT_NEAR(with[501].soc, without[501].soc, 1e-4);
}

TEST(SocEstimator, SigmaGoesOnGrowingOverAGapOfHours) {
  const auto cell = table9<float>();
  double before = 0;
  for (const std::uint64_t hours : {1U, 3U, 10U, 1'000U}) {
    SocEstimator<float> estimator(starting_at(0.5, 0.005));
    estimator.step(cell, {0, 0, 3'285'000, 2'500});
    estimator.step(cell, {1'000'000, 0, 3'285'000, 2'500});
    const auto e =
        estimator.step(cell, {hours * 3'600'000'000, measurement::no_reading, measurement::no_reading, 2'500});
    EXPECT_GT(e.soc_sigma, before) << hours;
    before = e.soc_sigma;
    if (hours == 1'000) break;
    EXPECT_NEAR(e.soc_sigma, std::min(1.0, 1.2 * static_cast<double>(hours) / 6), 0.12) << hours;
  }
}

TEST(SocEstimator, AStartWithoutACurrentIsLessSureOfTheVoltage) {
  const auto cell = table9<float>();
  SocEstimator<float> with, without;
  const auto known = with.step(cell, {0, -3'000'000, 3'200'000, 2'500}),
             unknown = without.step(cell, {0, measurement::no_reading, 3'200'000, 2'500});
  EXPECT_GT(unknown.soc_sigma, 0.02);
  EXPECT_NEAR(unknown.soc, known.soc, 2.5 * (unknown.soc_sigma + known.soc_sigma));
}

TEST(SocEstimator, WaitsForAVoltageWhenNothingIsKnown) {
  const auto cell = table9<float>();
  SocEstimator<float> estimator;
  auto e = estimator.step(cell, {0, 0, measurement::no_reading, measurement::no_temperature});
  EXPECT_EQ(e.flags, not_started | voltage_missing);
  EXPECT_NEAR(e.soc_sigma, 1 / std::sqrt(12.0), 1e-3);
  e = estimator.step(cell, {1'000'000, 0, 3'400'000, measurement::no_temperature});
  EXPECT_EQ(e.flags, 0U);
  EXPECT_GT(e.soc, 0.9);
}

TEST(SocEstimator, PredictsThroughAMissingVoltageWhileSigmaGrows) {
  auto samples = work(1'200);
  for (std::size_t k = 600; k < 1'200; ++k) samples[k].voltage_uv = measurement::no_reading;
  const auto e = run<float>(samples);
  for (std::size_t k = 600; k < 1'200; ++k) {
    ASSERT_EQ(e[k].flags, voltage_missing);
    ASSERT_GT(e[k].soc_sigma, e[k - 1].soc_sigma) << k;
  }
  double charge_ah = 0;
  for (std::size_t k = 600; k < 1'200; ++k) charge_ah += samples[k].current_ua * 1e-6 / 3'600;
  EXPECT_NEAR(e[1'199].soc - e[599].soc, charge_ah / 6, 1e-6);
}

TEST(SocEstimator, GoesOnWithTheLastCurrentWhileItIsMissingAndSigmaGrowsFast) {
  auto samples = work(1'200);
  for (std::size_t k = 600; k < 1'200; ++k) {
    samples[k].current_ua = measurement::no_reading;
    samples[k].voltage_uv = measurement::no_reading;
  }
  const auto e = run<float>(samples);
  // ten minutes of an unknown 1.2 A (cell file), and of a current that may have ceased, of 6 Ah
  const double ceased_a = std::abs(1e-6 * samples[599].current_ua);
  EXPECT_GT(ceased_a, 0.1);
  EXPECT_NEAR(e[1'199].soc_sigma - e[599].soc_sigma, (1.2 + ceased_a) / 6 / 6, 0.003);
  EXPECT_NEAR(e[1'199].soc - e[599].soc, samples[599].current_ua * 1e-6 / 6 / 6, 1e-5);
}

TEST(SocEstimator, AGapIsFlaggedOnceAndMakesSigmaGrow) {
  auto samples = work(1'200);
  for (std::size_t k = 600; k < 1'200; ++k) samples[k].time_us += 600'000'000;
  samples[600].current_ua = 0;
  const auto e = run<float>(samples, SocEstimator<float>(starting_at(0.8, 0.005)));
  EXPECT_EQ(e[600].flags, time_gap);
  EXPECT_EQ(e[601].flags, 0U);
  EXPECT_EQ(e[599].flags, 0U);
  EXPECT_GT(e[600].soc_sigma, e[599].soc_sigma);
}

/// A recorder that sleeps for exactly a minute leaves as much unknown as one that sleeps for 60 and 61 s in turn.
TEST(SocEstimator, GapsOfEqualLengthAreGaps) {
  const auto sigma_after_gaps = [](std::uint64_t longer_us, int& gaps) {
    auto samples = work(630);
    std::uint64_t late_us = 0;
    for (std::size_t k = 600; k < samples.size(); ++k) {
      late_us += 59'000'000 + (k % 2) * longer_us;
      samples[k].time_us += late_us;
      samples[k].current_ua = 0;
      samples[k].voltage_uv = measurement::no_reading;
    }
    const auto e = run<float>(samples, SocEstimator<float>(starting_at(0.8, 0.005)));
    gaps = static_cast<int>(
        std::count_if(e.begin(), e.end(), [](const auto& estimate) { return (estimate.flags & time_gap) != 0; }));
    return static_cast<double>(e.back().soc_sigma);
  };
  int equal = 0, different = 0;
  const double equal_sigma = sigma_after_gaps(0, equal), different_sigma = sigma_after_gaps(1'000'000, different);
  EXPECT_GT(equal, 1);
  EXPECT_EQ(equal, different);
  EXPECT_NEAR(equal_sigma, different_sigma, 0.05 * different_sigma);
}

TEST(SocEstimator, IgnoresASampleThatIsNotLater) {
  const auto cell = table9<float>();
  SocEstimator<float> estimator;
  const auto samples = work(100);
  Estimate<float> last;
  for (const measurement::Sample& s : samples) last = estimator.step(cell, s);
  auto again = samples.back();
  again.voltage_uv = 2'500'000;
  const auto e = estimator.step(cell, again);
  EXPECT_EQ(e.flags, time_not_increasing);
  EXPECT_EQ(e.soc, last.soc);
  again.time_us = 5;
  EXPECT_EQ(estimator.step(cell, again).flags, time_not_increasing);
}

TEST(SocEstimator, AStuckVoltageDoesNotDragTheEstimateAlong) {
  auto samples = work(3'600);
  for (std::size_t k = 600; k < samples.size(); ++k) samples[k].voltage_uv = samples[599].voltage_uv;
  const auto stuck = run<float>(samples, SocEstimator<float>(starting_at(0.8, 0.02)));
  std::size_t flagged = 0;
  for (const auto& e : stuck) flagged += (e.flags & voltage_stuck) != 0 ? 1 : 0;
  EXPECT_GT(flagged, 1'000U);
  double charge_ah = 0;
  for (std::size_t k = 600; k < samples.size(); ++k) charge_ah += samples[k].current_ua * 1e-6 / 3'600;
  EXPECT_NEAR(stuck.back().soc - stuck[599].soc, charge_ah / 6, 0.005);
}

TEST(SocEstimator, NothingThatComesInMakesTheStateNotANumber) {
  const auto cell = table9<float>();
  std::mt19937_64 random(11);
  for (int run = 0; run < 50; ++run) {
    SocEstimator<float> estimator;
    std::uint64_t time_us = 0;
    for (int k = 0; k < 2'000; ++k) {
      time_us += random() % 5 == 0 ? random() >> (random() % 64) : random() % 2'000'000;
      const auto anything = [&](std::int32_t usual) {
        if (random() % 3 == 0) return static_cast<std::int32_t>(random());
        return random() % 7 == 0 ? measurement::no_reading : usual;
      };
      const measurement::Sample sample{time_us, anything(-3'000'000), anything(3'280'000),
                                       static_cast<std::int16_t>(random())};
      const auto e = estimator.step(cell, sample);
      expect_finite(e, "run " + std::to_string(run) + " step " + std::to_string(k));
      ASSERT_GE(e.soc, -0.26F);
      ASSERT_LE(e.soc, 1.26F);
      if (HasFailure()) return;
    }
  }
}

TEST(SocEstimator, TheSameSamplesGiveTheSameBits) {
  const auto samples = work(2'000);
  const auto a = run<float>(samples), b = run<float>(samples);
  for (std::size_t k = 0; k < samples.size(); ++k) ASSERT_EQ(words(a[k]), words(b[k]));
}

TEST(SocEstimator, AFirmwareTableOfExactSizeGivesTheSameBitsAsTheHostsLargeOne) {
  constexpr const auto& parameters = tests::table9;
  ASSERT_EQ(model::interval_count(parameters), 12U);
  const auto exact = model::prepare<float, 12>(parameters);
  const auto large = table9<float>();
  SocEstimator<float> a, b;
  for (const measurement::Sample& s : work(2'000)) ASSERT_EQ(words(a.step(exact, s)), words(b.step(large, s)));
}

}  // namespace
}  // namespace bms::estimator
