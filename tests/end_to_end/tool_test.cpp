// The tool from the outside: exit codes, one-line errors, complete files, reproducible output.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <regex>

#include "tests/end_to_end/run_tool.hpp"

namespace bms {
namespace {

using ::testing::HasSubstr;
using ::testing::MatchesRegex;

class Tool : public ::testing::Test {
 protected:
  std::string path(const std::string& name) const { return (folder_.path() / name).string(); }
  std::string write(const std::string& name, const std::string& text) const {
    std::ofstream(path(name), std::ios::binary) << text;
    return path(name);
  }
  std::size_t files() const {
    return static_cast<std::size_t>(
        std::distance(std::filesystem::directory_iterator(folder_.path()), std::filesystem::directory_iterator{}));
  }

 private:
  files::TemporaryFolder folder_;
};

TEST_F(Tool, HelpOfEveryCommandShowsAnExample) {
  EXPECT_THAT(run_tool("--help").out, HasSubstr("replay"));
  for (const char* command : {"replay", "simulate", "experiment", "identify", "diagnose", "study", "proof", "hil",
                              "flash", "monitor", "log"}) {
    const ToolRun run = run_tool(std::string(command) + " --help");
    EXPECT_EQ(run.exit_code, 0);
    EXPECT_THAT(run.out, HasSubstr(std::string("Example: bms ") + command));
    EXPECT_EQ(run.err, "");
  }
}

TEST_F(Tool, BadUsageIsOneLineAndExitCode2) {
  const std::vector<std::string> wrong = {
      "",
      "no_such_command",
      "replay",
      "replay " + shift + " --no-such-option",
      "replay " + shift + " --initial-soc 80",
      "replay " + shift + " --scalar half",
      "replay " + shift + " --target no_such_board",
      "replay " + shift + " --verify",
      "replay " + shift + " --cell no_such_cell",
      "replay /no/such/recording.csv",
      "replay /",
      "simulate --cell table9 --out x.csv",
      "experiment no_such_experiment --out x.csv",
      "--processors 0 replay " + shift,
      "--processors many replay " + shift,
  };
  for (const std::string& arguments : wrong) {
    const ToolRun run = run_tool(arguments);
    EXPECT_EQ(run.exit_code, 2) << arguments;
    EXPECT_THAT(run.err, MatchesRegex("[^\n]+\n")) << arguments;
    EXPECT_EQ(run.out, "") << arguments;
  }
}

TEST_F(Tool, ABadRecordingIsRefusedInOneLineAndLeavesNothingBehind) {
  const std::string bad = write("bad.csv", "time_s,current_a,voltage_v\n0,0,3.3\n1,x,3.3\n");
  const ToolRun run = run_tool("replay " + bad + " --json " + path("r.json") + " --trace " + path("t.csv") +
                               " --report " + path("p.html"));
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_EQ(run.err, bad + ":3: 'x' in column 'current_a' is not a number, expected a number or nothing\n");
  EXPECT_EQ(files(), 1U) << "only the recording itself";
}

TEST_F(Tool, AnUnwritablePlaceIsRefusedInOneLine) {
  const ToolRun run = run_tool("replay " + shift + " --json /no/such/folder/r.json");
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_THAT(run.err, MatchesRegex("/no/such/folder/r.json:1: [^\n]+\n"));
}

TEST_F(Tool, TheSameReplayGivesTheSameBytes) {
  for (const char* scalar : {"float", "fixed", "double"}) {
    const std::string arguments = "replay " + shift + " --initial-soc 0.98 --scalar " + scalar;
    const ToolRun a = run_tool(arguments + " --json - --trace " + path("a.csv") + " --report " + path("a.html"));
    const ToolRun b = run_tool(arguments + " --json - --trace " + path("b.csv") + " --report " + path("b.html"));
    ASSERT_EQ(a.exit_code, 0) << a.err;
    EXPECT_EQ(reproducible(a.out), reproducible(b.out));
    EXPECT_EQ(content(path("a.csv")), content(path("b.csv")));
    EXPECT_EQ(content(path("a.html")), content(path("b.html")));
    EXPECT_THAT(a.out, HasSubstr("\"command\": \"replay\""));
  }
}

TEST_F(Tool, TraceHashIsThatOfTheTraceFile) {
  const ToolRun run = run_tool("replay " + shift + " --json - --trace " + path("t.csv"));
  EXPECT_EQ(std::system(("sha256sum " + path("t.csv") + " > " + path("sum")).c_str()), 0);
  EXPECT_THAT(run.out, HasSubstr("\"trace_sha256\": \"" + content(path("sum")).substr(0, 64) + "\""));
}

TEST_F(Tool, QuietPrintsNothing) {
  const ToolRun run = run_tool("replay " + shift + " --quiet");
  EXPECT_EQ(run.exit_code, 0);
  EXPECT_EQ(run.out + run.err, "");
}

TEST_F(Tool, WarningsAreOnStandardErrorAndInTheJson) {
  std::string text = "time_s,current_a,voltage_v\n";
  for (int k = 0; k < 20; ++k) text += std::to_string(k) + "," + (k % 4 < 2 ? "-1,3.30" : "0,3.31") + "\n";
  text += "900,0,3.31\n";
  const ToolRun run = run_tool("replay " + write("gap.csv", text) + " --json -");
  EXPECT_EQ(run.exit_code, 0);
  EXPECT_THAT(run.err, HasSubstr("gaps longer than 10 s: 1,"));
  EXPECT_THAT(run.out, HasSubstr("\"gap: gaps longer than 10 s: 1,"));
}

TEST_F(Tool, AReplayOfASimulatedProfileReproducesItsStateOfCharge) {
  ASSERT_EQ(run_tool("experiment forklift_shift --out " + path("p.csv")).exit_code, 0);
  ASSERT_EQ(run_tool("simulate --cell table9 --profile " + path("p.csv") + " --initial-soc 0.95 --out " + path("s.csv"))
                .exit_code,
            0);
  EXPECT_TRUE(content(path("s.csv")).starts_with("time_s,current_a,voltage_v,soc,soc_ref\n"));
  const ToolRun run = run_tool("replay " + path("s.csv") + " --initial-soc 0.95 --json -");
  ASSERT_EQ(run.exit_code, 0) << run.err;
  // The voltage is the model's own, written with ten digits and read in microvolts. The first one moves the start a
  // little, since what an earlier load may have left is not the same above and below 95 %.
  std::smatch found;
  ASSERT_TRUE(std::regex_search(run.out, found, std::regex("\"prediction_rmse_v\": ([-0-9.e]+)")));
  EXPECT_LT(std::stod(found[1]), 2e-5);
}

/// A mechanism gives the same voltage from a cell file and from the command line. A replay with the same cell corrects
/// nothing but the start, as above.
TEST_F(Tool, AMechanismFromACellFileOrFromTheCommandLineIsSimulatedAndReplayed) {
  const std::string cell = write(
      "e.toml", content(BMS_SOURCE_DIR "/model/cells/table9.toml") +
                    "\n[mechanism.slow_polarisation]\nresistance_ohm = 0.004\ntime_constant_s = "
                    "900\n[mechanism.temperature_resistance]\nr0_activation_j_per_mol = 20000\n"
                    "[instrument.current_offset]\noffset_a = 0.02\n[instrument.voltage_gain]\ngain_error = 0.002\n");
  const std::string input = " --recording " + shift + " --initial-soc 0.98 --quiet --out ";
  ASSERT_EQ(run_tool("simulate --cell " + cell + input + path("a.csv")).exit_code, 0);
  const ToolRun run = run_tool(
      "simulate --cell table9 --with slow_polarisation:resistance_ohm=0.004,time_constant_s=900 --with "
      "current_offset:offset_a=0.02"
      " --with temperature_resistance:r0_activation_j_per_mol=2e4 --with voltage_gain:gain_error=0.002" +
      input + path("b.csv"));
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_EQ(content(path("a.csv")), content(path("b.csv")));
  run_tool("simulate --cell table9" + input + path("plain.csv"));
  EXPECT_NE(content(path("a.csv")), content(path("plain.csv")));
  const ToolRun replay = run_tool("replay " + path("a.csv") + " --cell " + cell +
                                  " --initial-soc 0.98 --scalar double --json - --trace " + path("t.csv"));
  ASSERT_EQ(replay.exit_code, 0) << replay.err;
  std::smatch found;
  ASSERT_TRUE(std::regex_search(replay.out, found, std::regex("\"prediction_rmse_v\": ([-0-9.e]+)")));
  EXPECT_LT(std::stod(found[1]), 3e-5);
  ASSERT_TRUE(std::regex_search(replay.out, found, std::regex("\"open_loop_rmse_v\": ([-0-9.e]+)")));
  EXPECT_LT(std::stod(found[1]), 1e-8);
  EXPECT_TRUE(content(path("t.csv"))
                  .starts_with("time_s,soc,soc_sigma,v_rc_v,voltage_predicted_v,voltage_measured_v,slow_polarisation_1_"
                               "v,slow_polarisation_2_v,flags\n"));
}

/// Rests of ten minutes between loads, with a voltage that no cell file describes.
TEST_F(Tool, ACorrectionOfTheCurrentByItsReadingAtRestStatesItsCondition) {
  std::string log = "time_s,current_a,voltage_v\n";
  for (int k = 0; k < 3'600; ++k)
    log += std::to_string(k) + (k % 1'200 < 600 ? ",-0.10" : ",-2.0") + std::to_string(k % 3) + ",3." +
           std::to_string(k % 7) + "\n";
  const ToolRun run = run_tool("ammeter " + write("log.csv", log) + " --json " + path("a.json"));
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("CURRENT_MEASURED_BY_USER"));
  EXPECT_THAT(run.out, HasSubstr("\ncondition: if no current flows during the 30 minutes of rest"));
  EXPECT_THAT(content(path("a.json")), HasSubstr("\"where\": \"condition\""));
}

/// The sensor reads what flows, the cell loses more.
TEST_F(Tool, ALeakageIsNotCorrectedAtTheCurrentSensor) {
  run_tool("simulate --cell table9 --recording " + shift + " --initial-soc 0.98 --quiet --out " + path("leak.csv") +
           " --with leakage:current_a=0.25 --noise-v 0.001");
  const ToolRun run = run_tool("ammeter " + path("leak.csv") + " --json " + path("a.json"));
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("The charge balance is short by"));
  EXPECT_THAT(run.out, HasSubstr("leakage, internal short circuit"));
  EXPECT_THAT(run.out, ::testing::Not(HasSubstr("current-offset")));
  EXPECT_THAT(run.out, ::testing::Not(HasSubstr("CURRENT_MEASURED_BY_USER")));
  EXPECT_THAT(content(path("a.json")), HasSubstr("\"enter\": []"));
  std::string open = "time_s,current_a\n";
  for (int k = 0; k < 600; ++k) open += std::to_string(k) + ",0.00" + std::to_string(k % 3) + "\n";
  const ToolRun decided = run_tool("ammeter " + path("leak.csv") + " --open-contactors " + write("open.csv", open));
  ASSERT_EQ(decided.exit_code, 0) << decided.err;
  EXPECT_THAT(decided.out, HasSubstr("Do not correct the sensor for it"));
}

TEST_F(Tool, AShiftOfTheInitialSocIsAddedToThePrior) {
  const std::string input = "simulate --cell table9 --recording " + shift + " --quiet --out ";
  run_tool(input + path("a.csv") + " --initial-soc 0.9 --with initial_soc:shift=0.05");
  run_tool(input + path("b.csv") + " --initial-soc 0.95");
  EXPECT_EQ(content(path("a.csv")), content(path("b.csv")));
}

TEST_F(Tool, AMisspeltOptionIsNamedWithTheNearestOne) {
  const std::pair<const char*, const char*> wrong[] = {
      {"replay x.csv --repot x.html",
       "bms: no such option '--repot', expected one of those of bms replay --help; did you mean --report\\?"},
      {"cell show table9 --jsn=-",
       "bms: no such option '--jsn', expected one of those of bms cell --help; did you mean --json\\?"},
      {"replay x.csv --nothing-like-it", "bms: no such option '--nothing-like-it', expected one of .*--help"}};
  for (const auto& [arguments, what] : wrong) {
    const ToolRun run = run_tool(arguments);
    EXPECT_EQ(run.exit_code, 2) << arguments;
    EXPECT_THAT(run.err, MatchesRegex(std::string(what) + "\n")) << arguments;
  }
}

TEST_F(Tool, ShowHasTheFindingsOfAnExtendedCell) {
  std::string cell = content(BMS_SOURCE_DIR "/model/cells/table9.toml");
  cell += "\n[mechanism.capacity_change]\nloss_fraction = 0.149\nloss_fraction_std = 0.014\n";
  const std::string file = write("x.toml", cell);
  const ToolRun show = run_tool("cell show " + file);
  ASSERT_EQ(show.exit_code, 0) << show.err;
  EXPECT_THAT(show.out, HasSubstr("6 Ah, with the findings below 5.11 Ah"));
  EXPECT_THAT(show.out, HasSubstr("loss_fraction 0.149 +- 0.014"));
  ASSERT_EQ(run_tool("cell plot " + file + " --report " + path("x.html")).exit_code, 0);
  EXPECT_THAT(content(path("x.html")), HasSubstr("loss_fraction 0.149 +- 0.014"));
}

TEST_F(Tool, CutsAreSummarisedInWords) {
  const ToolRun run = run_tool("replay " + shift + " --cuts 3");
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("3 cuts of "));
  EXPECT_THAT(run.out, HasSubstr("  unknown: the median error of the state of charge is "));
  EXPECT_THAT(run.out, ::testing::Not(HasSubstr("|"))) << "no table of 250 columns";
}

TEST_F(Tool, ATruncatedRecordingIsNotTakenForALogOfFrames) {
  const std::string whole = path("s.csv.gz");
  ASSERT_EQ(std::system(("gzip -c " + shift + " > " + whole).c_str()), 0);
  const std::string bytes = content(whole);
  const ToolRun run = run_tool("replay " + write("cut.csv.gz", bytes.substr(0, bytes.size() / 2)));
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_THAT(run.err, HasSubstr("truncated gzip input"));
}

TEST_F(Tool, TemperaturesInKelvinAreNamed) {
  std::string log = "time_s,current_a,voltage_v,temperature_c\n";
  for (int k = 0; k < 600; ++k)
    log += std::to_string(k) + (k % 60 < 30 ? ",0," : ",-3,") + (k % 60 < 30 ? "3.30" : "3.26") + ",296.5\n";
  const ToolRun run = run_tool("diagnose --cell table9 --recording " + write("k.csv", log));
  EXPECT_THAT(run.err, HasSubstr("look like kelvin"));
}

TEST_F(Tool, AnInvalidMechanismIsRefusedInOneLineThatListsTheValidOnes) {
  const std::pair<const char*, const char*> wrong[] = {
      {"hysteresis:half_gap_v=0.01", "no such mechanism 'hysteresis', expected one of: channel_skew, .*voltage_gain"},
      {"ocv_hysteresis", "'ocv_hysteresis' without parameters, expected ID:param=value,\\.\\.\\."},
      {"ocv_hysteresis:gap=0.01",
       "no such parameter 'gap' of ocv_hysteresis, expected one of: half_gap_v, decay, ocv_at, initial, measured"},
      {"ocv_hysteresis:half_gap_v=", "no value of 'half_gap_v', expected half_gap_v=NUMBER"},
      {"ocv_hysteresis:half_gap_v=0.01,decay=x", "no value of 'decay', expected decay=NUMBER"},
      {"ocv_hysteresis:half_gap_v=1", "'half_gap_v' is out of range, expected 0 to 0.07 V"}};
  for (const auto& [with, what] : wrong) {
    const ToolRun run =
        run_tool("simulate --cell table9 --recording " + shift + " --out " + path("x.csv") + " --with " + with);
    EXPECT_EQ(run.exit_code, 2) << with;
    EXPECT_THAT(run.err, MatchesRegex(std::string("--with:1: ") + what + "\n")) << with;
  }
  EXPECT_EQ(files(), 0U);
}

TEST_F(Tool, AReplayNamesTheMechanismsThatTheEstimatorLeavesOut) {
  const std::string cell =
      write("e.toml", content(BMS_SOURCE_DIR "/model/cells/table9.toml") +
                          "\n[instrument.channel_skew]\ndelay_s = 1\n[mechanism.charge_transfer]\nr0_share = 0.2\n");
  ToolRun run = run_tool("replay " + shift + " --cell " + cell + " --quiet");
  EXPECT_EQ(run.exit_code, 0);
  EXPECT_THAT(run.err,
              MatchesRegex("warning: [^\n]*channel_skew: in the cell file, but the estimator leaves it out[^\n]*\n"));
  run = run_tool("replay " + shift + " --cell " + cell + " --quiet --scalar fixed");
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_THAT(run.err, HasSubstr("'mechanism.charge_transfer' cannot be computed in fixed point"));
}

TEST_F(Tool, SimulatedNoiseHasTheRequestedSizeAndDependsOnTheSeed) {
  ASSERT_EQ(run_tool("experiment forklift_shift --out " + path("p.csv")).exit_code, 0);
  const std::string simulate =
      "simulate --cell table9 --profile " + path("p.csv") + " --initial-soc 0.95 --noise-v 0.002 --out ";
  run_tool(simulate + path("a.csv"));
  run_tool(simulate + path("b.csv"));
  run_tool(simulate + path("c.csv") + " --seed 2");
  EXPECT_EQ(content(path("a.csv")), content(path("b.csv")));
  EXPECT_NE(content(path("a.csv")), content(path("c.csv")));
  const ToolRun run = run_tool("replay " + path("a.csv") + " --initial-soc 0.95 --json -");
  std::smatch found;
  ASSERT_TRUE(std::regex_search(run.out, found, std::regex("\"open_loop_rmse_v\": ([-0-9.e]+)")));
  EXPECT_NEAR(std::stod(found[1]), 0.002, 0.0001);
}

/// The rows of a table without its header.
std::vector<std::vector<double>> table_of(const std::string& csv) {
  std::vector<std::vector<double>> rows;
  std::istringstream lines(csv);
  std::string line;
  for (std::getline(lines, line); std::getline(lines, line);) {
    rows.emplace_back();
    std::istringstream cells(line);
    for (std::string cell; std::getline(cells, cell, ',');) rows.back().push_back(std::stod(cell));
  }
  return rows;
}

TEST_F(Tool, ASimulationWithItsIntervalStatesHowManyReadingsItContains) {
  std::string text = "time_s,current_a,voltage_v\n";
  for (int k = 0; k < 3'000; ++k) {
    const double current_a = k / 300 % 2 == 0 ? 0 : -3;
    // half of the time far from any voltage that table9 could have
    text +=
        std::to_string(k) + "," + std::to_string(current_a) + "," + std::to_string(k % 600 < 300 ? 3.286 : 3.0) + "\n";
  }
  const std::string simulate = "simulate --cell table9 --initial-soc 0.5 --recording " + write("r.csv", text) +
                               " --json " + path("r.json") + " --report " + path("r.html") + " --out ";
  ASSERT_EQ(run_tool(simulate + path("plain.csv")).exit_code, 0);
  EXPECT_THAT(content(path("r.json")), HasSubstr("\"coverage\": null"));
  EXPECT_THAT(content(path("r.html")), Not(HasSubstr("95 % interval")));
  EXPECT_TRUE(content(path("plain.csv")).starts_with("time_s,current_a,voltage_v,soc,soc_ref\n"));
  const ToolRun run = run_tool(simulate + path("s.csv") + " --interval");
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const std::string csv = content(path("s.csv"));
  EXPECT_TRUE(csv.starts_with("time_s,current_a,voltage_v,soc,voltage_std_v,soc_ref\n"));
  EXPECT_THAT(content(path("r.html")), HasSubstr("simulated with its 95 % interval, V"));
  EXPECT_THAT(run.out, HasSubstr("The 95 % interval of the prediction contains "));
  EXPECT_THAT(run.out, HasSubstr(" % of the readings of r.csv;"));
  const auto simulated = table_of(csv), plain = table_of(content(path("plain.csv"))), measured = table_of(text);
  ASSERT_EQ(simulated.size(), measured.size());
  double within = 0;
  for (std::size_t k = 0; k < simulated.size(); ++k) {
    ASSERT_EQ(simulated[k][2], plain[k][2]);
    within += std::abs(measured[k][2] - simulated[k][2]) <= 1.96 * simulated[k][4] ? 1 : 0;
  }
  std::smatch found;
  const std::string json = content(path("r.json"));
  ASSERT_TRUE(std::regex_search(json, found, std::regex("\"nominal\": 0.95,\\s*\"recording\": ([0-9.]+)")));
  EXPECT_NEAR(std::stod(found[1]), within / 3'000, 1e-3);
  EXPECT_GT(within, 500);
  EXPECT_LT(within, 2'500);
}

TEST_F(Tool, AnIntervalNeedsNoMeasuredVoltageAndIsNotThatOfAPack) {
  std::string drive = "time_s,current_a,temperature_c\n", cells = "time_s,current_a,v_1,v_2\n";
  for (int k = 0; k < 20; ++k) {
    drive += std::to_string(k) + ",-3,25\n";
    cells += std::to_string(k) + ",-3,3.2,3.2\n";
  }
  const std::string profile = write("p.csv", drive), pack = write("pack.csv", cells);
  const ToolRun run =
      run_tool("simulate --cell table9 --profile " + profile + " --interval --json - --out " + path("s.csv"));
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("\"coverage\": null"));
  EXPECT_TRUE(
      content(path("s.csv")).starts_with("time_s,current_a,voltage_v,soc,temperature_c,voltage_std_v,soc_ref\n"));
  for (const auto& row : table_of(content(path("s.csv")))) EXPECT_GT(row[5], 0.001);
  const std::string refused =
      "simulate --cell table9 --recording " + pack + " --interval --quiet --out " + path("x.csv");
  const ToolRun of_pack = run_tool(refused);
  EXPECT_EQ(of_pack.exit_code, 2);
  EXPECT_THAT(of_pack.err, MatchesRegex("(warning: [^\n]*\n)*--interval:1: not for the recording of a pack, [^\n]*\n"));
  EXPECT_FALSE(std::filesystem::exists(path("x.csv")));
  EXPECT_EQ(run_tool(refused + " --map voltage_v=v_1").exit_code, 0);
}

}  // namespace
}  // namespace bms
