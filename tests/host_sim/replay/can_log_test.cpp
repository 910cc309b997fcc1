// CAN logs in which the firmware's time is not one line: restarts, pauses, jumps, a clock that stands still.
#include "replay/can_log.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <optional>
#include <string_view>

#include "can_messages.hpp"
#include "files/bad_input.hpp"
#include "files/temporary_folder.hpp"
#include "files/text_file.hpp"
#include "monitor/candump_line.hpp"

namespace bms::replay {
namespace {

using ::testing::HasSubstr;

/// Writes what the firmware sends for samples of a current of 1 A, one per second.
class Truck {
 public:
  /// The firmware starts: counter and time begin again.
  void restart() {
    counter_ = 0;
    time_us_ = 0;
  }
  void pass(double seconds) {
    time_us_ += static_cast<std::int64_t>(1e6 * seconds);
    wall_us_ += static_cast<std::int64_t>(1e6 * seconds);
  }
  void switched_off(double seconds) { wall_us_ += static_cast<std::int64_t>(1e6 * seconds); }
  void set_clock_of_the_log(double seconds) { switched_off(seconds); }
  void skip_samples(std::uint16_t count) {
    counter_ = static_cast<std::uint16_t>(counter_ + count);
    pass(count);
  }
  /// shown_us: the time in the frame; not given: the right one.
  void sample(const std::optional<std::uint64_t>& shown_us = std::nullopt) {
    pass(1);
    ++counter_;
    if (counter_ == 1) {
      can::StartingSoc soc;
      soc.soc_ppb = 700'000'000;
      soc.given = can::StartingSoc::given_yes;
      send(soc);
      can::StartingSigma sigma;
      sigma.sigma_ppb = 10'000'000;
      send(sigma);
    }
    can::SampleCurrent current;
    current.current_ua = 1'000'000;
    current.sample_counter = counter_;
    send(current);
    can::SampleVoltage voltage;
    voltage.voltage_uv = 3'300'000 + counter_ % 7;
    voltage.temperature_cdegc = 2'500;
    send(voltage);
    const std::uint64_t time_us = shown_us.value_or(static_cast<std::uint64_t>(time_us_));
    can::SampleTime time;
    time.time_low = static_cast<std::uint32_t>(time_us);
    time.time_high = static_cast<std::uint32_t>(time_us >> 32);
    send(time);
  }
  void capacity(float percent, float sigma_percent) {
    can::Health health;
    health.capacity = percent;
    health.capacity_sigma = sigma_percent;
    send(health);
  }
  void samples(int count) {
    for (int k = 0; k < count; ++k) sample();
  }
  std::vector<CanLog> read() const {
    const files::TemporaryFolder folder;
    files::write_file(folder.path() / "truck.log", text_);
    return read_can_log((folder.path() / "truck.log").string());
  }
  std::string refusal() const {
    try {
      read();
    } catch (const files::BadInput& refused) {
      return refused.what();
    }
    return "accepted";
  }

 private:
  template <class Message>
  void send(const Message& message) {
    monitor::append_dump_line(text_, monitor::to_bus_frame(message.frame(frame_counter_), wall_us_), "can0");
    frame_counter_ = can::next(frame_counter_);
  }

  std::string text_;
  std::uint8_t frame_counter_ = 0;
  std::uint16_t counter_ = 0;
  std::int64_t time_us_ = 0, wall_us_ = 1'760'000'000'000'000;
};

std::vector<std::size_t> sizes(const std::vector<CanLog>& runs) {
  std::vector<std::size_t> counts;
  for (const CanLog& run : runs) counts.push_back(run.samples.size());
  return counts;
}
std::vector<std::string> warnings(const CanLog& run) {
  std::vector<std::string> ids;
  for (const measurement::Warning& w : run.recording.warnings) ids.push_back(w.id);
  return ids;
}

TEST(CanLogRuns, ARestartBeginsARunOfItsOwnWithItsStartAndItsTime) {
  Truck truck;
  truck.samples(300);
  truck.switched_off(3'600);
  truck.restart();
  truck.samples(200);
  const auto runs = truck.read();
  ASSERT_EQ(sizes(runs), (std::vector<std::size_t>{300, 200}));
  for (const CanLog& run : runs) {
    EXPECT_TRUE(run.from_the_start);
    ASSERT_TRUE(run.start.soc.has_value());
    EXPECT_EQ(run.start.soc->soc_ppb, 700'000'000);
    EXPECT_EQ(run.start.soc->soc_sigma_ppb, 10'000'000);
    EXPECT_FALSE(run.start.capacity) << "not in the log";
    EXPECT_EQ(run.lost, 0U) << "a restart loses no samples";
    EXPECT_THAT(warnings(run), ::testing::IsEmpty());
    EXPECT_EQ(run.recording.time_s.front(), 0);
  }
  EXPECT_EQ(runs[1].recording.duration_s(), 199);
}

TEST(CanLogRuns, TheFirstCapacityOfARunIsThatWithWhichTheFirmwareBegan) {
  Truck truck;
  truck.sample();
  truck.capacity(78.15F, 1.23F);
  truck.samples(20);
  truck.capacity(80, 1);
  truck.restart();
  truck.samples(20);
  truck.capacity(79.95F, 0.99F);
  const auto runs = truck.read();
  ASSERT_EQ(runs.size(), 2U);
  ASSERT_TRUE(runs[0].start.capacity && runs[1].start.capacity);
  EXPECT_EQ(runs[0].start.capacity->ratio_ppm, 781'500);
  EXPECT_EQ(runs[0].start.capacity->sigma_ppm, 12'300);
  EXPECT_EQ(runs[1].start.capacity->ratio_ppm, 799'500);
  EXPECT_EQ(runs[1].start.capacity->sigma_ppm, 9'900);
}

TEST(CanLogRuns, ACounterThatOverflowsAndAPauseOfTheLogAreTheSameRun) {
  Truck truck;
  truck.skip_samples(65'500);
  truck.samples(100);
  truck.skip_samples(50);
  truck.samples(100);
  const auto runs = truck.read();
  ASSERT_EQ(sizes(runs), (std::vector<std::size_t>{200}));
  EXPECT_EQ(runs[0].lost, 50U);
  EXPECT_EQ(runs[0].unbroken, 100U);
  EXPECT_FALSE(runs[0].from_the_start);
}

TEST(CanLogRuns, ALogThatResumesInALaterRunDoesNotContinueTheFirst) {
  Truck truck;
  truck.samples(100);
  truck.switched_off(30'000);  // nobody logs
  truck.restart();
  truck.skip_samples(5'000);
  truck.samples(100);
  EXPECT_EQ(sizes(truck.read()), (std::vector<std::size_t>{100, 100}));
}

TEST(CanLogRuns, ASampleFarInTheFutureDoesNotStopWhatFollows) {
  Truck truck;
  truck.samples(100);
  truck.sample((std::uint64_t{1} << 48) - 1);
  truck.samples(100);
  const auto runs = truck.read();
  ASSERT_EQ(sizes(runs), (std::vector<std::size_t>{100, 100}));
  EXPECT_THAT(warnings(runs[1]), ::testing::Contains("short_runs"));
  EXPECT_LT(runs[1].recording.duration_s(), 101);
}

TEST(CanLogRuns, AClockOfTheLogThatIsSetChangesNothing) {
  Truck truck;
  truck.samples(100);
  truck.set_clock_of_the_log(3'600);
  truck.samples(100);
  truck.set_clock_of_the_log(-7'200);
  truck.samples(100);
  EXPECT_EQ(sizes(truck.read()), (std::vector<std::size_t>{300}));
}

TEST(CanLogRuns, WithoutARunThatCanBeReplayedTheLogIsRefused) {
  Truck still;
  for (int k = 0; k < 100; ++k) still.sample(5'000'000);
  EXPECT_THAT(still.refusal(), HasSubstr("all samples have the same time"));
  Truck restarting;
  for (int k = 0; k < 20; ++k) {
    restarting.restart();
    restarting.samples(5);
  }
  EXPECT_THAT(restarting.refusal(), HasSubstr("5 samples in the longest run of the firmware, expected 10 or more"));
}

/// A compressed table is a recording like any other.
TEST(CanLogFile, IsOneByItsFirstLineAlsoIfItIsCompressed) {
  const files::TemporaryFolder folder;
  const auto is_log = [&](std::string_view bytes) {
    const std::string path = (folder.path() / "can_log_file.gz").string();
    files::write_file(path, std::string(bytes));
    return is_can_log(path);
  };
  // "time_s,current_a,voltage_v\n0,1,3.3\n" and "(1.000000) can0 182#00\n" by Python's gzip
  constexpr std::string_view table(
      "\x1f\x8b\x08\x00\x00\x00\x00\x00\x02\x03\x2b\xc9\xcc\x4d\x8d\x2f\xd6\x49\x2e\x2d\x2a\x4a\xcd\x2b\x89"
      "\x4f\xd4\x29\xcb\xcf\x29\x49\x4c\x4f\x8d\x2f\xe3\x32\xd0\x31\xd4\x31\xd6\x33\xe6\x02\x00\x95\xd5\xe6"
      "\x9e\x23\x00\x00\x00",
      55);
  constexpr std::string_view frames(
      "\x1f\x8b\x08\x00\x00\x00\x00\x00\x02\x03\xd3\x30\xd4\x33\x00\x03\x4d\x85\xe4\xc4\x3c\x03\x05\x43\x0b"
      "\x23\x65\x03\x03\x2e\x00\x3a\xb4\xff\x28\x17\x00\x00\x00",
      39);
  EXPECT_FALSE(is_log(table));
  EXPECT_TRUE(is_log(frames));
  EXPECT_FALSE(is_log(frames.substr(0, 12))) << "damaged, with nothing to read: read_recording() reports it";
  EXPECT_TRUE(is_log("(1.000000) can0 182#00\n"));
  EXPECT_FALSE(is_log("time_s,current_a,voltage_v\n"));
}

TEST(CanLogRuns, RepeatedTimesAreAWarningAsInARecording) {
  Truck truck;
  truck.samples(50);
  truck.sample(50'000'000);
  truck.samples(50);
  EXPECT_THAT(warnings(truck.read().front()), ::testing::Contains("duplicate_time"));
}

}  // namespace
}  // namespace bms::replay
