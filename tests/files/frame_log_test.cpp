// Logs of foreign CAN frames and their DBC files, as somebody with bad intentions writes them.
#include <gtest/gtest.h>

#include <cmath>

#include <fmt/format.h>

#include "files/logs/dbc.hpp"
#include "files/logs/frame_text.hpp"
#include "files/recording.hpp"
#include "files/temporary_folder.hpp"
#include "files/text_file.hpp"
#include "measurement/recording.hpp"
#include "tests/files/rejected_input.hpp"

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

}  // namespace
}  // namespace bms::files
