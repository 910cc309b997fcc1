// bms hil from the outside: the real firmware in the emulator, in the loop with a simulated pack.
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
using ::testing::Not;

double load_a(int second) {
  if (second % 60 < 30) return -5.0;
  return second % 60 < 40 ? 1.5 : -0.5;
}

/// Five minutes of a pulsed load.
std::string short_drive(const std::filesystem::path& folder) {
  std::string csv = "time_s,current_a\n";
  for (int k = 0; k <= 300; ++k) csv += fmt::format("{},{}\n", k, load_a(k));
  const auto path = folder / "drive.csv";
  files::write_file(path, csv);
  return path.string();
}

Json of(const ToolRun& r) { return Json::parse(r.out); }

/// The one fault of the run was reported in its time.
void expect_reported_in_time(const ToolRun& r) {
  EXPECT_EQ(r.exit_code, 0) << r.err;
  const Json j = of(r);
  ASSERT_EQ(j["reactions"].size(), 1U);
  EXPECT_TRUE(j["reactions"][0]["in_time"]) << j["reactions"].dump() << j["faults"].dump();
  EXPECT_TRUE(j["reactions"][0]["after_s"].is_number()) << j["faults"].dump();
  EXPECT_EQ(j["soc"]["wrong_told_as_valid"], 0);
}

class Hil : public ::testing::TestWithParam<const char*> {
 protected:
  /// The forklift board in the loop with that load; the result is JSON on standard output.
  ToolRun loop(const std::string& arguments) const {
    return run_tool("hil --board stm32f405_forklift --json - --profile " + short_drive(folder_.path()) + " " +
                    arguments);
  }
  files::TemporaryFolder folder_;
};

TEST_F(Hil, ADriveWithoutFaultsRaisesNoFaultAndPublishesTheTrueSoc) {
  const auto r = loop("--initial-soc 0.6 --announced-soc 0.6");
  ASSERT_EQ(r.exit_code, 0) << r.err;
  const Json j = of(r);
  EXPECT_EQ(j["cells"], 16);
  EXPECT_TRUE(j["faults"].empty()) << j["faults"].dump();
  EXPECT_LT(j["soc"]["rmse"], 0.01);
  EXPECT_EQ(j["soc"]["wrong_told_as_valid"], 0);
  EXPECT_EQ(j["unanswered"], 0);
  EXPECT_EQ(j["lost"], 0);
  EXPECT_EQ(j["crc_errors"], 0);
  EXPECT_LT(j["driving_after_s"], 10);
  EXPECT_GT(j["frames"], 30'000);
}

TEST_F(Hil, APackOfEightCellsDrivesWithoutFaults) {
  const auto r = loop("--cells 8 --initial-soc 0.6 --announced-soc 0.6");
  ASSERT_EQ(r.exit_code, 0) << r.err;
  const Json j = of(r);
  EXPECT_EQ(j["cells"], 8);
  EXPECT_TRUE(j["faults"].empty()) << j["faults"].dump();
  EXPECT_EQ(j["unanswered"], 0);
  EXPECT_LT(j["driving_after_s"], 10);
  EXPECT_LT(j["soc"]["rmse"], 0.01);
  const auto refused = loop("--cells 7");
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, HasSubstr("7 cells, expected 8 to 16"));
}

/// The board of 80 V, 24 cells at two chips: 1 to 12 and 13 to 24.
class HilOf80Volts : public Hil {
 protected:
  ToolRun drive(const std::string& arguments) const {
    return run_tool("hil --board stm32f405_80v --json - --initial-soc 0.6 --announced-soc 0.6 --profile " +
                    short_drive(folder_.path()) + " " + arguments);
  }
};
TEST_F(HilOf80Volts, ADriveWithoutFaultsRaisesNoFaultAndPublishesTheTrueSoc) {
  const auto r = drive("");
  ASSERT_EQ(r.exit_code, 0) << r.err;
  const Json j = of(r);
  EXPECT_EQ(j["cells"], 24);
  EXPECT_TRUE(j["faults"].empty()) << j["faults"].dump();
  EXPECT_EQ(j["unanswered"], 0);
  EXPECT_EQ(j["lost"], 0);
  EXPECT_LT(j["driving_after_s"], 10);
  EXPECT_LT(j["soc"]["rmse"], 0.01);
  EXPECT_EQ(j["soc"]["wrong_told_as_valid"], 0);
}
TEST_P(HilOf80Volts, AnInjectedFaultOfEitherHalfIsReportedInTime) {
  expect_reported_in_time(drive(std::string("--fault ") + GetParam()));
}
INSTANTIATE_TEST_SUITE_P(Faults, HilOf80Volts,
                         ::testing::Values("cell_high=1@60", "cell_open=24@60", "sense_wire=12@60"), [](const auto& i) {
                           return std::string(i.param).substr(0, std::string(i.param).find_first_of("=@"));
                         });

TEST_F(Hil, IsReproducible) {
  const auto run = [&] {
    Json j = of(loop("--fault drop=0.01@0 --seed 5 --candump " + (folder_.path() / "dump").string()));
    j.erase("speedup");
    return j.dump() + files::read_file(folder_.path() / "dump");
  };
  EXPECT_EQ(run(), run());
}

class HilFault : public Hil {};
TEST_P(HilFault, AnInjectedFaultIsReportedInTime) {
  expect_reported_in_time(loop(std::string("--initial-soc 0.6 --announced-soc 0.6 --fault ") + GetParam()));
}
INSTANTIATE_TEST_SUITE_P(Faults, HilFault,
                         ::testing::Values("cell_stuck=3@60", "cell_open=7@60", "sense_wire=5@60", "cell_high=1@60",
                                           "cell_low=16@60", "current_open@60", "temperature_open@60", "overcurrent@60",
                                           "welded@60", "precharge_open@0", "silence@60-65"),
                         [](const auto& i) {
                           return std::string(i.param).substr(0, std::string(i.param).find_first_of("=@"));
                         });

TEST_F(Hil, AFaultyWireMakesNoWrongStateOfChargeValid) {
  for (const char* fault : {"drop=0.02@30", "corrupt=0.02@30", "delay=0.02@30"}) {
    const auto r = loop(std::string("--initial-soc 0.6 --announced-soc 0.6 --fault ") + fault);
    EXPECT_EQ(r.exit_code, 0) << fault << r.err;
    EXPECT_EQ(of(r)["soc"]["wrong_told_as_valid"], 0) << fault;
    EXPECT_GT(of(r)["unanswered"], 100) << fault << ": incomplete samples do not count";
  }
}

TEST_F(Hil, AFaultThatIsNotReportedGivesExitCode1) {
  const auto r = loop("--fault welded@60 --fault cell_open=2@299.9-299.95");
  EXPECT_EQ(r.exit_code, 1);
  EXPECT_THAT(r.err, HasSubstr("cell_open=2@299.9-299.95: expected VoltageMissing"));
}

TEST_F(Hil, SamplesThatAreTooFarApartForTheBoardAreAWarning) {
  const std::string more = " --profile " + shift + " --fault nonsense@1";  // ends before the firmware runs
  const auto apart = run_tool("hil --board stm32f405_forklift --sample-s 1" + more);
  EXPECT_EQ(apart.exit_code, 2);
  EXPECT_THAT(apart.err, HasSubstr("a sample every 1 s, but stm32f405_forklift is built for one every 0.1 s"));
  EXPECT_THAT(run_tool("hil --board stm32f405_forklift" + more).err, Not(HasSubstr("a sample every")));
  EXPECT_THAT(run_tool("hil --board netduinoplus2 --sample-s 1" + more).err, Not(HasSubstr("a sample every")));
}

TEST_F(Hil, ARecordedCurrentFlowsOnlyThroughClosedContactors) {
  std::string csv = files::read_file(shift);
  std::size_t end = 0;
  for (int line = 0; line < 400; ++line) end = csv.find('\n', end) + 1;
  const std::string part = (folder_.path() / "part.csv").string();
  files::write_file(part, csv.substr(0, end));
  const auto replayed = [&](const std::string& more) {
    return of(
        run_tool("hil --board netduinoplus2 --sample-s 1 --announced-soc 0.98 --json - --recording " + part + more));
  };
  const Json j = replayed("");
  EXPECT_LT(j["driving_after_s"], 30);
  EXPECT_TRUE(j["faults"].empty()) << j["faults"].dump();
  EXPECT_TRUE(j["cut_off_at_s"].is_null());
  EXPECT_GT(j["soc"]["told"], 390);
  const Json cut = replayed(" --fault current_open@350-360");
  ASSERT_TRUE(cut["cut_off_at_s"].is_number()) << "CurrentMissing opens";
  EXPECT_NEAR(cut["cut_off_at_s"].get<double>(), 356, 6);
  EXPECT_LE(cut["soc"]["told"], 362) << "the SOC after the contactors have opened is not judged";
  for (const Json& fault : cut["faults"]) EXPECT_NE(fault["name"], "ContactorWelded");
}

/// Two minutes of pulses of one cell, by the model itself.
std::string short_log(const std::filesystem::path& folder) {
  const std::string log = (folder / "log.csv").string();
  std::string csv = "time_s,current_a\n";
  for (int k = 0; k <= 120; ++k) csv += fmt::format("{},{}\n", k, k % 40 < 20 ? 0.0 : -5.8);
  files::write_file(folder / "pulses.csv", csv);
  EXPECT_EQ(run_tool("simulate --cell table9 --initial-soc 0.6 --profile " + (folder / "pulses.csv").string() +
                     " --out " + log)
                .exit_code,
            0);
  return log;
}

TEST_F(Hil, TheSameFirmwareOnALogShowsNoDifference) {
  const auto r = run_tool("replay " + short_log(folder_.path()) + " --against " BMS_SOURCE_DIR " --json -");
  ASSERT_EQ(r.exit_code, 0) << r.err;
  const Json j = of(r);
  EXPECT_EQ(j["differences"], 0) << j["first"].dump();
  EXPECT_TRUE(j["first"].is_null());
  EXPECT_GT(j["samples"], 1'200);
  EXPECT_EQ(j["cells"], 16);
}

TEST_F(Hil, ALimitFivePercentLowerIsShownForWhatItDoesToALog) {
  std::string cell = content(BMS_SOURCE_DIR "/model/cells/table9.toml");
  const std::string limit = "discharge_current_max_a = 6.0";
  const std::size_t at = cell.find(limit);
  ASSERT_NE(at, std::string::npos);
  files::write_file(folder_.path() / "lower.toml", cell.replace(at, limit.size(), "discharge_current_max_a = 5.7"));
  const auto r = run_tool("replay " + short_log(folder_.path()) + " --against " BMS_SOURCE_DIR " --against-cell " +
                          (folder_.path() / "lower.toml").string() + " --json -");
  ASSERT_EQ(r.exit_code, 1) << r.err;
  const Json j = of(r);
  EXPECT_GT(j["differences"], 100);
  bool found = false;
  for (const Json& signal : j["signals"]) {
    if (signal["name"] != "AllowedCurrent.Discharge") continue;
    found = true;
    EXPECT_NEAR(signal["largest"], 0.3, 0.05);
  }
  EXPECT_TRUE(found) << j.dump();
  EXPECT_EQ(j["above_allowed_s"]["before"], 0);
  EXPECT_NEAR(j["above_allowed_s"]["after"], 60, 10) << "5.8 A of 5.7 A";
}

TEST_F(Hil, TwoBatteriesThatStaySwitchedOffAreNotCalledEqual) {
  const auto r = run_tool("replay " + short_log(folder_.path()) + " --against " BMS_SOURCE_DIR " --sample-s 5");
  EXPECT_EQ(r.exit_code, 2) << r.out;
  EXPECT_THAT(r.err, HasSubstr("does not close its contactors"));
}

TEST_F(Hil, AnImageForTheChipOrAnUnknownCommitIsRefused) {
  const std::string log = short_log(folder_.path());
  const auto commit = run_tool("replay " + log + " --against no_such_commit");
  EXPECT_EQ(commit.exit_code, 2);
  EXPECT_THAT(commit.err, HasSubstr("expected an image for the loop"));
  const auto file = run_tool("replay " + log + " --against " + log);
  EXPECT_EQ(file.exit_code, 2);
  EXPECT_THAT(file.err, HasSubstr("not a firmware image"));
}

TEST_F(Hil, RefusesInvalidInputInOneLine) {
  EXPECT_EQ(run_tool("hil").exit_code, 2);
  EXPECT_EQ(run_tool("hil --profile " + shift + " --recording " + shift).exit_code, 2);
  const auto board = run_tool("hil --board nowhere --profile " + shift);
  EXPECT_EQ(board.exit_code, 2);
  EXPECT_THAT(board.err, HasSubstr("no such board"));
  const auto fault = run_tool("hil --fault gremlins@3 --profile " + shift);
  EXPECT_EQ(fault.exit_code, 2);
  EXPECT_THAT(fault.err, HasSubstr("expected one of: drop, corrupt"));
  EXPECT_EQ(run_tool("hil --port /dev/none --profile " + shift).exit_code, 2);
}

}  // namespace
}  // namespace bms
