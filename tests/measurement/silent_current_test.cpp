// A sensor that reads 0 under load, against rests, dead bands and references. The cell is a resistance and noise.
#include "measurement/silent_current.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <vector>

namespace bms::measurement {
namespace {

struct Log {
  double ohm = 0.0005, noise_v = 0.0003, row_s = 5;
  bool load = true;       ///< flows between 4,000 and 8,000 s
  bool read = false;      ///< by the sensor, meanwhile
  double band_a = 0;      ///< dead band
  std::size_t cells = 0;  ///< 0: one voltage
  unsigned seed = 1;
};

Recording make(const Log& log) {
  std::mt19937 random(log.seed);
  std::normal_distribution<double> noise(0, 1);
  Recording r;
  std::vector<double> t, a, v;
  std::vector<std::vector<double>> cells(log.cells);
  for (double time_s = 0; time_s < 12'000; time_s += log.row_s) {
    const bool within = time_s >= 4'000 && time_s < 8'000;
    const double load_a = std::fmod(time_s, 240) < 120 ? -52 : -28, flows = within && !log.load ? 0 : load_a;
    double reading = within && !log.read ? 0 : std::round(100 * (flows + 0.1 * noise(random))) / 100;
    if (std::abs(reading) < log.band_a) reading = 0;
    t.push_back(time_s);
    a.push_back(reading);
    const auto volts = [&] { return 3.3 + log.ohm * flows - 1e-6 * time_s + log.noise_v * noise(random); };
    v.push_back(volts());
    for (auto& c : cells) c.push_back(volts());
  }
  r.time_s = t;
  r.current_a = a;
  r.voltage_v = v;
  for (auto& c : cells) r.cell_voltage_v.emplace_back(std::move(c));
  return r;
}

TEST(SilentCurrent, IsNamedWithItsTimesAndTheSizeOfTheLoadsThatAreSwitched) {
  for (const std::size_t cells : {0U, 3U, 16U}) {
    for (const double row_s : {1.0, 5.0, 30.0}) {
      const auto found = silent_currents(make({.row_s = row_s, .cells = cells}));
      ASSERT_EQ(found.size(), 1U) << cells << ", " << row_s;
      EXPECT_NEAR(found[0].from_s, 4'000, row_s);
      EXPECT_NEAR(found[0].to_s, 8'000, row_s);
      EXPECT_NEAR(found[0].step_a, 24, 3) << cells << ", " << row_s;
    }
  }
}

TEST(SilentCurrent, IsNotARestNorALoadThatIsReadNorADeadBand) {
  for (unsigned seed = 1; seed <= 40; ++seed) {
    const double row_s = seed % 2 == 0 ? 5 : 20;
    EXPECT_TRUE(silent_currents(make({.row_s = row_s, .load = false, .seed = seed})).empty()) << seed;
    EXPECT_TRUE(silent_currents(make({.row_s = row_s, .read = true, .seed = seed})).empty()) << seed;
    EXPECT_TRUE(silent_currents(make({.row_s = row_s, .load = false, .band_a = 2, .cells = 8, .seed = seed})).empty());
  }
}

/// A rest whose voltage comes back from the load before, read in coarse digits.
TEST(SilentCurrent, IsNotARelaxationNorACoarseVoltage) {
  for (const double digit_v : {1e-5, 1e-3, 5e-3, 1e-2}) {
    for (const double row_s : {1.0, 5.0, 20.0}) {
      Recording r = make({.row_s = row_s, .load = false});
      std::vector<double>& v = r.voltage_v.edit();
      for (std::size_t k = 0; k < r.rows(); ++k) {
        if (r.time_s[k] >= 4'000 && r.time_s[k] < 8'000) v[k] -= 0.15 * std::exp(-(r.time_s[k] - 4'000) / 60);
        v[k] = std::round(v[k] / digit_v) * digit_v;
      }
      EXPECT_TRUE(silent_currents(r).empty()) << digit_v << ", " << row_s;
    }
  }
}

TEST(SilentCurrent, IsNotLookedForWhereTheVoltageMayBeThatOfAReferenceSource) {
  Recording r = make({});
  EXPECT_FALSE(silent_currents(r).empty());
  r.current_ref_a = std::vector<double>(r.rows(), std::numeric_limits<double>::quiet_NaN());
  EXPECT_TRUE(silent_currents(r).empty());
}

TEST(SilentCurrent, HasASentenceWithItsTimes) {
  const Recording r = make({});
  const std::string text = silent_current_text(silent_currents(r), 0);
  EXPECT_NE(text.find("reads exactly 0 from 4000 to 7995 s while the voltage has"), std::string::npos) << text;
  EXPECT_TRUE(silent_current_text({}, 0).empty());
}

}  // namespace
}  // namespace bms::measurement
