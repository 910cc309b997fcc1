// Temperature sensors of a pack against each other; channels that are many rows late; limits that are stated.
#include <algorithm>
#include <cmath>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "diagnosis/pack/channels.hpp"
#include "diagnosis/pack/isolability.hpp"
#include "diagnosis/pack/pack_texts.hpp"
#include "diagnosis/pack/pack_thresholds.hpp"
#include "diagnosis/pack/selection.hpp"
#include "diagnosis/pack/sensors.hpp"
#include "plant/random.hpp"
#include "tests/cells.hpp"

namespace bms {
namespace {

namespace dp = diagnosis::pack;

/// Sensors with these errors [K] on cells that a load warms by 6 K.
std::vector<dp::PackFinding> findings_with(const std::vector<double>& error_k) {
  plant::Random random(7);
  dp::PackRecording pack;
  pack.sensor_c.resize(error_k.size());
  for (std::size_t k = 0; k < 1'000; ++k) {
    pack.time_s.push_back(static_cast<double>(k));
    const double cell_c = 25 + 6 * std::min(1.0, static_cast<double>(k) / 500);
    for (std::size_t m = 0; m < error_k.size(); ++m)
      pack.sensor_c[m].push_back(cell_c + error_k[m] + 0.05 * random.normal());
  }
  return dp::check_thermistors(pack);
}

double most_probable_rival(const dp::PackFinding& f) {
  double most = 0;
  for (const dp::Rival& r : f.rivals) most = std::max(most, r.probability);
  return most;
}

TEST(PackThermistors, NamesOneOfThreeWithItsSize) {
  const auto found = findings_with({0.3, -9, -0.4});
  ASSERT_EQ(found.size(), 1);
  EXPECT_EQ(found[0].cell, 1);
  EXPECT_NEAR(found[0].value, -9, 2 * found[0].sigma);
  EXPECT_LT(most_probable_rival(found[0]), dp::limits.ambiguous_from);
}

TEST(PackThermistors, NamesTwoOfFourWithOppositeErrors) {
  const auto found = findings_with({10, 0.2, -12, -0.3});
  ASSERT_EQ(found.size(), 2);
  EXPECT_EQ(found[0].cell, 0);
  EXPECT_EQ(found[1].cell, 2);
  for (const dp::PackFinding& f : found) EXPECT_LT(most_probable_rival(f), dp::limits.ambiguous_from);
}

TEST(PackThermistors, DoNotSayWhichPairOfFourIsWrongIfBothAgree) {
  const auto found = findings_with({10, 0.2, 11, -0.3});
  ASSERT_FALSE(found.empty());
  for (const dp::PackFinding& f : found) EXPECT_GT(most_probable_rival(f), dp::limits.ambiguous_from);
}

TEST(PackThermistors, DoNotSayWhichTwoOfThreeAreWrong) {
  const auto found = findings_with({10, 0, -12});
  ASSERT_FALSE(found.empty());
  for (const dp::PackFinding& f : found) EXPECT_GT(most_probable_rival(f), dp::limits.ambiguous_from);
}

TEST(PackThermistors, NameNothingWhereTheMiddleIsWarmer) {
  EXPECT_TRUE(findings_with({-1.4, 1.2, -1.5}).empty());
  EXPECT_TRUE(findings_with({-1.5, 1, 1.6, 1.2, -0.9}).empty());
}

TEST(PackThermistors, NameOneOfSixWhoseEndsAreCold) {
  const auto found = findings_with({-3.1, 10, 0, 0.1, 0, -3.3});
  ASSERT_EQ(found.size(), 1);
  EXPECT_EQ(found[0].cell, 1);
}

/// Cells as resistances, of which one channel is `late` rows late.
dp::PackRecording late_channel(double step_s, std::size_t late) {
  plant::Random random(3);
  dp::PackRecording pack;
  pack.cell_v.resize(8);
  double current_a = 0;
  for (std::size_t k = 0; k < 2'000; ++k) {
    if (k % 5 == 0) current_a = 6 * random.normal();
    pack.time_s.push_back(step_s * static_cast<double>(k));
    pack.current_a.push_back(current_a);
    pack.soc.push_back(0.5);
    for (std::size_t c = 0; c < pack.cell_v.size(); ++c) {
      const std::size_t then = c == 3 && k >= late ? k - late : k;
      pack.cell_v[c].push_back(3.3 + 0.01 * pack.current_a[then] + 0.0003 * random.normal());
    }
  }
  return pack;
}

TEST(PackChannels, FindAChannelThatIsSixRowsLateWhateverTheRow) {
  for (const double step_s : {1.0, 10.0, 30.0}) {
    dp::PackRecording pack = late_channel(step_s, 6);
    const dp::Track track = dp::track_of(tests::table9, pack);
    const dp::Channels channels = dp::check_channels(track, pack);
    EXPECT_EQ(channels.cells[3].lag_s, 6 * step_s);
    EXPECT_EQ(channels.late(step_s), std::vector<std::size_t>{3}) << step_s;
  }
}

constexpr double r0_ohm = 0.01;

/// What a recording with changing current and charge shows of charge, resistance, joint and offset.
dp::Matrix information_of_a_shift() {
  constexpr double sigma_v = 0.001;
  plant::Random random(11);
  dp::Matrix sum = dp::Matrix::Zero();
  for (std::size_t k = 0; k < 3'000; ++k) {
    const double current_a = 6 * random.normal();
    dp::Vector row = dp::Vector::Zero();
    row[dp::charge] = 0.2 + 0.8 * random.uniform();
    row[dp::resistance] = r0_ohm * current_a + 0.02 * random.normal();
    row[dp::joint] = current_a;
    row[dp::offset] = 1;
    row[dp::gain] = 3.3 + 0.1 * random.normal();
    row /= sigma_v;
    sum += row * row.transpose();
  }
  return sum;
}

/// Cells of which the second one has this fault, exactly as the model gives it.
std::vector<dp::CellFit> cells_with(const dp::Matrix& information, dp::Parameter which, double size) {
  std::vector<dp::CellFit> fits(10);
  for (std::size_t c = 0; c < fits.size(); ++c) {
    dp::Information all;
    all.of_parameters = information;
    if (c == 1) all.with_data = information.col(static_cast<Eigen::Index>(which)) * size;
    fits[c].until = {all};
  }
  return fits;
}

TEST(PackLimits, AreWhatIsNamed) {
  const dp::Matrix information = information_of_a_shift();
  const dp::Vector healthy = dp::least_spread(r0_ohm);
  const auto none = cells_with(information, dp::offset, 0);
  const auto stated = dp::detection_limits_of(information, healthy, r0_ohm, {none, healthy, r0_ohm, 1, 1});
  std::size_t tried = 0;
  for (const dp::PackLimit& l : stated) {
    if (l.cause != dp::Cause::imbalance && l.cause != dp::Cause::joint && l.cause != dp::Cause::offset) continue;
    for (const double factor : {0.85, 1.15}) {
      const auto fits = cells_with(information, dp::parameter_of(l.cause), factor * l.value);
      const dp::PackLikelihood likelihood(fits, healthy, r0_ohm, 1, 1);
      const auto chosen = dp::select(likelihood, {});
      EXPECT_EQ(!chosen.empty(), factor > 1) << dp::text_of(l.cause).id << ", " << factor << " of the limit";
      ++tried;
    }
  }
  EXPECT_EQ(tried, 6);
}

/// Of a pack of three or four cells as well, in which four faulty ones would leave none.
TEST(PackLimits, TheSpreadOfASmallPackIsFinite) {
  for (const std::size_t cells : {3U, 4U, 5U, 16U}) {
    std::vector<dp::CellFit> fits = cells_with(information_of_a_shift(), dp::offset, 0.0001);
    fits.resize(cells, fits.front());
    const dp::Vector spread = dp::healthy_spread(fits, r0_ohm);
    EXPECT_TRUE(spread.allFinite()) << cells;
    EXPECT_TRUE((spread.array() >= dp::least_spread(r0_ohm).array()).all()) << cells;
  }
}

/// A recording that shows next to nothing: no cell has more than all of its charge, so a limit cannot be larger.
TEST(PackLimits, ThatNoCellCanHaveAreLeftOut) {
  const dp::Matrix information = 1e-12 * information_of_a_shift();
  const dp::Vector healthy = dp::least_spread(r0_ohm);
  const auto none = cells_with(information, dp::offset, 0);
  const auto stated = dp::detection_limits_of(information, healthy, r0_ohm, {none, healthy, r0_ohm, 1, 1});
  for (const dp::PackLimit& l : stated) EXPECT_LE(l.value, l.cause == dp::Cause::late ? 15 : 20) << dp::limit_text(l);
  dp::PackDiagnosis d;
  d.detection_limits = stated;
  d.not_visible = dp::without_limit(stated);
  EXPECT_EQ(d.not_visible.size() + stated.size(), dp::cell_causes.size());
  EXPECT_THAT(d.not_visible, testing::Contains(dp::Cause::leakage));
  EXPECT_THAT(dp::limits_text(d), testing::HasSubstr("Not visible in this recording: "));
}

}  // namespace
}  // namespace bms
