#include "diagnosis/predicted_band.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "diagnosis/prepare.hpp"
#include "tests/inference/diagnosis/synthetic_recordings.hpp"

namespace bms::diagnosis {
namespace {

using healthy_data::HealthyData;
using healthy_data::HealthyRegime;

TEST(PredictedBand, HoldsAHealthyRecordingAndNotAWrongVoltage) {
  const auto share_within = [](double add_v, const HealthyData& healthy = {}) {
    const PreparedRecording r = test::recorded(test::drive(1, 21), 0.7, 21, [&](auto...) { return add_v; });
    const LikelihoodModel likelihood = likelihood_model_of(test::table9(), {}, {r});
    const std::vector<double> sigma_v = predicted_sigma_v(likelihood, 0, healthy),
                              file_v = likelihood.voltage(likelihood.base(), likelihood.unchanged(), 0);
    double within = 0;
    for (std::size_t k = 0; k < r.size(); ++k)
      within += std::abs(r.voltage_v[k] - file_v[k]) <= 1.96 * sigma_v[k] ? 1 : 0;
    return within / static_cast<double>(r.size());
  };
  EXPECT_GT(share_within(0), 0.9);
  EXPECT_LT(share_within(0.05), 0.2);
  HealthyData healthy;
  healthy.regimes = {{"soc", 0, 1, 2, 0, 0.05, 0.01, 2}};
  EXPECT_GT(share_within(0.05, healthy), 0.9) << "healthy recordings were as wrong";
}

/// The band's standard deviation in a discharge from 70 to 66 %, and that of the cell file alone [V].
std::array<double, 2> band_and_file_v(const HealthyData& healthy) {
  std::vector<double> current_a(200, 0.0);
  current_a.resize(400, -6.0);
  const LikelihoodModel likelihood = likelihood_model_of(test::table9(), {}, {test::recorded(current_a, 0.7, 21)});
  return {predicted_sigma_v(likelihood, 0, healthy)[350], predicted_sigma_v(likelihood, 0)[350]};
}

healthy_data::HealthyBlock up_to(double current_a) {
  healthy_data::HealthyBlock block;
  block.current_a = {-current_a, 0};
  return block;
}

TEST(PredictedBand, WeighsHealthyRecordingsAgainstTheCellFile) {
  HealthyData healthy;
  const auto band_over_error = [&](double times_file, double parts) {
    const double error_v = times_file * band_and_file_v({})[1];
    healthy.regimes = {{"soc", 0, 0.6, 1, 0, error_v, 0, parts}, {"soc", 0.6, 0.8, 1, 0, error_v, 0, parts}};
    return band_and_file_v(healthy)[0] / error_v;
  };
  // two of three predicted the third: 1 + 1/2 of a recording's variance; three predict the next one: 1 + 1/3
  const double three = 3 * (1 + 1.0 / 3) / (1 + 1.0 / 2);
  EXPECT_NEAR(band_over_error(100, 1e6), 1, 1e-3) << "many recordings need no file";
  EXPECT_NEAR(band_over_error(1, 3), 2.571 / 1.96 * std::sqrt((2 + three) / 5), 0.05) << "5 degrees of freedom";
  EXPECT_NEAR(band_over_error(1, 1), 3.182 / 1.96, 0.05) << "3 degrees of freedom";
  const double four = 2 * std::pow(4 * 4, -0.25);  // of the file's variance (4^2)^(3/4), over 4^2
  EXPECT_NEAR(band_over_error(4, 3), 2.571 / 1.96 * std::sqrt((four + three) / 5), 0.05) << "four times the file's";
}

TEST(PredictedBand, IsWiderWhereNoHealthyRecordingWas) {
  HealthyData healthy;
  healthy.regimes = {{"soc", 0, 0.5, 1, 0, 0.02, 0, 3}};
  healthy.beyond_tolerance_v = 0.01;
  const auto [band_v, file_v] = band_and_file_v(healthy);
  EXPECT_NEAR(band_v, std::hypot(1.5 * file_v, 0.01), 1e-9) << "they were below 50 %";
  healthy.regimes = {{"soc", 0, 1, 1, 0, 0, 0, 3}};
  healthy.blocks = {up_to(5)};
  EXPECT_LT(band_and_file_v(healthy)[0], file_v) << "6 A is near 5 A";
  EXPECT_GT(band_and_file_v(healthy)[0], 1e-4) << "an error of 0 is not less than the noise";
  healthy.blocks = {up_to(4)};
  EXPECT_NEAR(band_and_file_v(healthy)[0], std::hypot(1.5 * file_v, 0.01), 1e-9) << "6 A is far from 4 A";
}

constexpr std::size_t ranges = 10;  // of the state of charge

/// A discharge from full to empty, two rows in each range.
PreparedRecording discharge() {
  PreparedRecording r;
  r.initial_soc = 0.975;
  for (std::size_t k = 0; k < 2 * ranges; ++k) {
    r.time_s.edit().push_back(180.0 * static_cast<double>(k));
    r.current_a.edit().push_back(-6);
    r.voltage_v.edit().push_back(3.2);
  }
  return r;
}

/// Share of the readings of one more recording within the band, over many cells: errors are so many times what the
/// file expects, and in each range of the state of charge by a factor of its own. parts: healthy recordings.
double covered(double times, double parts) {
  const LikelihoodModel likelihood = likelihood_model_of(test::table9(), {}, {discharge()});
  const std::vector<double> file_v = predicted_sigma_v(likelihood, 0);
  plant::Random random(7);
  constexpr int cells = 200;
  double within = 0;
  for (int cell = 0; cell < cells; ++cell) {
    HealthyData healthy;
    std::array<double, ranges> next_v{};
    for (std::size_t range = 0; range < ranges; ++range) {
      const std::size_t row = 2 * (ranges - 1 - range);
      const double error_v = times * file_v[row] * std::exp(random.normal());
      double squares = 0;
      for (int part = 0; part < parts; ++part) squares += std::pow(error_v * random.normal(), 2);
      const double from = static_cast<double>(range) / ranges, to = static_cast<double>(range + 1) / ranges;
      if (parts > 0) healthy.regimes.push_back({"soc", from, to, 1, 0, std::sqrt(squares / parts), 0, parts});
      next_v[range] = error_v * random.normal();
    }
    const std::vector<double> sigma_v = predicted_sigma_v(likelihood, 0, healthy);
    for (std::size_t range = 0; range < ranges; ++range)
      within += std::abs(next_v[range]) <= 1.96 * sigma_v[2 * (ranges - 1 - range)] ? 1 : 0;
  }
  return within / (cells * ranges);
}

TEST(PredictedBand, HoldsOneMoreRecordingThoughTheToleranceOfTheFileIsWrong) {
  EXPECT_LT(covered(3, 0), 0.6) << "the file alone, three times too narrow";
  for (const double parts : {2.0, 3.0, 6.0}) {
    EXPECT_NEAR(covered(1, parts), 0.95, 0.02) << parts << " recordings";
    EXPECT_NEAR(covered(0.3, parts), 0.95, 0.035) << parts << " recordings, three times too wide";
    const double uncorrected = parts > 2 ? 0.035 : 0.05;  // two of three parts of ln 3 are corrected, then more
    EXPECT_NEAR(covered(3, parts), 0.95, uncorrected) << parts << " recordings, three times too narrow";
  }
}

TEST(PredictedBand, OfASingleRecordingCorrectsHalfOfAWrongTolerance) {
  EXPECT_NEAR(covered(1, 1), 0.95, 0.02);
  EXPECT_NEAR(covered(0.3, 1), 0.98, 0.02);
  EXPECT_NEAR(covered(3, 1), 0.88, 0.04);
}

}  // namespace
}  // namespace bms::diagnosis
