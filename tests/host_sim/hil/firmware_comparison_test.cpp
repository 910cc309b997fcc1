#include "hil/firmware_comparison.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace bms::hil {
namespace {

using ::testing::HasSubstr;

/// What a firmware would send that allows this discharge current and estimates this state of charge, for an hour of a
/// current of -80 A, once a second.
struct Sender {
  double allowed_a = 100;
  double soc_offset = 0;  ///< in percent, from `offset_from_s` on
  double offset_from_s = 1'800;
  std::uint32_t version = 1;
  float stack_free = 4'000;
  std::optional<FaultEvent> fault = {};

  FirmwareRun run() const {
    FirmwareRun run;
    std::uint8_t counter = 0;
    for (int k = 0; k <= 3'600; ++k) {
      counter = can::next(counter);
      const auto send = [&](const auto& message) {
        run.sent.push_back({static_cast<double>(k), message.frame(counter)});
      };
      can::PackState pack;
      pack.soc = static_cast<float>(90 - 0.01 * k + (k >= offset_from_s ? soc_offset : 0));
      pack.soc_sigma = 1;
      send(pack);
      can::PackElectrical electrical;
      electrical.current = -80;
      send(electrical);
      can::AllowedCurrent allowed;
      allowed.discharge = static_cast<float>(allowed_a);
      allowed.charge = 50;
      send(allowed);
      can::Identity identity;
      identity.version_minor = version;
      send(identity);
      can::Board board;
      board.stack_free = stack_free;
      send(board);
    }
    if (fault) run.session.faults = {*fault};
    return run;
  }
};

TEST(FirmwareComparison, TwoBuildsOfTheSameAreEqual) {
  const auto result = compare(Sender{}.run(), Sender{.version = 2, .stack_free = 3'900}.run());
  EXPECT_EQ(result.samples, 3'601);
  EXPECT_EQ(result.differences, 0);
  EXPECT_FALSE(result.first);
  EXPECT_TRUE(result.signals.empty());
  EXPECT_TRUE(result.faults.empty());
}

TEST(FirmwareComparison, ALowerLimitIsShownWithItsSizeAndTheTimeAboveIt) {
  const auto result = compare(Sender{}.run(), Sender{.allowed_a = 76}.run());
  EXPECT_EQ(result.differences, 3'601);
  ASSERT_EQ(result.signals.size(), 1);
  EXPECT_EQ(result.signals[0].message + "." + result.signals[0].signal, "AllowedCurrent.Discharge");
  EXPECT_NEAR(result.signals[0].largest, 24, 0.01);
  EXPECT_THAT(result.first->what, HasSubstr("100.00 A, with the new firmware 76.00 A"));
  EXPECT_EQ(result.above_allowed_before_s, 0);
  EXPECT_NEAR(result.above_allowed_after_s, 3'600, 1);
}

TEST(FirmwareComparison, ADifferenceIsFoundWhereItBegins) {
  const auto result = compare(Sender{}.run(), Sender{.soc_offset = 0.5}.run());
  EXPECT_EQ(result.differences, 1'801);
  EXPECT_EQ(result.first->time_s, 1'800);
  ASSERT_EQ(result.signals.size(), 1);
  EXPECT_EQ(result.signals[0].signal, "Soc");
  EXPECT_NEAR(result.signals[0].largest, 0.5, 0.003);
  EXPECT_EQ(result.signals[0].last_s, 3'600);
}

TEST(FirmwareComparison, FaultsAreComparedByTheirTimes) {
  const FaultEvent early{"DischargeOvercurrent", 100, 130.0}, late{"DischargeOvercurrent", 140, 150.0};
  EXPECT_TRUE(compare(Sender{.fault = early}.run(), Sender{.fault = early}.run()).faults.empty());
  const auto moved = compare(Sender{.fault = early}.run(), Sender{.fault = late}.run()).faults;
  ASSERT_EQ(moved.size(), 1);
  EXPECT_EQ(moved[0].before->raised_at_s, 100);
  EXPECT_EQ(moved[0].after->raised_at_s, 140);
  const auto gone = compare(Sender{.fault = early}.run(), Sender{}.run()).faults;
  ASSERT_EQ(gone.size(), 1);
  EXPECT_FALSE(gone[0].after);
}

TEST(FirmwareComparison, AFirmwareThatStopsSendingDiffers) {
  auto silent = Sender{}.run();
  std::erase_if(silent.sent, [](const SentFrame& f) { return f.frame.id == can::AllowedCurrent::id; });
  const auto result = compare(Sender{}.run(), silent);
  EXPECT_EQ(result.differences, 3'601);
  EXPECT_THAT(result.first->what, HasSubstr("with the new firmware not known"));
}

}  // namespace
}  // namespace bms::hil
