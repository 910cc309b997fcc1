// What the user says about a log, in logs that are not tables: units of groups, steps, times of remote frames.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fmt/format.h>

#include "files/recording.hpp"
#include "files/temporary_folder.hpp"
#include "files/text_file.hpp"
#include "tests/host_sim/files/rejected_input.hpp"

namespace bms::files {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

class LogOptions : public ::testing::Test {
 protected:
  std::string file(const std::string& name, const std::string& text) const {
    const std::string path = (folder_.path() / name).string();
    write_file(path, text);
    return path;
  }
  /// Twelve frames of two cells; the DBC file states no unit of the voltages.
  std::string frames() const {
    std::string text;
    for (int k = 0; k < 12; ++k) text += fmt::format("({}) can0 123#10FFE40CE50C\n", k);
    return file("bus.log", text);
  }
  ReadOptions of_bus() const {
    ReadOptions options;
    options.dbc = file("bus.dbc",
                       "BO_ 291 Battery: 8 X\n"
                       " SG_ I : 0|16@1- (0.01,0) [0|0] \"A\" X\n"
                       " SG_ U1 : 16|16@1+ (1,0) [0|0] \"\" X\n"
                       " SG_ U2 : 32|16@1+ (1,0) [0|0] \"\" X\n");
    options.map = {"current_a=I", "v_1=U1", "v_2=U2"};
    return options;
  }
  std::string refused(const std::string& path, const ReadOptions& options) const {
    return refusal_by("[^:]*", [&] { read_recording(path, VoltageColumn::optional, options); });
  }

 private:
  TemporaryFolder folder_;
};

TEST_F(LogOptions, AUnitOfAGroupHoldsForSignalsOfFrames) {
  ReadOptions options = of_bus();
  options.unit = {"v_*=mV"};
  const measurement::Recording r = read_recording(frames(), VoltageColumn::optional, options);
  ASSERT_EQ(r.cell_voltage_v.size(), 2U);
  EXPECT_DOUBLE_EQ(r.cell_voltage_v[0][3], 3.3);
  EXPECT_DOUBLE_EQ(r.cell_voltage_v[1][3], 3.301);
  options.unit = {"v_*=mA"};
  EXPECT_THAT(refused(frames(), options), HasSubstr("'mA' is not a unit of v_1"));
}

TEST_F(LogOptions, StepsAndCyclesAreRefusedForFrames) {
  ReadOptions options = of_bus();
  options.steps = "3:4";
  EXPECT_THAT(refused(frames(), options), HasSubstr("has no steps and cycles"));
  options.steps.clear();
  options.cycles = "1";
  EXPECT_THAT(refused(frames(), options), HasSubstr("has no steps and cycles"));
}

/// Every second frame is a remote frame, half a second after the one before.
TEST_F(LogOptions, TheTimeOfARemoteFrameCountsInRelativeLogsOfBusmaster) {
  std::string text = "***BUSMASTER Ver 3.2.2***\n***HEX***\n***RELATIVE MODE***\n";
  for (int k = 0; k < 12; ++k) {
    text += "00:00:00:5000 Rx 1 0x123 s 6 10 FF E4 0C E5 0C\n";
    text += "00:00:00:5000 Rx 1 0x124 sr 0\n";
  }
  ReadOptions options = of_bus();
  options.unit = {"v_*=mV"};
  const measurement::Recording r = read_recording(file("remote.log", text), VoltageColumn::optional, options);
  ASSERT_EQ(r.rows(), 12U);
  EXPECT_DOUBLE_EQ(r.time_s[11] - r.time_s[0], 11);
}

TEST_F(LogOptions, WhatIsReadOfAnOwnRecordingBeginsWithItsFormat) {
  std::string text = "time_s,current_a,voltage_v,Step\n";
  for (int k = 0; k < 40; ++k) text += fmt::format("{},1,3.3,{}\n", k, k / 10);
  ReadOptions options;
  options.steps = "1:2";
  const measurement::Recording r = read_recording(file("own.csv", text), VoltageColumn::required, options);
  EXPECT_EQ(r.rows(), 20U);
  EXPECT_THAT(r.read_as, StartsWith("recording; only steps 1 to 2"));
}

TEST_F(LogOptions, EachEntityOfAConsoleHasTheUnitOfItsOwnLines) {
  std::string text;
  for (int k = 0; k < 12; ++k) {
    const std::string at = fmt::format("[12:00:{:02}][D][sensor:094]: ", 5 * k);
    text += at + "'bms current': Sending state -1500.0 mA with 1 decimals of accuracy\n";
    text += at + "'bms cell voltage 1': Sending state 3.30100 V with 3 decimals of accuracy\n";
    text += at + "'bms error bitmask': Sending state 0.0 with 0 decimals of accuracy\n";
  }
  const measurement::Recording r = read_recording(file("console.log", text), VoltageColumn::optional, {});
  EXPECT_DOUBLE_EQ(r.current_a[3], -1.5);
  EXPECT_DOUBLE_EQ(r.cell_voltage_v[0][3], 3.301);
  EXPECT_THAT(r.read_as, StartsWith("console of ESPHome"));
  EXPECT_THAT(r.read_as, HasSubstr("in the units of its lines"));
}

}  // namespace
}  // namespace bms::files
