// Estimates of recordings that cannot be true: each has a doubt or is impossible, with the cause that was put in.
#include "replay/judgement.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <functional>
#include <limits>

#include <fmt/format.h>

#include "files/recording.hpp"
#include "measurement/recording_checks.hpp"

namespace bms::replay {
namespace {

using ::testing::HasSubstr;

/// An hour of a 6 Ah cell with a load that changes each minute; change(k, time, current, voltage) spoils it.
ReplayResult replayed(const std::function<void(int, double&, double&, double&)>& change) {
  std::string text = "time_s,current_a,voltage_v\n";
  double soc = 0.8, rc_v = 0;
  for (int k = 0; k < 3'600; ++k) {
    double time_s = k, current_a = k / 60 % 2 == 0 ? 2 : -6;
    soc += current_a / 3'600 / 6;
    rc_v += (0.008 * current_a - rc_v) * (1 - std::exp(-1 / 12.0));
    double voltage_v = 3.3 + 0.03 * (soc - 0.5) + 0.0132 * current_a + rc_v + 1e-4 * (k % 5);
    change(k, time_s, current_a, voltage_v);
    text += fmt::format("{},{},{}\n", time_s, current_a, voltage_v);
  }
  ReplayResult result;
  result.cell = files::read_cell("table9");
  result.recording = files::parse_recording(text, "log.csv");
  measurement::compare_with_cell(result.recording, result.cell.parameters);
  result.track = run_on_host(result.cell, measurement::samples(result.recording), std::nullopt, result.scalar);
  return result;
}

TEST(Judgement, AnHonestRecordingHasNoDoubt) {
  const Judgement judgement = judge(replayed([](int, double&, double&, double&) {}));
  EXPECT_FALSE(judgement.impossible.has_value()) << *judgement.impossible;
  EXPECT_THAT(judgement.doubts, ::testing::IsEmpty());
}

TEST(Judgement, MillisecondsAsSecondsAreImpossibleAndNamed) {
  const Judgement judgement = judge(replayed([](int, double& time_s, double&, double&) { time_s *= 1'000; }));
  ASSERT_TRUE(judgement.impossible.has_value());
  EXPECT_THAT(*judgement.impossible, HasSubstr("likely cause: the usual time step is 1000"));
  EXPECT_THAT(*judgement.impossible, HasSubstr("the times look like milliseconds, expected seconds"));
}

TEST(Judgement, TenTimesTheCurrentIsImpossibleAndNamed) {
  const Judgement judgement = judge(replayed([](int, double&, double& current_a, double&) { current_a *= 10; }));
  ASSERT_TRUE(judgement.impossible.has_value());
  EXPECT_THAT(*judgement.impossible, HasSubstr("the cell has 6 Ah: the current has another unit"));
}

TEST(Judgement, AnInvertedCurrentIsADoubt) {
  const Judgement judgement = judge(replayed([](int, double&, double& current_a, double&) { current_a = -current_a; }));
  EXPECT_THAT(judgement.doubts, ::testing::Contains(HasSubstr("the sign of the current looks inverted")));
}

TEST(Judgement, ADeadVoltageIsADoubt) {
  for (const double voltage_v : {0.0, std::numeric_limits<double>::quiet_NaN()}) {
    const Judgement judgement = judge(replayed([&](int, double&, double&, double& v) { v = voltage_v; }));
    EXPECT_THAT(judgement.doubts, ::testing::Contains(HasSubstr("only 0 of 3600 voltages can be used")));
  }
}

TEST(Judgement, AnEstimateThatIsNotANumberIsAFault) {
  ReplayResult result = replayed([](int, double&, double&, double&) {});
  auto words = result.track.rows.words();
  words[17][1] = std::bit_cast<std::uint32_t>(std::numeric_limits<float>::quiet_NaN());
  result.track.rows = Estimates(words, ScalarKind::float32);
  EXPECT_THROW(judge(result), std::runtime_error);
}

}  // namespace
}  // namespace bms::replay
