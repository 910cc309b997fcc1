#include "diagnosis/isolability.hpp"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "diagnosis/prepare.hpp"
#include "tests/inference/diagnosis/synthetic_recordings.hpp"

namespace bms::diagnosis {
namespace {

constexpr std::size_t leakage = model::mechanism_index_of<model::Leakage>,
                      current_offset = model::mechanism_index_of<model::CurrentOffset>,
                      voltage_gain = model::mechanism_index_of<model::VoltageGain>,
                      channel_skew = model::mechanism_index_of<model::ChannelSkew>,
                      contact = model::mechanism_index_of<model::ContactStep>,
                      resistance = model::mechanism_index_of<model::ResistanceGrowth>;

LikelihoodModel of_a_drive(const std::function<double(std::size_t, double, double)>& add_v = {}) {
  return likelihood_model_of(test::table9(), {}, {test::recorded(test::drive(1, 31), 0.7, 31, add_v)});
}

/// Sizes in the first parameter's unit; comparing at twice these.
Isolability compared(const LikelihoodModel& likelihood, const std::vector<DetectionLimit>& limits) {
  return isolability_of(likelihood, likelihood.noise(), limits);
}

TEST(Isolability, ALeakageAndAnOffsetOfTheCurrentNeedAnAmmeter) {
  const Isolability i = compared(of_a_drive(), {{leakage, 0, 0.1}, {current_offset, 0, 0.1}, {channel_skew, 0, 0.1}});
  ASSERT_EQ(i.causes.size(), 3U);
  EXPECT_FALSE(i.separable[0][1]);
  EXPECT_LT(i.gain[0][1], 10) << "only the drop of the offset over the resistance differs";
  EXPECT_EQ(i.separated_by[0][1], second_ammeter);
  EXPECT_TRUE(i.separable[0][2] && i.separable[1][2]) << "edges show a skew";
  EXPECT_EQ(i.separated_by[0][2], "") << "not needed";
  for (std::size_t a = 0; a < 3; ++a) {
    EXPECT_TRUE(i.separable[a][a]);
    for (std::size_t b = 0; b < 3; ++b) {
      EXPECT_EQ(i.separable[a][b], i.separable[b][a]);
      EXPECT_EQ(i.separated_by[a][b], i.separated_by[b][a]);
    }
  }
}

TEST(Isolability, AContactFromTheStartAndAResistanceNeedAVoltmeter) {
  const Isolability i = compared(of_a_drive(), {{contact, 0, 0.0005}, {resistance, 0, 0.05}});
  EXPECT_LT(i.gain[1][0], i.gain[0][1]) << "a contact from the first moment explains a grown one, not the reverse";
  EXPECT_FALSE(i.separable[0][1]);
  EXPECT_EQ(i.separated_by[0][1], second_voltmeter);
}

TEST(Isolability, NothingIsComparedWithASingleCause) {
  EXPECT_TRUE(compared(of_a_drive(), {{leakage, 0, 0.1}}).causes.empty());
}

/// The gain is what fits of both would show, here of a voltage that is read too high by a factor next to a skew.
TEST(Isolability, ItsGainIsThatOfFits) {
  constexpr double gain_error = 0.004;
  const LikelihoodModel healthy = of_a_drive();
  const Isolability i = compared(healthy, {{voltage_gain, 0, gain_error / 2}, {resistance, 0, 0.1}});
  const std::vector<double> without_v = healthy.voltage(healthy.base(), healthy.unchanged(), 0);
  PreparedRecording r = healthy.records().front();
  for (std::size_t k = 0; k < r.size(); ++k) r.voltage_v.edit()[k] = without_v[k] * (1 + gain_error);
  const LikelihoodModel likelihood(healthy.cell(), {}, {r}, healthy.noise());
  const auto cost = [&](std::size_t m) {
    return likelihood.fit(with(likelihood.base(), model::default_setting(m, likelihood.cell()))).cost;
  };
  const double expected = i.gain[0][1], found = cost(resistance) - cost(voltage_gain);
  EXPECT_GT(expected, 20);
  EXPECT_NEAR(found, expected, 0.2 * expected);
}

}  // namespace
}  // namespace bms::diagnosis
