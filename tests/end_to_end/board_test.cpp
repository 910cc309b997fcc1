// The emulated board compared with the host, bit by bit, on real recordings and the shift.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/end_to_end/run_tool.hpp"
#include "tests/host_sim/files/rejected_input.hpp"

namespace bms {
namespace {

using ::testing::HasSubstr;

const std::string on_board = " --target netduinoplus2 --verify ";

TEST(Board, ComputesTheShiftBitForBitLikeTheHost) {
  const ToolRun run = run_tool("replay " + shift + on_board);
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("Verified: 28801 estimates, every bit equal on netduinoplus2."));
}

/// 20 minutes of rest before and after each of six charges and discharges of a cell with 78 % of its file's capacity.
std::string profile_of_a_worn_cell() {
  std::string rows = "time_s,current_a,temperature_c\n";
  double soc = 0.97;
  int time_s = 0;
  const auto second = [&](double current_a) {
    soc += current_a / (0.78 * 6 * 3'600);
    rows += std::to_string(++time_s) + "," + std::to_string(current_a) + ",25\n";
  };
  const auto rest = [&] {
    for (int k = 0; k < 1'200; ++k) second(0);
  };
  rest();
  for (int turn = 0; turn < 6; ++turn) {
    for (int k = 0; turn % 2 == 0 && soc > 0.03; ++k) second(k % 60 < 40 ? -5 : -1);
    while (turn % 2 == 1 && soc < 0.97) second(3);
    rest();
  }
  return rows;
}

/// A number in a row of a CSV file.
double value_in(const std::string& row, int column) {
  std::size_t from = 0;
  for (int k = 0; k < column; ++k) from = row.find(',', from) + 1;
  return std::stod(row.substr(from));
}

TEST(Board, CountsWithTheCapacityThatItLearnsBitForBitLikeTheHost) {
  const files::TemporaryFolder folder;
  const std::string profile = (folder.path() / "profile.csv").string(), worn = (folder.path() / "worn.csv").string(),
                    trace = (folder.path() / "trace.csv").string();
  std::ofstream(profile) << profile_of_a_worn_cell();
  ASSERT_EQ(run_tool("simulate --cell table9 --initial-soc 0.97 --with capacity_change:loss_fraction=0.22 --noise-v "
                     "0.001 --noise-a 0.01 --seed 3 --profile " +
                     profile + " --out " + worn)
                .exit_code,
            0);
  for (const char* board : {"netduinoplus2 --scalar float", "microbit --scalar fixed"}) {
    const ToolRun run = run_tool("replay " + worn + " --verify --trace " + trace + " --target " + board);
    EXPECT_EQ(run.exit_code, 0) << run.err;
    EXPECT_THAT(run.out, HasSubstr("every bit equal")) << board;
    std::ifstream estimates(trace), truth(worn);
    std::string estimate, row;
    double largest = 0;
    for (int k = 0; std::getline(estimates, estimate) && std::getline(truth, row); ++k) {
      if (k > 25'000) largest = std::max(largest, std::abs(value_in(estimate, 1) - value_in(row, 3)));
    }
    EXPECT_LT(largest, 0.03) << board << ": 12 % as long as the capacity is not known";
    EXPECT_GT(largest, 0);
  }
}

TEST(Board, TraceIsTheHostsTrace) {
  const files::TemporaryFolder folder;
  const std::string host = (folder.path() / "h.csv").string(), board = (folder.path() / "b.csv").string();
  ASSERT_EQ(run_tool("replay " + shift + " --initial-soc 0.9 --initial-soc-sigma 0.1 --trace " + host).exit_code, 0);
  ASSERT_EQ(
      run_tool("replay " + shift + " --initial-soc 0.9 --initial-soc-sigma 0.1 --target netduinoplus2 --trace " + board)
          .exit_code,
      0);
  EXPECT_EQ(content(host), content(board));
  EXPECT_GT(content(host).size(), 1'000'000U);
}

TEST(Board, ComputesARealRecordingBitForBitLikeTheHost) {
  if (!std::filesystem::exists(data)) GTEST_SKIP() << "the real recordings are not there: " << data;
  for (const char* file : {"a123_26650/udds_P25_A002.csv", "a123_26650/pulse_P25_A002.csv",
                           "a123_26650/dyn10_N15_A002.csv", "a123_26650/ocv_P05_chg.csv"}) {
    const ToolRun run = run_tool("replay " + (data / file).string() + " --cell a123_26650" + on_board);
    EXPECT_EQ(run.exit_code, 0) << file << ": " << run.err;
    EXPECT_THAT(run.out, HasSubstr("every bit equal")) << file;
  }
}

TEST(Board, ComputesAnIdentifiedCellBitForBitLikeTheHost) {
  const files::TemporaryFolder folder;
  const std::string cell = (folder.path() / "identified.toml").string();
  ASSERT_EQ(run_tool("identify --recording " + shift + " --out " + cell).exit_code, 0);
  const ToolRun run = run_tool("replay " + shift + on_board + " --cell " + cell);
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("every bit equal"));
}

/// table9 followed by these tables.
std::filesystem::path extended_cell(const files::TemporaryFolder& folder, const std::string& name,
                                    const std::string& tables) {
  const auto path = folder.path() / (name + ".toml");
  std::ofstream(path) << files::replaced(content(BMS_SOURCE_DIR "/model/cells/table9.toml"), "\"table9\"",
                                         "\"" + name + "\"")
                      << tables;
  return path;
}

const std::string four_mechanisms = R"(
[mechanism.ocv_hysteresis]
half_gap_v = 0.006
decay = 40
initial = -0.5
[mechanism.slow_polarisation]
resistance_ohm = 0.004
[mechanism.temperature_resistance]
r0_activation_j_per_mol = 15000
r1_activation_j_per_mol = 30000
[instrument.current_offset]
offset_a = 0.02
)";

TEST(Board, ComputesAnExtendedCellBitForBitLikeTheHostAndShowsItsStates) {
  const files::TemporaryFolder folder;
  const std::string cell = extended_cell(folder, "extended", four_mechanisms).string(),
                    trace = (folder.path() / "t.csv").string();
  const ToolRun run = run_tool("replay " + shift + on_board + " --cell " + cell);
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("Verified: 28801 estimates, every bit equal on netduinoplus2."));
  ASSERT_EQ(run_tool("replay " + shift + " --cell " + cell + " --trace " + trace).exit_code, 0);
  const std::string host = content(trace);
  ASSERT_EQ(run_tool("replay " + shift + " --target netduinoplus2 --cell " + cell + " --trace " + trace).exit_code, 0);
  EXPECT_EQ(content(trace), host);
  EXPECT_THAT(host,
              HasSubstr(",voltage_measured_v,slow_polarisation_1_v,slow_polarisation_2_v,ocv_hysteresis_v,flags\n"));
  // integers, on the host alone
  EXPECT_EQ(run_tool("replay " + shift + " --scalar fixed --cell " + cell).exit_code, 0);
}

TEST(Board, EstimatesPersistentErrorsBitForBitLikeTheHost) {
  const files::TemporaryFolder folder;
  for (const char* cell : {"a123_26650_extended", "a123_esctoolbox_extended"}) {
    const ToolRun run = run_tool("replay " + shift + on_board + " --cell " + cell);
    EXPECT_EQ(run.exit_code, 0) << run.err;
    EXPECT_THAT(run.out, HasSubstr("every bit equal"));
  }
  const std::string alone = extended_cell(folder, "alone", "").string(), trace = (folder.path() / "t.csv").string();
  std::ofstream(alone) << files::replaced(content(BMS_SOURCE_DIR "/model/cells/table9.toml"), "\n[tolerance]",
                                          "errors_are_states = true\n[tolerance]");
  const ToolRun run = run_tool("replay " + shift + on_board + " --cell " + alone);
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("every bit equal"));
  ASSERT_EQ(run_tool("replay " + shift + " --cell " + alone + " --trace " + trace).exit_code, 0);
  EXPECT_THAT(content(trace),
              HasSubstr(",voltage_measured_v,voltage_error_v,current_offset_a,current_offset_sigma_a,flags\n"));
}

/// Every mechanism that a board runs, in another order than that of the catalogue.
TEST(Board, ComputesEveryMechanismBitForBitLikeTheHost) {
  const files::TemporaryFolder folder;
  const std::string cell = extended_cell(folder, "everything", four_mechanisms + R"(
[instrument.voltage_gain]
gain_error = 0.002
[instrument.voltage_offset]
offset_v = 0.001
[instrument.current_gain]
gain_error = 0.01
[instrument.temperature_sensor]
offset_k = 2
[mechanism.capacity_change]
loss_fraction = 0.05
[mechanism.coulombic_loss]
loss_fraction = 0.003
[mechanism.leakage]
current_a = 0.001
[mechanism.fast_polarisation]
resistance_ohm = 0.002
[mechanism.load_memory]
charge_ohm = 0.002
discharge_ohm = -0.001
[mechanism.self_heating]
thermal_resistance_k_per_w = 3
[mechanism.resistance_growth]
fraction = 0.1
[mechanism.polarisation_growth]
r1_fraction = 0.1
c1_fraction = -0.1
[mechanism.direction_asymmetry]
charge_fraction = 0.1
[mechanism.charge_transfer]
r0_share = 0.3
r1_share = 0.5
transfer_coefficient = 0.4
[mechanism.contact_step]
resistance_ohm = 0.001
[mechanism.ocv_shape]
slide_at_20 = 0.02
slide_at_80 = -0.01
[mechanism.entropic_ocv]
at_10_v_per_k = 1e-4
at_40_v_per_k = -2e-4
at_70_v_per_k = 1e-4
at_95_v_per_k = 1e-4
)")
                               .string();
  const ToolRun run = run_tool("replay " + shift + on_board + " --cell " + cell);
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("Verified: 28801 estimates, every bit equal on netduinoplus2."));
}

TEST(Board, TheGeneratorRefusesMechanismsWithoutFixedPointSupport) {
  const files::TemporaryFolder folder;
  const auto cell = extended_cell(folder, "transfer", "\n[mechanism.charge_transfer]\nr0_share = 0.3\n");
  const std::string log = (folder.path() / "log").string(), out = (folder.path() / "out.hpp").string();
  const std::string command = "\"" BMS_CELL_HEADER_TOOL "\" " + cell.string() + " " + out;
  EXPECT_EQ(WEXITSTATUS(std::system((command + " fixed 2> " + log).c_str())), 2);
  EXPECT_THAT(content(log),
              ::testing::MatchesRegex("[^\n]*'mechanism.charge_transfer' cannot be computed in fixed point[^\n]*\n"));
  EXPECT_FALSE(std::filesystem::exists(out));
  EXPECT_EQ(WEXITSTATUS(std::system(command.c_str())), 0);
}

const std::string on_microbit = " --scalar fixed --target microbit --verify ";

TEST(Microbit, ComputesTheShiftBitForBitLikeTheHost) {
  for (const char* start : {"", "--initial-soc 0.6 --initial-soc-sigma 0.2"}) {
    const ToolRun run = run_tool("replay " + shift + on_microbit + start);
    EXPECT_EQ(run.exit_code, 0) << run.err;
    EXPECT_THAT(run.out, HasSubstr("Verified: 28801 estimates, every bit equal on microbit."));
  }
}

/// Missing, impossible and stuck readings, a gap, and repeated times.
TEST(Microbit, ComputesAFaultyRecordingBitForBitLikeTheHost) {
  const files::TemporaryFolder folder;
  const auto path = folder.path() / "trouble.csv";
  std::ifstream in(shift);
  std::ofstream out(path);
  std::size_t row = 0;
  for (std::string line; std::getline(in, line);) {
    if (line.starts_with('#') || line.starts_with('t')) {
      out << line << '\n';
      continue;
    }
    ++row;
    if (row > 6'000) break;
    if (row > 2'000 && row < 2'400) continue;  // a gap
    const auto first = line.find(','), second = line.find(',', first + 1), third = line.find(',', second + 1);
    const std::string rest = third == std::string::npos ? "" : line.substr(third);
    const std::string time = line.substr(0, first + 1), current = line.substr(first + 1, second - first),
                      voltage = line.substr(second + 1, third - second - 1);
    if (row > 500 && row < 560)
      out << time << current << "9.9" << rest << '\n';
    else if (row > 900 && row < 1'000)
      out << time << current << "3.30001" << rest << '\n';
    else if (row > 3'000 && row < 3'040)
      out << time << "2000," << voltage << rest << '\n';
    else
      out << line << '\n';
  }
  out.close();
  const ToolRun run = run_tool("replay " + path.string() + on_microbit + "--initial-soc 0.7 --initial-soc-sigma 0.02");
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("every bit equal on microbit"));
}

TEST(Microbit, RefusesAnotherArithmetic) {
  const ToolRun run = run_tool("replay " + shift + " --target microbit");
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_THAT(run.err, HasSubstr("expected --scalar fixed"));
}

/// table9 with R0 at 90 % one float step larger: 0.0135692 is 0x3c5e5128 as a float.
TEST(Board, FindsAndNamesADifferenceOfOneUnitInTheLastPlace) {
  const files::TemporaryFolder folder;
  const auto other = folder.path() / "ulp.toml";
  ASSERT_EQ(std::nextafter(0.0135692F, 1.0F), 0.013569201F);
  ASSERT_NE(0.0135692F, 0.013569201F);
  std::ofstream(other) << files::replaced(
      files::replaced(content(BMS_SOURCE_DIR "/model/cells/table9.toml"), "0.0135692, ", "0.013569201, "), "\"table9\"",
      "\"ulp\"");
  const ToolRun run = run_tool("replay " + shift + on_board + " --board-cell " + other.string());
  EXPECT_EQ(run.exit_code, 1);
  EXPECT_THAT(
      run.err,
      ::testing::MatchesRegex(
          ".*host and netduinoplus2 differ first at sample [0-9]+ \\(time [0-9]+ s\\) in [a-z_]+: host [^\n]+\n"));
}

TEST(Board, TheFirmwareBuildRefusesACellThatIsOutOfRange) {
  const files::TemporaryFolder folder;
  const auto bad = folder.path() / "bad.toml";
  std::ofstream(bad) << files::replaced(content(BMS_SOURCE_DIR "/model/cells/table9.toml"), "0.0140197", "0.9");
  const std::string log = (folder.path() / "log").string();
  const int status = std::system(
      ("\"" BMS_CELL_HEADER_TOOL "\" " + bad.string() + " " + (folder.path() / "out.hpp").string() + " 2> " + log)
          .c_str());
  EXPECT_EQ(WEXITSTATUS(status), 2);
  EXPECT_THAT(content(log), HasSubstr("'rc.r0_ohm' is out of range"));
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "out.hpp"));
}

}  // namespace
}  // namespace bms
