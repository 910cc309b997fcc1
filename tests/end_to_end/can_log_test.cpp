// A replay of a candump log: it reproduces the bits that the firmware computed, or names what is missing.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <fmt/format.h>

#include "files/text_file.hpp"
#include "tests/end_to_end/run_tool.hpp"

namespace bms {
namespace {

using Json = nlohmann::json;
using ::testing::HasSubstr;

class CanLogTool : public ::testing::Test {
 protected:
  files::TemporaryFolder folder_;
  std::string path(const char* name) const { return (folder_.path() / name).string(); }

  /// The frames of the emulated board for the beginning of the shift, over a wire that loses frames.
  std::string log_of(const std::string& more = "") const {
    const std::string shift = content(BMS_SOURCE_DIR "/evidence/recordings/forklift_shift.csv");
    std::size_t end = 0;
    for (int line = 0; line < 400; ++line) end = shift.find('\n', end) + 1;
    files::write_file(path("part.csv"), shift.substr(0, end));
    const auto r = run_tool("hil --board netduinoplus2 --recording " + path("part.csv") + " --sample-s 1 --candump " +
                            path("truck.log") + " " + more);
    EXPECT_LT(r.exit_code, 2) << r.err;
    return path("truck.log");
  }
  std::string without_lines(const std::string& log, const std::string& with, int from, int count) const {
    std::string kept;
    int seen = 0;
    const std::string text = content(log);
    for (std::size_t at = 0; at < text.size();) {
      const std::size_t end = text.find('\n', at) + 1;
      const std::string line = text.substr(at, end - at);
      at = end;
      if (line.find(with) != std::string::npos && ++seen > from && seen <= from + count) continue;
      kept += line;
    }
    files::write_file(path("cut.log"), kept);
    return path("cut.log");
  }
};

TEST_F(CanLogTool, ReproducesEveryBitThatTheFirmwareComputed) {
  for (const char* more : {"", "--announced-soc 0.7", "--fault drop=0.02@0", "--fault current_open@100-150"}) {
    const std::string log = log_of(more);
    const auto r = run_tool("replay " + log + " --json -");
    ASSERT_EQ(r.exit_code, 0) << more << r.err;
    const Json j = Json::parse(r.out);
    EXPECT_EQ(j["verified_against"], "log") << more;
    EXPECT_GT(j["samples"], 350) << more;
    EXPECT_THAT(run_tool("replay " + log).out, HasSubstr("every bit equal")) << more;
  }
}

TEST_F(CanLogTool, ComparesEveryStateOfAnExtendedCell) {
  if (!std::filesystem::exists(data / "a123_26650")) GTEST_SKIP() << "the real recordings are not there: " << data;
  const auto hil = run_tool("hil --board netduinoplus2 --cell a123_26650_extended --recording " +
                            (data / "a123_26650" / "udds_P25_A002.csv").string() +
                            " --sample-s 1 --announced-soc 1 --candump " + path("truck.log"));
  EXPECT_LT(hil.exit_code, 2) << hil.err;
  const auto r = run_tool("replay " + path("truck.log") + " --cell a123_26650_extended --json -");
  EXPECT_EQ(r.exit_code, 0) << r.err;
  EXPECT_EQ(Json::parse(r.out)["verified_against"], "log");
}

TEST_F(CanLogTool, ReportsAnotherCellFileAndTheFirstDifferentEstimate) {
  const auto r = run_tool("replay " + log_of() + " --cell a123_26650");
  EXPECT_EQ(r.exit_code, 1);
  EXPECT_THAT(r.err, HasSubstr("has cell file"));
  EXPECT_THAT(r.err, HasSubstr("estimates differ from the firmware's at sample"));
}

TEST_F(CanLogTool, FindsAHashWithOneWrongBit) {
  std::string text = content(log_of());
  std::size_t at = 0;
  for (int k = 0; k < 100; ++k) at = text.find(" 19B#", at + 1);  // the hundredth sample's time: a microsecond later
  char& digit = text[at + 5 + 4];
  digit = digit == '0' ? '1' : '0';
  files::write_file(path("turned.log"), text);
  const auto r = run_tool("replay " + path("turned.log") + " --json -");
  EXPECT_EQ(r.exit_code, 0) << "its CRC is wrong: the sample is lost, what came before is compared";
  EXPECT_THAT(r.out, HasSubstr("samples_lost"));
}

TEST_F(CanLogTool, ReportsMissingSamples) {
  const std::string log = log_of();
  const auto lost = run_tool("replay " + without_lines(log, " 19A#", 200, 3) + " --json -");
  EXPECT_EQ(lost.exit_code, 0);
  EXPECT_THAT(lost.out, HasSubstr("samples_lost: samples missing in the log: 3, the first after sample 200"));
  const auto later = run_tool("replay " + without_lines(log, " 199#", 0, 50) + " --json -");
  EXPECT_EQ(later.exit_code, 0);
  EXPECT_THAT(later.out, HasSubstr("log_from_later"));
  EXPECT_TRUE(Json::parse(later.out)["verified_against"].is_null());
  const auto none = run_tool("replay " + without_lines(log, " 19B#", 0, 1'000'000));
  EXPECT_EQ(none.exit_code, 2);
  EXPECT_THAT(none.err, HasSubstr("no samples, expected the frames"));
}

TEST_F(CanLogTool, RefusesHostileBytesInOneLine) {
  files::write_file(path("bad.log"), "(1.0) can0 199#00112233445566");
  EXPECT_EQ(run_tool("replay " + path("bad.log")).exit_code, 2);
  files::write_file(path("bad.gz"), std::string("\x1f\x8b\x08garbage instead of gzip", 25));
  EXPECT_EQ(run_tool("replay " + path("bad.gz")).exit_code, 2);
}

}  // namespace
}  // namespace bms
