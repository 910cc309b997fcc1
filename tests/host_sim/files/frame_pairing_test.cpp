// CAN logs with several channels or senders, and frames that belong together but come one after the other.
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include <fmt/format.h>

#include "files/logs/frame_list.hpp"
#include "files/logs/paired_column.hpp"
#include "files/recording.hpp"
#include "files/temporary_folder.hpp"
#include "files/text_file.hpp"
#include "tests/host_sim/files/rejected_input.hpp"

namespace bms::files {
namespace {

using ::testing::HasSubstr;

constexpr const char* two_messages =
    "BO_ 256 Pack: 8 X\n SG_ I : 0|16@1- (1,0) [-500|500] \"A\" X\n"
    "BO_ 257 Cells: 8 X\n SG_ U : 0|16@1+ (1,0) [0|0] \"mV\" X\n";

class FramesOfOneBus : public ::testing::Test {
 protected:
  std::string file(const std::string& name, const std::string& text) const {
    const std::string path = (folder_.path() / name).string();
    write_file(path, text);
    return path;
  }
  measurement::Recording read(const std::string& log, const std::string& channel = {},
                              const std::string& dbc = two_messages) const {
    ReadOptions options;
    options.dbc = file("bus.dbc", dbc);
    options.map = {"current_a=I", "voltage_v=U"};
    options.channel = channel;
    return read_recording(log, VoltageColumn::required, options);
  }
  std::string refused(const std::string& log, const std::string& channel = {}) const {
    return refusal_by("[^:]*", [&] { read(log, channel); });
  }
  static std::string frame(double time_s, const char* channel, const char* id, int value) {
    return fmt::format("({:.3f}) {} {}#{:02X}{:02X}\n", time_s, channel, id, value & 0xFF, (value >> 8) & 0xFF);
  }
  /// The current steps at 5 s; the cell is sent `delay_s` after it and has 10 mV an ampere.
  std::string step(double delay_s, int every = 1) const {
    std::string text;
    for (int k = 0; k < 12; ++k) {
      const int current = k < 5 ? 0 : 10;
      const std::string cell = k % every == 0 ? frame(k + delay_s, "can0", "101", 3'000 + 10 * current) : "";
      if (delay_s < 0) text += cell;
      text += frame(k, "can0", "100", current);
      if (delay_s >= 0) text += cell;
    }
    return file("step.log", text);
  }

 private:
  TemporaryFolder folder_;
};

TEST_F(FramesOfOneBus, AreInTheRowOfTheCurrentThatIsNearestInTime) {
  for (const double delay_s : {0.0, 0.02, 0.4, -0.02, -0.4}) {
    const measurement::Recording r = read(step(delay_s));
    SCOPED_TRACE(delay_s);
    ASSERT_EQ(r.rows(), 12U);
    for (std::size_t k = 0; k < r.rows(); ++k) EXPECT_DOUBLE_EQ(r.voltage_v[k], 3 + 0.01 * r.current_a[k]) << k;
  }
  EXPECT_THAT(read(step(0.02)).read_as, HasSubstr("from 0 s before to 0.02 s after its current"));
  EXPECT_THAT(read(step(-0.4)).read_as, HasSubstr("from 0.4 s before to 0 s after its current"));
}

TEST_F(FramesOfOneBus, ThatAreSlowerThanTheCurrentAreHeldAndTheirCycleIsStated) {
  const measurement::Recording r = read(step(0.1, 5));
  ASSERT_EQ(r.rows(), 12U);
  EXPECT_DOUBLE_EQ(r.voltage_v[4], 3.0);
  EXPECT_DOUBLE_EQ(r.voltage_v[5], 3.1);
  EXPECT_DOUBLE_EQ(r.voltage_v[9], 3.1);
  EXPECT_THAT(r.read_as, HasSubstr("voltage_v is sent every 5.5 s"));
}

TEST(PairedColumn, PrefersTheNearestOfSeveralValuesAndForgetsOldOnes) {
  PairedColumn column;
  for (const double t : {0.9, 1.1}) {
    if (t > 1) column.add_row(1, true);
    column.receive(t, t);
  }
  column.receive(1.45, 1.45);
  column.add_row(2, true);
  column.add_row(13, true);
  column.end();
  EXPECT_EQ(column.values()[0], 0.9) << "as near as 1.1";
  EXPECT_EQ(column.values()[1], 1.45) << "held";
  EXPECT_TRUE(std::isnan(column.values()[2]));
}

TEST_F(FramesOfOneBus, ThatAreLogsOfTwoAreRefusedWithTheListOfChannelsOrChosen) {
  std::string text;
  for (int k = 0; k < 12; ++k) {
    for (const char* channel : {"can0", "can1"}) {
      text += frame(k, channel, "100", channel[3] == '1' ? 7 : 1) + frame(k, channel, "101", 3'300);
    }
  }
  text += frame(12, "can7", "333", 0);
  const std::string log = file("two.log", text);
  EXPECT_THAT(refused(log), HasSubstr("(id 100) is on several channels, expected --channel with one of: can0, can1, "
                                      "can7"));
  EXPECT_THAT(refused(log, "can2"), HasSubstr("no frame on channel 'can2', expected one of: can0, can1, can7"));
  EXPECT_EQ(read(log, "can0").current_a[3], 1);
  EXPECT_EQ(read(log, "can1").current_a[3], 7);
  EXPECT_EQ(read(log, "can1").rows(), 12U);
}

TEST_F(FramesOfOneBus, MayHaveTheirMessagesOnDifferentChannels) {
  std::string text;
  for (int k = 0; k < 12; ++k) text += frame(k, "can0", "100", 1) + frame(k, "can1", "101", 3'300);
  EXPECT_EQ(read(file("gateway.log", text)).rows(), 12U);
}

TEST_F(FramesOfOneBus, HaveAChannelInEachFormat) {
  std::string asc = "date Thu\nbase hex  timestamps absolute\n", gvret = "Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2\n",
              emulator;
  for (int k = 0; k < 12; ++k) {
    for (const int c : {1, 2}) {
      for (const char* id : {"100", "101"}) {
        asc += fmt::format("{}.0 {} {} Rx d 2 0{} 00\n", k, c, id, c);
        gvret += fmt::format("{}000000,00000{},false,Rx,{},2,0{},00\n", k, id, c, c);
        emulator += fmt::format("({}.0) RX{} {} [2] 0{} 00\n", k, c, id, c);
      }
    }
  }
  for (const std::string& text : {asc, gvret, emulator}) {
    const std::string log = file("channels.log", text);
    EXPECT_THAT(refused(log), HasSubstr("with one of: 1, 2")) << text.substr(0, 60);
    EXPECT_EQ(read(log, "2").current_a[0], 2) << text.substr(0, 60);
  }
}

TEST_F(FramesOfOneBus, OfTwoSourcesOfJ1939AreNotMixed) {
  const std::string dbc =
      replaced(replaced(two_messages, "256", std::to_string(0x98FF'00FE)), "257", std::to_string(0x98FF'01FE)) +
      "BA_ \"ProtocolType\" \"J1939\";\n";
  std::string one, two;
  for (int k = 0; k < 12; ++k) {
    one += frame(k, "can0", "18FF00F3", 1) + frame(k, "can0", "18FF01F3", 3'300);
    two += frame(k, "can0", k % 2 == 0 ? "18FF00F3" : "18FF00F4", 1) + frame(k, "can0", "18FF01F3", 3'300);
  }
  EXPECT_EQ(read(file("one.log", one), {}, dbc).rows(), 12U);
  EXPECT_THAT(refusal_by("[^:]*", [&] { read(file("two.log", two), {}, dbc); }),
              HasSubstr("source addresses F3 and F4"));
}

TEST_F(FramesOfOneBus, ALittleLateAreLeftOutAndCounted) {
  std::string text;
  for (int k = 0; k < 20; ++k) {
    text += frame(k, "can0", "100", 1) + frame(k, "can0", "101", 3'300);
    if (k == 8) text += frame(6.5, "can0", "100", 2);
  }
  const measurement::Recording r = read(file("late.log", text));
  EXPECT_EQ(r.rows(), 20U);
  ASSERT_FALSE(r.warnings.empty());
  EXPECT_THAT(r.warnings[0].text, HasSubstr("a little before that of the frame above: 1"));
  EXPECT_THAT(refused(file("back.log", text + frame(3, "can0", "100", 1))),
              HasSubstr("time goes back from 19 s to 3 s"));
}

TEST_F(FramesOfOneBus, WhoseCurrentIsNeverInItsRangeAreOfAnotherBus) {
  std::string text;
  for (int k = 0; k < 12; ++k) text += frame(k, "can0", "100", 600) + frame(k, "can0", "101", 3'300);
  EXPECT_THAT(refused(file("other.log", text)), HasSubstr("no value of 'I' is in its range from -500 to 500"));
  text += frame(12, "can0", "100", 7);
  const measurement::Recording r = read(file("missing.log", text));
  ASSERT_FALSE(r.warnings.empty());
  EXPECT_THAT(r.warnings[0].text, HasSubstr("12 of 25, the first signal is 'I'"));
}

TEST_F(FramesOfOneBus, AreReadFromLinesOfCanFd) {
  std::string text = "date Thu\nbase hex  timestamps absolute\n";
  for (int k = 0; k < 12; ++k) {
    text += fmt::format("{}.0 CANFD 1 Rx 100 Pack 1 0 2 2 07 00 0 0\n{}.0 CANFD 1 Rx 101 1 0 f 64 E4 0C", k, k);
    for (int b = 2; b < 64; ++b) text += " 00";
    text += "\n";
  }
  const measurement::Recording r = read(file("fd.asc", text));
  EXPECT_EQ(r.rows(), 12U);
  EXPECT_EQ(r.current_a[0], 7);
  EXPECT_EQ(r.voltage_v[0], 3.3);
}

TEST_F(FramesOfOneBus, AreListedWithTheirRatesAndRangesAndWhatTheyCouldBe) {
  const std::string dbc =
      "BO_ 256 Pack: 8 X\n SG_ PackCurrent : 0|16@1- (0.1,0) [-3000|3000] \"A\" X\n"
      "BO_ 257 Cells: 8 X\n SG_ P M : 0|8@1+ (1,0) [0|0] \"\" X\n SG_ Cell_3 m1 : 8|8@1+ (20,0) [0|0] \"mV\" X\n"
      "SG_ Lost m7 : 8|8@1+ (1,0) [0|0] \"A\" X\n"
      "BO_ 258 Other: 8 X\n SG_ MaxCurrent : 0|8@1+ (1,0) [0|0] \"A\" X\n";
  std::string text;
  for (int k = 0; k < 10; ++k) {
    text += frame(0.5 * k, "can0", "100", k == 3 ? 0x8000 : -10 * k) + frame(0.5 * k, "can0", "101", 0xA501);
    text += frame(0.5 * k, "can0", "555", 0);
  }
  text += frame(9, "can0", "102", 9);
  ReadOptions options;
  options.dbc = file("list.dbc", dbc);
  const FrameList list = list_frames(file("list.log", text), options);
  ASSERT_EQ(list.messages.size(), 3U);
  EXPECT_DOUBLE_EQ(list.messages[0].cycle_s(), 0.5);
  const ListedSignal& current = list.messages[0].signals[0];
  EXPECT_EQ(current.column, "current_a");
  EXPECT_EQ(current.lowest, -9);
  EXPECT_EQ(current.highest, 0);
  EXPECT_EQ(current.missing, 1U);
  EXPECT_EQ(list.messages[1].signals[1].column, "v_3");
  EXPECT_EQ(list.messages[1].signals[2].values, 0U) << "its page was not sent";
  EXPECT_EQ(list.messages[2].signals[0].column, "") << "a limit is not the current";
  EXPECT_EQ(list.unknown_frames, 10U);
  EXPECT_THAT(text_of(list), HasSubstr("Pack (id 100, channel can0): 10 frames, every 0.5 s"));
  EXPECT_THAT(text_of(list), HasSubstr("1 of 10 not available; could be --map current_a=PackCurrent"));
  EXPECT_THAT(refusal_by("[^:]*", [&] { list_frames(file("none.log", frame(1, "can0", "555", 0)), options); }),
              HasSubstr("no frame of a message of"));
}

}  // namespace
}  // namespace bms::files
