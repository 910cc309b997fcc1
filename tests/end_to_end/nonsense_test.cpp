// The tool never answers confidently to nonsense, and never destroys what it reads.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cmath>

#include "tests/end_to_end/run_tool.hpp"

namespace bms {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::MatchesRegex;
using ::testing::Not;

class Nonsense : public ::testing::Test {
 protected:
  std::string path(const std::string& name) const { return (folder_.path() / name).string(); }
  std::string write(const std::string& name, const std::string& text) const {
    std::ofstream(path(name), std::ios::binary) << text;
    return path(name);
  }
  /// An hour of a 6 Ah cell under a load that changes each minute. time_factor: of the time column; voltage_v: instead
  /// of the cell's.
  std::string recording(const std::string& name, double time_factor = 1, double voltage_v = -1) const {
    std::string text = "time_s,current_a,voltage_v\n";
    double soc = 0.8, rc_v = 0;
    for (int k = 0; k < 3'600; ++k) {
      const double current_a = k / 60 % 2 == 0 ? 2 : -6;
      soc += current_a / 3'600 / 6;
      rc_v += (0.008 * current_a - rc_v) * (1 - std::exp(-1 / 12.0));
      const double cell_v = 3.3 + 0.03 * (soc - 0.5) + 0.0132 * current_a + rc_v + 1e-4 * (k % 5);
      text += std::to_string(time_factor * k) + "," + std::to_string(current_a) + "," +
              std::to_string(voltage_v < 0 ? cell_v : voltage_v) + "\n";
    }
    return write(name, text);
  }
  std::size_t files() const {
    return static_cast<std::size_t>(
        std::distance(std::filesystem::directory_iterator(folder_.path()), std::filesystem::directory_iterator{}));
  }

  files::TemporaryFolder folder_;
};

TEST_F(Nonsense, MillisecondsAsSecondsAreAnErrorWithTheCause) {
  const std::string in = recording("ms.csv", 1'000);
  const ToolRun run = run_tool("replay " + in + " --quiet --json " + path("r.json") + " --report " + path("r.html"));
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_THAT(run.err, MatchesRegex("(warning: [^\n]+\n)*[^\n]*ms.csv:1: [^\n]+look like milliseconds[^\n]+: "
                                    "--unit time_s=ms\n"));
  EXPECT_EQ(files(), 1U);
  const ToolRun simulated =
      run_tool("simulate --cell table9 --recording " + in + " --initial-soc 0.8 --out " + path("s.csv"));
  EXPECT_EQ(simulated.exit_code, 2);
  EXPECT_THAT(simulated.err, HasSubstr("look like milliseconds"));
  const ToolRun read = run_tool("ammeter " + in + " --cell table9 --json " + path("a.json"));
  EXPECT_EQ(read.exit_code, 2);
  EXPECT_THAT(read.err, HasSubstr("--unit time_s=ms"));
  EXPECT_EQ(files(), 1U);
}

TEST_F(Nonsense, WithoutAnyVoltageNoVoltageErrorIsReported) {
  const ToolRun run = run_tool("replay " + recording("v0.csv", 1, 0));
  EXPECT_THAT(run.out, AllOf(HasSubstr("The result is not reliable: only 0 of 3600 voltages can be used"),
                             HasSubstr("No voltage was compared"), Not(HasSubstr("0.00 mV"))));
}

TEST_F(Nonsense, AFailedFitIsExitCode1AndWritesNothing) {
  const std::string dead = recording("v0.csv", 1, 0);
  const ToolRun run = run_tool("identify --recording " + dead + " --start table9 --initial-soc 0.8 --out " +
                               path("bad.toml") + " --json " + path("bad.json") + " --report " + path("bad.html"));
  EXPECT_EQ(run.exit_code, 1) << run.err;
  EXPECT_THAT(run.err, HasSubstr("v0.csv:1: the identification failed: "));
  EXPECT_EQ(files(), 1U);
  std::string text = content(recording("e308.csv"));
  text.replace(text.find("\n300."), 1, "\n299.5,1,1e308\n");
  const ToolRun huge =
      run_tool("identify --recording " + write("e308.csv", text) + " --initial-soc 0.8 --out " + path("bad.toml"));
  EXPECT_EQ(huge.exit_code, 2) << "no instrument measures that";
  EXPECT_EQ(files(), 2U);
}

TEST_F(Nonsense, AnInputIsNeverOverwritten) {
  const std::string csv = recording("a.csv"), before = content(csv);
  const std::string cell = write("b.toml", content(BMS_SOURCE_DIR "/model/cells/table9.toml")),
                    cell_text = content(cell);
  std::filesystem::create_symlink(csv, path("link"));
  std::filesystem::create_hard_link(csv, path("other_name"));
  const std::string other_way = folder_.path().string() + "/./../" + folder_.path().filename().string() + "/a.csv";
  for (const std::string& arguments :
       {"replay " + csv + " --trace " + csv, "replay " + csv + " --json " + csv, "replay " + csv + " --report " + csv,
        "replay " + csv + " --json " + path("link"), "replay " + csv + " --json " + path("other_name"),
        "replay " + csv + " --json " + other_way, "replay " + csv + " --cell " + cell + " --json " + cell,
        "simulate --cell " + cell + " --recording " + csv + " --out " + cell,
        "simulate --cell " + cell + " --recording " + csv + " --out " + csv,
        "diagnose --cell " + cell + " --recording " + csv + " --report " + csv,
        "diagnose --cell " + cell + " --recording " + csv + " --out " + cell,
        "identify --start " + cell + " --recording " + csv + " --out " + cell,
        "identify --recording " + csv + " --validate " + csv + " --out " + csv}) {
    const ToolRun run = run_tool(arguments + " --quiet");
    EXPECT_EQ(run.exit_code, 2) << arguments;
    EXPECT_THAT(run.err, MatchesRegex("[^\n]+:1: is an input and would be overwritten[^\n]+\n")) << arguments;
  }
  EXPECT_EQ(content(csv), before);
  EXPECT_EQ(content(cell), cell_text);
}

TEST_F(Nonsense, TwoResultsForOneFileAreRefused) {
  const std::string csv = recording("a.csv");
  const ToolRun run = run_tool("replay " + csv + " --json " + path("x") + " --report " + path("./x"));
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_THAT(run.err, HasSubstr("two results for one file"));
  EXPECT_EQ(files(), 1U);
  EXPECT_EQ(run_tool("replay " + csv + " --json /dev/null --report /dev/null").exit_code, 0);
}

TEST_F(Nonsense, AMonitorKeepsTheLogThatItReadsAndAFileThatItCannotFill) {
  const std::string log = write("m.log", "(1.000000) can0 123#00\n"), old = write("old.csv", "precious\n");
  const std::string text = write("text", "no frame\n");
  for (const char* option : {"--record", "--csv", "--json"}) {
    const ToolRun run = run_tool("monitor --quiet file:" + log + " " + option + " " + log);
    EXPECT_EQ(run.exit_code, 2) << option;
    EXPECT_THAT(run.err, HasSubstr("is an input and would be overwritten")) << option;
    EXPECT_EQ(content(log), "(1.000000) can0 123#00\n") << option;
    EXPECT_EQ(run_tool("monitor --quiet file:" + text + " " + option + " " + old).exit_code, 2) << option;
    EXPECT_EQ(content(old), "precious\n") << option;
    EXPECT_EQ(run_tool("monitor --quiet file:" + text + " " + option + " " + path("new")).exit_code, 2) << option;
    EXPECT_FALSE(std::filesystem::exists(path("new"))) << option;
  }
  ASSERT_EQ(run_tool("monitor --quiet file:" + log + " --record " + old).exit_code, 0);
  EXPECT_EQ(content(old), "(0000000001.000000) can0 123#00\n");
}

TEST_F(Nonsense, ASummaryThatCannotBePrintedIsAnError) {
  const std::string csv = recording("a.csv");
  const auto code = [](const std::string& command) { return WEXITSTATUS(std::system(command.c_str())); };
  const std::string tool = "'" BMS_TOOL "' ";
  EXPECT_EQ(code(tool + "replay " + csv + " >/dev/full 2>/dev/null"), 2) << "a full disk";
  EXPECT_EQ(code(tool + "replay " + csv + " >&- 2>/dev/null"), 2) << "closed";
  EXPECT_EQ(code(tool + "--help >/dev/full 2>/dev/null"), 2);
  EXPECT_EQ(code("{ sleep 0.2; " + tool + "replay " + csv + " 2>/dev/null; echo $? >" + path("code") + "; } | true"),
            0);
  EXPECT_EQ(content(path("code")), "2\n") << "a closed pipe";
}

TEST_F(Nonsense, APipeAsARecordingIsRefusedAtOnce) {
  ASSERT_EQ(mkfifo(path("pipe").c_str(), 0600), 0);
  const ToolRun run = run_tool("replay " + path("pipe"));
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_THAT(run.err, HasSubstr("a pipe or a device, expected a regular file"));
}

TEST_F(Nonsense, AFileNameDoesNotReachTheTerminalAsEscapeCodes) {
  const std::string name = "x\x1b]0;own\x07.csv";
  std::string text = content(recording("a.csv"));
  text.insert(text.find('\n'), ",operator");
  for (std::size_t at = text.find('\n') + 1; (at = text.find('\n', at)) != std::string::npos; at += 3)
    text.insert(at, ",1");
  write(name, text);
  const ToolRun run = run_tool("replay '" + path(name) + "'");
  EXPECT_EQ(run.exit_code, 0);
  EXPECT_THAT(run.err, AllOf(HasSubstr("columns not used"), Not(HasSubstr("\x1b")), Not(HasSubstr("\x07"))));
}

TEST_F(Nonsense, ABoardIsAFolderOfBoardsAndAProbeAFileOfOpenOcd) {
  std::filesystem::create_directory(path("evil"));
  write("evil/board.cmake", "file(WRITE \"" + path("owned") +
                                "\" x)\nset(BMS_PROBE stlink)\nset(BMS_PROBE_TARGET x)\n"
                                "set(BMS_EMULATED OFF)\nset(BMS_DEFAULT_CELL table9)\nset(BMS_CELLS 1)\n");
  const std::string up = std::filesystem::relative(path("evil"), BMS_SOURCE_DIR "/boards").string();
  for (const std::string& board : {up, path("evil"), std::string("."), std::string("")}) {
    const ToolRun run = run_tool("flash --dry-run --board '" + board + "'");
    EXPECT_EQ(run.exit_code, 2) << board;
    EXPECT_THAT(run.err, HasSubstr("no such board")) << board;
  }
  EXPECT_FALSE(std::filesystem::exists(path("owned")));
  for (const char* option : {"--probe ../x", "--probe /x", "--probe 'a b'", "--serial '[exec id]'", "--serial 'a;b'"}) {
    const ToolRun run = run_tool(std::string("flash --dry-run ") + option);
    EXPECT_EQ(run.exit_code, 2) << option;
    EXPECT_THAT(run.err, MatchesRegex("--(probe|serial):1: [^\n]+\n")) << option;
  }
}

}  // namespace
}  // namespace bms
