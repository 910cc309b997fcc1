// Logs of foreign CAN frames and their DBC files, as somebody with bad intentions writes them.
#include <gtest/gtest.h>

#include <cmath>

#include <fmt/format.h>

#include "can/codec.hpp"
#include "files/logs/dbc.hpp"
#include "files/logs/frame_text.hpp"
#include "files/recording.hpp"
#include "files/temporary_folder.hpp"
#include "files/text_file.hpp"
#include "measurement/recording.hpp"
#include "tests/host_sim/files/rejected_input.hpp"

namespace bms::files {
namespace {

using ::testing::HasSubstr;

constexpr const char* current_signal = " SG_ I : 0|16@1- (0.01,0) [0|0] \"A\" X\n";
constexpr const char* voltage_signal = " SG_ U : 16|16@1+ (1,0) [0|0] \"mV\" X\n";

class FrameLogFiles : public ::testing::Test {
 protected:
  std::string file(const std::string& name, const std::string& text) const {
    const std::string path = (folder_.path() / name).string();
    write_file(path, text);
    return path;
  }
  /// Twelve frames 0x123, one a second. seconds(k): their times; bytes: their data.
  template <class Seconds>
  std::string log(Seconds&& seconds, const std::string& bytes = "10FFE40C") const {
    std::string text;
    for (int k = 0; k < 12; ++k) text += fmt::format("({}) can0 123#{}\n", seconds(k), bytes);
    return file("bus.log", text);
  }
  std::string frames(const std::string& bytes = "10FFE40C") const {
    return log([](int k) { return std::to_string(k); }, bytes);
  }
  measurement::Recording read(const std::string& dbc, const std::string& log) const {
    ReadOptions options;
    options.dbc = file("bus.dbc", "BO_ 291 Battery: 8 X\n" + dbc);
    options.map = {"current_a=I", "voltage_v=U"};
    return read_recording(log, VoltageColumn::required, options);
  }
  /// The one line that refuses it, without the name of the folder.
  std::string refused(const std::string& dbc, const std::string& log) const {
    return refusal_by("[^:]*", [&] { read(dbc, log); });
  }

 private:
  TemporaryFolder folder_;
};

/// The length plus the words before it is a small number in 32 bits.
TEST(FrameTextLine, WithALengthBeyondItsWordsIsNoFrame) {
  TextFrame frame;
  FrameText dump("candump"), asc("asc");
  for (const char* length : {"4294967295", "4294967292", "9", "4294967296"}) {
    const std::string line = fmt::format("(1.0) can0 123 [{}] 01 02", length);
    EXPECT_FALSE(dump.parse(line, frame)) << line;
  }
  for (const char* length : {"FFFFFFFF", "FFFFFFFA", "9"}) {
    const std::string line = fmt::format("1.0 1 123 Rx d {} 01 02", length);
    EXPECT_FALSE(asc.parse(line, frame)) << line;
  }
  EXPECT_TRUE(dump.parse("(1.0) can0 123 [2] 01 02", frame));
  EXPECT_TRUE(asc.parse("1.0 1 123 Rx d 2 01 02", frame));
}

TEST_F(FrameLogFiles, AreReadIfTheyAreWhole) {
  const measurement::Recording r = read(std::string(current_signal) + voltage_signal, frames());
  EXPECT_EQ(r.rows(), 12U);
  EXPECT_DOUBLE_EQ(r.current_a[0], -2.4);
  EXPECT_DOUBLE_EQ(r.voltage_v[0], 3.3);
  const std::string in_volts = " SG_ U : 16|16@1+ (0.001,0) [0|0] \"V\" X\n";
  EXPECT_EQ(read(current_signal + in_volts, frames("10FFD80C")).voltage_v[0], 3.288) << "not 3.2880000000000003";
}

TEST_F(FrameLogFiles, WithTimesThatAreNoNumbersHaveNoFrames) {
  const std::string dbc = std::string(current_signal) + voltage_signal;
  const auto soon_none = [](int k) { return k < 3 ? std::to_string(k) : "nan"; };
  EXPECT_THAT(refused(dbc, log(soon_none)), HasSubstr("3 rows"));
  EXPECT_THAT(refused(dbc, log([](int k) { return fmt::format("{}e300", k); })), HasSubstr("ten years"));
}

TEST_F(FrameLogFiles, WithValuesThatNoSensorHasAreRefused) {
  const std::string huge = " SG_ I : 0|16@1- (1e12,0) [0|0] \"A\" X\n";
  EXPECT_THAT(refused(huge + voltage_signal, frames()), HasSubstr("is impossible"));
  const std::string as_double =
      " SG_ I : 0|32@1- (1,0) [0|0] \"A\" X\n SG_ U : 32|16@1+ (1,0) [0|0] \"mV\" X\nSIG_VALTYPE_ 291 I : 1;\n";
  EXPECT_THAT(refused(as_double, frames("0000807FE40C")), HasSubstr("is impossible")) << "infinity";
  EXPECT_TRUE(std::isnan(read(as_double, frames("0000C07FE40C")).current_a[3])) << "not a number: a missing reading";
}

/// What a DBC file states about a value that is sent for "not available", and what J1939 does without it.
TEST_F(FrameLogFiles, WithValuesThatAreNotAvailableHaveMissingReadings) {
  const std::string in_range =
      " SG_ I : 0|16@1- (0.01,0) [-300|300] \"A\" X\n SG_ U : 16|16@1+ (1,0) [0|5000] \"mV\" X\n";
  EXPECT_DOUBLE_EQ(read(in_range, frames()).voltage_v[3], 3.3);
  EXPECT_TRUE(std::isnan(read(in_range, frames("10FF8913")).voltage_v[3])) << "5.001 V is above the range";
  EXPECT_THAT(refused(in_range, frames("3176E40C")), HasSubstr("no value of 'I' is in its range")) << "302.57 A";
  const std::string no_range = std::string(current_signal) + voltage_signal;
  EXPECT_TRUE(std::isnan(read(no_range, frames("10FFFFFF")).voltage_v[3])) << "all ones";
  EXPECT_TRUE(std::isnan(read(no_range, frames("0080E40C")).current_a[3])) << "the lowest number of 16 bits";
  EXPECT_DOUBLE_EQ(read(no_range, frames("FFFFE40C")).current_a[3], -0.01) << "all ones of a signed signal are -1";
  EXPECT_DOUBLE_EQ(read(no_range, frames("10FF8913")).voltage_v[3], 5.001) << "[0|0] states no range";
  const std::string invalid = no_range + "BA_ \"Invalid\" SG_ 291 U \"3300\";\n";
  EXPECT_TRUE(std::isnan(read(invalid, frames()).voltage_v[3]));
}

/// The multiplexor lies behind the end of these frames: nobody knows which signals they have.
TEST_F(FrameLogFiles, WithFramesThatEndBeforeTheirMultiplexorHaveNoSuchSignal) {
  for (const char* place : {"32|8@1+", "511|8@1+", "504|64@1+"}) {
    const std::string dbc =
        fmt::format(" SG_ M M : {} (1,0) [0|0] \"\" X\n SG_ U m0 : 16|16@1+ (1,0) [0|0] \"mV\" X\n", place);
    EXPECT_THAT(refused(current_signal + dbc, frames()), HasSubstr("no frame with Battery.U")) << place;
  }
}

TEST_F(FrameLogFiles, WithADbcFileThatIsNoneAreRefused) {
  const std::string word(1'000'000, 'a');
  EXPECT_THAT(refused("BO_ 1 " + word + " : 8 X\n", frames()), HasSubstr("is not a line of a DBC file"));
  EXPECT_THAT(refused(" SG_ " + word + " : 0|16@1- (1,0) [0|0] \"A\" X\n", frames()), HasSubstr("not a line"));
  EXPECT_THAT(refused(" SG_ I : 0|16@1- (1,0) [0|0] \"" + word + "\" X\n", frames()), HasSubstr("not a line"));
  for (const char* scale : {"nan,0", "inf,0", "1,-inf", "1e999,0"}) {
    const std::string dbc = fmt::format(" SG_ I : 0|16@1- ({}) [0|0] \"A\" X\n", scale);
    EXPECT_THAT(refused(dbc + voltage_signal, frames()), HasSubstr("not a line")) << scale;
  }
}

/// The battery's own frames: a sample a second, the cell voltages with each, an Identity with the first.
class OwnFrameLog : public FrameLogFiles {
 protected:
  static std::string line(double time_s, can::Frame frame) {
    can::protect(frame, static_cast<std::uint16_t>(frame.id), 0);
    std::string text = fmt::format("({:.6f}) can0 {:03X}#", time_s, frame.id);
    for (const std::uint8_t byte : frame.data) text += fmt::format("{:02X}", byte);
    return text + "\n";
  }
  static can::Frame of(std::uint32_t id) {
    can::Frame frame;
    frame.id = id;
    frame.length = 8;
    return frame;
  }
  /// cells: in the frame CellVoltages1, in millivolts; the third is not known in row 5.
  static std::string text_of(bool identity) {
    std::string text;
    for (int k = 0; k < 12; ++k) {
      can::Frame electrical = of(0x181), cells = of(0x190), status = of(0x182), identity_frame = of(0x183);
      can::put_raw(electrical, 16, 16, 13'210);                                // 13.21 V
      can::put_raw(electrical, 32, 16, static_cast<std::uint32_t>(-100 - k));  // in 0.02 A
      can::put_raw(electrical, 48, 16, 2'150);                                 // 21.5 degrees C
      for (unsigned c = 0; c < 4; ++c) can::put_raw(cells, 12 + 13 * c, 13, c == 2 && k == 5 ? 8'191 : 3'300 + c);
      if (identity && k == 0) text += line(k, identity_frame);
      text += line(k, electrical) + line(k + 0.001, cells) + line(k + 0.002, status);
    }
    return text;
  }
};

TEST_F(OwnFrameLog, NeedsNoDbcFileAndNoMapping) {
  const measurement::Recording r = read_recording(file("own.log", text_of(true)));
  ASSERT_EQ(r.rows(), 12U);
  ASSERT_EQ(r.cell_voltage_v.size(), 4U);
  EXPECT_DOUBLE_EQ(r.current_a[3], -2.06);
  EXPECT_DOUBLE_EQ(r.cell_voltage_v[1][3], 3.301);
  EXPECT_TRUE(std::isnan(r.cell_voltage_v[2][5])) << "not known";
  EXPECT_NEAR(r.voltage_v[5], (3.3 + 3.301 + 3.303) / 3, 1e-9) << "the mean of the others";
  EXPECT_DOUBLE_EQ(r.temperature_c[0], 21.5);
  EXPECT_DOUBLE_EQ(r.pack_voltage_v[0], 13.21);
  EXPECT_THAT(r.read_as, HasSubstr("the battery's own messages"));
}

TEST_F(OwnFrameLog, IsRecognisedByItsIdentityAndReadWithoutDamagedFrames) {
  EXPECT_THAT(refusal_by("[^:]*", [&] { read_recording(file("foreign.log", text_of(false))); }),
              HasSubstr("expected --dbc"));
  std::string damaged = text_of(true);
  const std::size_t at = damaged.find("(3.000000) can0 181#");
  damaged[at + 20] = damaged[at + 20] == '0' ? '1' : '0';  // its check code
  const measurement::Recording r = read_recording(file("damaged.log", damaged));
  EXPECT_EQ(r.rows(), 11U) << "no row without a current";
}

}  // namespace
}  // namespace bms::files
