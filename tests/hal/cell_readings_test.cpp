#include "hal/adc/cell_readings.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include <gtest/gtest.h>

#include "tests/hal/thermistor.hpp"

namespace bms::hal::adc {
namespace {

constexpr double reference_v = 1.21;
constexpr std::uint32_t reference_at_3v3 = 1'502;  // 1.21 / 3.3 * 4095

/// Computes the converter's counts from the voltages and resistances of a cell.
struct Bench {
  double supply_v = 3.3, cell_v = 3.3, current_a = 0, celsius = 25;
  std::uint32_t n = 100;

  AdcCounts counts() const {
    const auto sum = [&](double pin_v) {
      return static_cast<std::uint32_t>(std::lround(n * std::clamp(pin_v / supply_v, 0.0, 1.0) * 4'095));
    };
    const double ohm = thermistor_ohm(celsius);
    return {.n = n,
            .voltage = sum(cell_v / 2),
            .current = sum(supply_v / 2 + 20 * 0.002 * current_a),
            .temperature = sum(supply_v * ohm / (ohm + 10'000)),
            .n_reference = n,
            .reference = sum(reference_v)};
  }
  measurement::Sample read(const SensorCalibration& calibration = {}) const {
    measurement::Sample s;
    adc::read(counts(), reference_at_3v3, {}, calibration, s);
    return s;
  }
};

TEST(CellReadings, EqualTheCellsAtEverySupply) {
  for (double supply_v = 3.0; supply_v <= 3.55; supply_v += 0.05) {
    for (double cell_v = 1.5; cell_v <= 4.3; cell_v += 0.1) {
      EXPECT_NEAR(1e-6 * (Bench{.supply_v = supply_v, .cell_v = cell_v}.read().voltage_uv), cell_v, 0.0005 * cell_v)
          << "one count of the manufacturer's reference value is 0.067 %; half of it is the error";
    }
    for (double current_a = -30; current_a <= 30; current_a += 5) {
      EXPECT_NEAR(1e-6 * (Bench{.supply_v = supply_v, .current_a = current_a}.read().current_ua), current_a,
                  0.005 + 0.0005 * std::abs(current_a))
          << supply_v;
    }
  }
}

TEST(CellReadings, TemperatureIsWithin045KelvinFromMinus25To85DegreesAndMonotonic) {
  double worst = 0;
  std::int16_t before = -10'000;
  for (double celsius = -25; celsius <= 85; celsius += 0.25) {
    const std::int16_t read = Bench{.celsius = celsius}.read().temperature_cdegc;
    worst = std::max(worst, std::abs(0.01 * read - celsius));
    EXPECT_GE(read, before);
    before = read;
  }
  std::printf("thermistor: worst %.2f K\n", worst);
  EXPECT_LT(worst, 0.45);
}

TEST(CellReadings, AnOpenOrShortedThermistorGivesNoTemperature) {
  AdcCounts c = Bench{}.counts();
  measurement::Sample s;
  for (const std::uint32_t rail : {0U, 4'095U * c.n}) {
    c.temperature = rail;
    read(c, reference_at_3v3, {}, {}, s);
    EXPECT_EQ(s.temperature_cdegc, measurement::no_temperature);
    EXPECT_NE(s.voltage_uv, measurement::no_reading);
  }
}

TEST(CellReadings, TheCalibrationAppliesAGainAndAnOffset) {
  const Bench bench{.cell_v = 3.2, .current_a = -10};
  const measurement::Sample plain = bench.read(), corrected = bench.read({.voltage_gain_ppm = 2'000,
                                                                          .voltage_offset_uv = -3'000,
                                                                          .current_gain_ppm = -10'000,
                                                                          .current_offset_ua = 50'000});
  EXPECT_NEAR(corrected.voltage_uv, 1.002 * plain.voltage_uv - 3'000, 1);
  EXPECT_NEAR(corrected.current_ua, 0.99 * plain.current_ua + 50'000, 1);
}

TEST(CellReadings, ASaturatedAmplifierReadsMoreThanTheShortCircuitThreshold) {
  EXPECT_GT(Bench{.current_a = 500}.read().current_ua, 40'000'000);
  EXPECT_LT(Bench{.current_a = -500}.read().current_ua, -40'000'000);
}

TEST(CellReadings, ASilentConverterOrAnImpossibleSupplyGivesNoReading) {
  const auto nothing = [](AdcCounts c) {
    measurement::Sample s;
    read(c, reference_at_3v3, {}, {}, s);
    return s.voltage_uv == measurement::no_reading && s.current_ua == measurement::no_reading &&
           s.temperature_cdegc == measurement::no_temperature;
  };
  EXPECT_TRUE(nothing({}));
  AdcCounts c = Bench{}.counts();
  EXPECT_FALSE(nothing(c));
  c.reference = 0;
  EXPECT_TRUE(nothing(c));
  EXPECT_TRUE(nothing(Bench{.supply_v = 3.7}.counts()));
  EXPECT_TRUE(nothing(Bench{.supply_v = 2.3}.counts()));
}

TEST(CellReadings, TheConversionsOfAOneMinutePeriodDoNotOverflow) {
  const measurement::Sample s = Bench{.cell_v = 4.2, .current_a = 35, .n = 240'000}.read();
  EXPECT_NEAR(1e-6 * s.voltage_uv, 4.2, 0.0021);
  EXPECT_NEAR(1e-6 * s.current_ua, 35, 0.02);
}

}  // namespace
}  // namespace bms::hal::adc
