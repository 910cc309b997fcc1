// The emulated board against the host: every bit, real recordings and the shift, and a difference when there is one.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/end_to_end/run_tool.hpp"
#include "tests/host_sim/refusal.hpp"

namespace bms {
namespace {

using ::testing::HasSubstr;

const std::string shift = BMS_SOURCE_DIR "/recordings/forklift_shift.csv";
const std::filesystem::path data = BMS_DATA_DIR;
const std::string on_board = " --target netduinoplus2 --verify ";

TEST(Board, ComputesTheShiftBitForBitLikeTheHost) {
  const ToolRun run = run_tool("replay " + shift + on_board);
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("Verified: 28801 estimates, every bit equal on netduinoplus2."));
}

TEST(Board, TraceIsTheHostsTrace) {
  const TemporaryFolder folder;
  const std::string host = (folder.path() / "h.csv").string(), board = (folder.path() / "b.csv").string();
  ASSERT_EQ(run_tool("replay " + shift + " --initial-soc 0.9 --initial-soc-sigma 0.1 --trace " + host).exit_code, 0);
  ASSERT_EQ(run_tool("replay " + shift + " --initial-soc 0.9 --initial-soc-sigma 0.1 --target netduinoplus2 --trace " + board).exit_code, 0);
  EXPECT_EQ(content(host), content(board));
  EXPECT_GT(content(host).size(), 1'000'000U);
}

TEST(Board, ComputesARealRecordingBitForBitLikeTheHost) {
  if (!std::filesystem::exists(data)) GTEST_SKIP() << "the real recordings are not there: " << data;
  for (const char* file : {"a123_26650/udds_P25_A002.csv", "a123_26650/pulse_P25_A002.csv", "a123_26650/dyn10_N15_A002.csv", "a123_26650/ocv_P05_chg.csv"}) {
    const ToolRun run = run_tool("replay " + (data / file).string() + " --cell a123_26650" + on_board);
    EXPECT_EQ(run.exit_code, 0) << file << ": " << run.err;
    EXPECT_THAT(run.out, HasSubstr("every bit equal")) << file;
  }
}

TEST(Board, AnIdentifiedCellGoesThroughTheGeneratorAndComputesTheSameBits) {
  const TemporaryFolder folder;
  const std::string cell = (folder.path() / "identified.toml").string();
  ASSERT_EQ(run_tool("identify --recording " + shift + " --out " + cell).exit_code, 0);
  const ToolRun run = run_tool("replay " + shift + on_board + " --cell " + cell);
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("every bit equal"));
}

/// table9 with R0 at 90 % one float step larger: 0.0135692 is 0x3c5e5128 as a float.
TEST(Board, OneParameterOneUnitInTheLastPlaceOffIsFoundAndNamed) {
  const TemporaryFolder folder;
  const auto other = folder.path() / "ulp.toml";
  ASSERT_EQ(std::nextafter(0.0135692F, 1.0F), 0.013569201F);
  ASSERT_NE(0.0135692F, 0.013569201F);
  std::ofstream(other) << replaced(replaced(content(BMS_SOURCE_DIR "/model/cells/table9.toml"), "0.0135692, ", "0.013569201, "), "\"table9\"", "\"ulp\"");
  const ToolRun run = run_tool("replay " + shift + on_board + " --board-cell " + other.string());
  EXPECT_EQ(run.exit_code, 1);
  EXPECT_THAT(run.err, ::testing::MatchesRegex(".*host and netduinoplus2 differ first at sample [0-9]+ \\(time [0-9]+ s\\) in [a-z_]+: host [^\n]+\n"));
}

TEST(Board, ACellThatIsOutOfRangeIsRefusedByTheFirmwareBuild) {
  const TemporaryFolder folder;
  const auto bad = folder.path() / "bad.toml";
  std::ofstream(bad) << replaced(content(BMS_SOURCE_DIR "/model/cells/table9.toml"), "0.0140197", "0.9");
  const std::string log = (folder.path() / "log").string();
  const int status = std::system(("\"" BMS_CELL_HEADER_TOOL "\" " + bad.string() + " " + (folder.path() / "out.hpp").string() + " 2> " + log).c_str());
  EXPECT_EQ(WEXITSTATUS(status), 2);
  EXPECT_THAT(content(log), HasSubstr("'rc.r0_ohm' is out of range"));
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "out.hpp"));
}

}  // namespace
}  // namespace bms
