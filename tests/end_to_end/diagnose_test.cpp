// bms diagnose from the outside: contract, verdicts on recordings with a known cause, data without information, bad
// input.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <regex>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "model/catalogue.hpp"
#include "tests/end_to_end/run_tool.hpp"

namespace bms {
namespace {

using nlohmann::json;
using ::testing::AnyOf;
using ::testing::HasSubstr;
using ::testing::MatchesRegex;
using ::testing::Not;

class DiagnoseTool : public ::testing::Test {
 protected:
  std::string path(const std::string& name) const { return (folder_.path() / name).string(); }
  json result(const std::string& arguments) const {
    const ToolRun run = run_tool("diagnose --quiet --json " + path("r.json") + " " + arguments);
    EXPECT_EQ(run.exit_code, 0) << run.err;
    return run.exit_code == 0 ? json::parse(content(path("r.json"))) : json();
  }
  /// The first hours of the shift with the first charge; its diagnosis takes a third of the time.
  std::string morning(int most_rows = 12'000) const {
    std::istringstream lines(content(shift));
    std::ofstream out(path("morning.csv"));
    int rows = 0;
    for (std::string line; rows < most_rows && std::getline(lines, line);) {
      out << line << "\n";
      rows += line.starts_with("#") ? 0 : 1;
    }
    return path("morning.csv");
  }
  /// The same current simulated with a mechanism. seed: of the noise.
  std::string simulated(const std::string& name, const std::string& with, int seed = 1,
                        const std::string& initial_soc = "0.98", int most_rows = 12'000) const {
    const ToolRun run =
        run_tool("simulate --cell table9 --recording " + morning(most_rows) + " --initial-soc " + initial_soc +
                 " --with " + with + " --noise-v 0.001 --seed " + std::to_string(seed) + " --out " + path(name));
    EXPECT_EQ(run.exit_code, 0) << run.err;
    return path(name);
  }
  /// A recording of n rows, one each step_s seconds: current and voltage by row.
  std::string made(const std::string& name, int rows, double step_s, const std::function<double(int)>& current_a,
                   const std::function<double(int)>& voltage_v) const {
    std::ofstream out(path(name));
    out << "time_s,current_a,voltage_v\n";
    for (int k = 0; k < rows; ++k) out << step_s * k << "," << current_a(k) << "," << voltage_v(k) << "\n";
    return path(name);
  }
  files::TemporaryFolder folder_;
};

constexpr const char* hysteresis = "ocv_hysteresis:half_gap_v=0.015,decay=40";

TEST_F(DiagnoseTool, NamesAHysteresisWithItsSizeAndConfirmsItOnAHoldOut) {
  const std::string later = simulated("later.csv", hysteresis, 2, "0.9");  // its soc_ref says where it starts
  const json r = result("--cell table9 --initial-soc 0.98 --recording " + simulated("now.csv", hysteresis) +
                        " --holdout " + later + " --out " + path("x.toml"));
  EXPECT_EQ(r["verdict"], "CAUSE");
  ASSERT_EQ(r["mechanisms"].size(), 1U);
  const json& m = r["mechanisms"][0];
  EXPECT_EQ(m["id"], "ocv_hysteresis");
  EXPECT_EQ(m["parameters"][0]["name"], "half_gap_v");
  const double half_gap_v = m["parameters"][0]["value"], std_v = m["parameters"][0]["std"];
  EXPECT_NEAR(half_gap_v, 0.015, 3 * std_v);
  EXPECT_LT(std_v, 0.001);
  EXPECT_THAT(r["statement"].get<std::string>(), HasSubstr("charged or discharged last"));
  EXPECT_THAT(m["because"].get<std::string>(), HasSubstr("the charge turns"));
  EXPECT_GT(r["baseline"]["holdout"]["rmse_v"], 0.008);
  EXPECT_LT(r["extended"]["holdout"]["rmse_v"], 0.0013) << "1 mV of noise";
  EXPECT_LT(r["soc"]["extended_rmse"], r["soc"]["baseline_rmse"]);
  // around the extended cell's voltage; the cell file's is off by up to 15 mV
  EXPECT_EQ(r["coverage"]["nominal"], 0.95);
  EXPECT_GT(r["coverage"]["recording"], 0.95);
  EXPECT_GT(r["coverage"]["holdout"], 0.95);
  EXPECT_EQ(r["coverage"]["holdout"], r["holdouts"][0]["coverage"]);
  EXPECT_LT(r["holdouts"][0]["half_width_v"], 0.015);
  const json& i = r["isolability"];
  const auto place = [&](const char* id) {
    return static_cast<std::size_t>(std::find(i["ids"].begin(), i["ids"].end(), id) - i["ids"].begin());
  };
  const std::size_t leakage = place("leakage"), offset = place("current_offset"), skew = place("channel_skew");
  ASSERT_LT(std::max({leakage, offset, skew}), i["ids"].size());
  EXPECT_FALSE(i["separable"][leakage][offset]);
  EXPECT_EQ(i["separated_by"][leakage][offset], "second_ammeter");
  EXPECT_TRUE(i["separable"][leakage][skew]);
  EXPECT_TRUE(i["separated_by"][leakage][skew].is_null());
  // the extended cell file works in other commands
  const std::string cell = content(path("x.toml"));
  EXPECT_THAT(cell, HasSubstr("name = \"table9_extended\""));
  EXPECT_THAT(cell, HasSubstr("[mechanism.ocv_hysteresis]\nsource = \"bms diagnose of now.csv"));
  EXPECT_EQ(run_tool("simulate --cell " + path("x.toml") + " --initial-soc 0.98 --recording " + shift + " --out " +
                     path("s.csv"))
                .exit_code,
            0);
  EXPECT_EQ(run_tool("replay " + shift + " --cell " + path("x.toml")).exit_code, 0);
  EXPECT_EQ(result("--cell " + path("x.toml") + " --initial-soc 0.98 --recording " + path("now.csv"))["verdict"],
            "NO_MISMATCH")
      << "the extended cell file explains the recording";
}

TEST_F(DiagnoseTool, LearnsATermForAnUnknownCauseThatOtherCommandsRun) {
  const char* memory = "load_memory:charge_ohm=0.012,discharge_ohm=-0.008,time_constant_s=900";
  const json r = result("--cell table9 --initial-soc 0.98 --recording " + simulated("now.csv", memory) + " --holdout " +
                        simulated("later.csv", memory, 2) + " --out " + path("x.toml"));
  ASSERT_EQ(r["verdict"], "UNKNOWN");
  EXPECT_EQ(r["law"], "slow");
  EXPECT_TRUE(r["mechanisms"].empty());
  ASSERT_TRUE(r["term"].is_object());
  EXPECT_EQ(r["term"]["id"], "load_memory");
  EXPECT_EQ(r["term"]["parameters"][0]["name"], "charge_ohm");
  EXPECT_LT(r["extended"]["holdout"]["rmse_v"], 0.5 * r["baseline"]["holdout"]["rmse_v"].get<double>());
  EXPECT_THAT(content(path("x.toml")), HasSubstr("[mechanism.load_memory]\nsource = \"term for an unknown cause"));
  EXPECT_EQ(run_tool("simulate --cell " + path("x.toml") + " --initial-soc 0.98 --recording " + shift + " --out " +
                     path("s.csv"))
                .exit_code,
            0);
  EXPECT_EQ(run_tool("replay " + shift + " --cell " + path("x.toml")).exit_code, 0);
  EXPECT_EQ(result("--cell " + path("x.toml") + " --initial-soc 0.98 --recording " + path("now.csv"))["verdict"],
            "NO_MISMATCH")
      << "the extended cell file explains the recording";
}

TEST_F(DiagnoseTool, AContactStepIsPresentFromTheStartOfALaterRecording) {
  const json r =
      result("--cell table9 --initial-soc 0.98 --recording " +
             simulated("now.csv", "contact_step:resistance_ohm=0.002,onset_s=5000") + " --holdout " +
             simulated("later.csv", "contact_step:resistance_ohm=0.002,onset_s=0", 2) + " --out " + path("x.toml"));
  ASSERT_EQ(r["verdict"], "CAUSE");
  EXPECT_EQ(r["mechanisms"][0]["id"], "contact_step");
  EXPECT_NEAR(r["mechanisms"][0]["parameters"][1]["value"], 5'000, 60);
  EXPECT_LT(r["extended"]["holdout"]["rmse_v"], 0.0013);
  EXPECT_THAT(content(path("x.toml")), HasSubstr("onset_s = 0"));
  EXPECT_THAT(content(path("x.toml")), MatchesRegex("[^@]*since [45][0-9]{3} s of now.csv[^@]*"));
}

TEST_F(DiagnoseTool, TheShiftItselfHasNoMismatchAndLeavesTheCellUnchanged) {
  const json r = result("--cell table9 --initial-soc 0.98 --recording " + shift + " --out " + path("x.toml"));
  EXPECT_EQ(r["verdict"], "NO_MISMATCH");
  EXPECT_TRUE(r["mechanisms"].empty());
  EXPECT_GT(r["detection_limits"].size(), 10U);
  EXPECT_THAT(r["statement"].get<std::string>(), HasSubstr("would have revealed"));
  EXPECT_TRUE(r["baseline"]["holdout"].is_null());
  EXPECT_TRUE(r["coverage"]["holdout"].is_null());
  EXPECT_GT(r["coverage"]["recording"], 0.95);
  EXPECT_EQ(r["baseline"]["recording"], r["extended"]["recording"]);
  EXPECT_THAT(content(path("x.toml")), HasSubstr("name = \"table9\"\n"));
  EXPECT_THAT(content(path("x.toml")), HasSubstr("NO_MISMATCH, nothing was added"));
}

TEST_F(DiagnoseTool, SaysHowManyReadingsOfAHoldOutTheIntervalContains) {
  const auto rest = [&](const std::string& name, double above_v) {
    return made(
        name, 2'000, 1, [](int) { return 0.0; }, [&](int k) { return 3.286 + above_v + 0.001 * (k % 2); });
  };
  const ToolRun run =
      run_tool("diagnose --cell table9 --initial-soc 0.5 0.5 0.5 --recording " + rest("now.csv", 0) + " --holdout " +
               rest("alike.csv", 1e-4) + " " + rest("higher.csv", 0.1) + " --json " + path("r.json"));
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.out,
              HasSubstr("\nThe 95 % interval of the prediction contains 100.0 % of the readings of alike.csv;"));
  EXPECT_THAT(run.out,
              HasSubstr("\nThe 95 % interval of the prediction contains 0.0 % of the readings of higher.csv;"));
  const json r = json::parse(content(path("r.json")));
  EXPECT_EQ(r["coverage"]["recording"], 1.0);
  EXPECT_EQ(r["coverage"]["holdout"], 0.5) << "both together";
  EXPECT_EQ(r["holdouts"][1]["coverage"], 0.0);
}

TEST_F(DiagnoseTool, StoppedByCtrlCItNamesNothing) {
  // of the whole shift: a fast machine has diagnosed the morning before the second is over
  const std::string recording = simulated("now.csv", "leakage:current_a=0.12", 1, "0.98", 100'000);
  const int status = std::system(("timeout --foreground --preserve-status -s INT 1 \"" BMS_TOOL
                                  "\" diagnose --cell table9 --recording " +
                                  recording + " --initial-soc 0.98 --out " + path("x.toml") + " --json " +
                                  path("r.json") + " --quiet 2>" + path("err"))
                                     .c_str());
  EXPECT_EQ(WEXITSTATUS(status), 130);
  EXPECT_FALSE(std::filesystem::exists(path("x.toml"))) << "no cell file";
  const json r = json::parse(content(path("r.json")));
  EXPECT_EQ(r["verdict"], "UNFINISHED");
  EXPECT_TRUE(r["mechanisms"].empty());
  for (const json& c : r["candidates"]) EXPECT_TRUE(c["probability"].is_null());
  EXPECT_FALSE(r["search"]["not_tried"].empty());
  EXPECT_THAT(r["statement"].get<std::string>(), Not(HasSubstr("No other known mechanism")));
}

/// What a warning knows already is the verdict.
TEST_F(DiagnoseTool, AWrongUnitThatTheNumbersShowIsADataFault) {
  std::string pack = "time_s,current_a,voltage_v\n", milli = pack;
  for (int k = 0; k < 3'000; ++k) {
    const double a = k % 100 < 50 ? -6 : 2;
    pack += fmt::format("{},{},{}\n", k, a, 16 * (3.29 + 0.014 * a));
    milli += fmt::format("{},{},{}\n", 1'000 * k, a, 3.29 + 0.014 * a);
  }
  std::ofstream(path("pack.csv")) << pack;
  std::ofstream(path("milli.csv")) << milli;
  const json of_pack = result("--cell table9 --initial-soc 0.9 --recording " + path("pack.csv"));
  EXPECT_EQ(of_pack["verdict"], "DATA_FAULT");
  EXPECT_THAT(of_pack["statement"].get<std::string>(), HasSubstr("of about 16 cells in series"));
  const json of_milli = result("--cell table9 --initial-soc 0.9 --recording " + path("milli.csv"));
  EXPECT_EQ(of_milli["verdict"], "DATA_FAULT");
  EXPECT_THAT(of_milli["statement"].get<std::string>(), HasSubstr("look like milliseconds"));
}

TEST_F(DiagnoseTool, HasAllFieldsOfTheContractForEveryVerdict) {
  const auto complete = [](const json& r) {
    for (const char* key : {"command", "verdict", "statement", "location", "mechanisms", "candidates", "baseline",
                            "extended", "coverage", "noise_floor_v", "unexplained", "detection_limits", "not_testable",
                            "next_experiment", "wall_s", "warnings"}) {
      EXPECT_TRUE(r.contains(key)) << key;
    }
    EXPECT_EQ(r["command"], "diagnose");
    EXPECT_FALSE(r["statement"].get<std::string>().empty());
    for (const char* key : {"spans", "regimes", "explained_share"}) EXPECT_TRUE(r["location"].contains(key)) << key;
    for (const char* key : {"rmse_v", "share"}) EXPECT_TRUE(r["unexplained"][key].is_number()) << key;
    for (const char* model : {"baseline", "extended"}) {
      for (const char* key : {"recording", "holdout"}) EXPECT_TRUE(r[model].contains(key)) << model << key;
    }
    for (const json& m : r["mechanisms"]) {
      for (const char* key : {"id", "probability", "equivalent_to", "parameters", "rms_contribution_v"})
        EXPECT_TRUE(m.contains(key)) << key;
      for (const json& p : m["parameters"])
        EXPECT_TRUE(p["value"].is_number() && p["std"].is_number() && p["name"].is_string() && p["unit"].is_string())
            << p;
    }
    for (const json& c : r["candidates"]) {
      for (const char* key : {"probability", "log_likelihood_gain", "explained_share"})
        EXPECT_TRUE(c[key].is_number()) << key;
      for (const json& id : c["ids"])
        EXPECT_LT(model::mechanism_index(id.get<std::string>()), model::mechanism_count) << id;
    }
    for (const json& l : r["detection_limits"])
      EXPECT_TRUE(l["value"].is_number() && l["id"].is_string() && l["parameter"].is_string() && l["unit"].is_string())
          << l;
    for (const json& n : r["not_testable"]) EXPECT_FALSE(n["reason"].get<std::string>().empty()) << n;
  };
  complete(result("--cell table9 --initial-soc 0.98 --recording " + shift));
  complete(result("--cell table9 --initial-soc 0.98 --recording " + simulated("gap.csv", hysteresis)));
  complete(result("--cell table9 --recording " +
                  made(
                      "rest.csv", 2'000, 1, [](int) { return 0.0; }, [](int) { return 3.3; })));
  complete(result("--cell table9 --recording " + made(
                                                     "mv.csv", 2'000, 1, [](int k) { return -(k / 60 % 3); },
                                                     [](int k) { return 3'300 - 10.0 * (k / 60 % 3); })));
}

TEST_F(DiagnoseTool, DataWithoutInformationIsNotTestable) {
  const auto level = [](int k) { return 3.29 + 0.001 * (k % 2); };
  const struct {
    const char* what;
    std::string file;
  } cases[] = {
      {"constant voltage and current",
       made(
           "constant.csv", 3'000, 1, [](int) { return -2.0; }, [](int) { return 3.2; })},
      {"constant current",
       made(
           "flat.csv", 3'000, 1, [](int) { return -2.0; }, [](int k) { return 3.28 - 1e-6 * k + 0.001 * (k % 2); })},
      {"all rest", made(
                       "rest.csv", 5'000, 1, [](int) { return 0.0; }, level)},
      {"ten rows", made(
                       "ten.csv", 10, 1, [](int k) { return -(k % 3); }, level)},
      {"a minute",
       made(
           "minute.csv", 60, 1, [](int k) { return -(k % 3); }, [](int k) { return 3.29 - 0.01 * (k % 3); })},
      {"no voltage that can be read",
       made(
           "blind.csv", 2'000, 1, [](int k) { return -(k % 3); }, [](int) { return std::nan(""); })},
      {"no current that can be read", made(
                                          "still.csv", 2'000, 1, [](int) { return std::nan(""); }, level)},
  };
  for (const auto& c : cases) {
    const json r = result(c.file + " --cell table9");  // as bms replay takes it, and with its option elsewhere
    EXPECT_THAT(r["verdict"].get<std::string>(), AnyOf("NOT_TESTABLE", "DATA_FAULT")) << c.what;
    EXPECT_TRUE(r["mechanisms"].empty()) << c.what;
    EXPECT_TRUE(r["isolability"]["ids"].empty() && r["isolability"]["separable"].empty()) << c.what;
  }
}

TEST_F(DiagnoseTool, WithoutATemperatureTheMechanismsThatNeedItAreListed) {
  std::string text;
  std::istringstream lines(content(shift));
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("#")) continue;
    std::size_t end = 0;
    for (int k = 0; k < 3; ++k) end = line.find(',', end + 1);
    text += line.substr(0, end) + "\n";
  }
  std::ofstream(path("bare.csv")) << text;
  const json r = result("--cell table9 --initial-soc 0.98 --recording " + path("bare.csv"));
  EXPECT_EQ(r["verdict"], "NO_MISMATCH");
  std::size_t about_temperature = 0;
  for (const json& n : r["not_testable"]) about_temperature += n["reason"] == "no temperature was recorded" ? 1 : 0;
  EXPECT_EQ(about_temperature, 3U);
}

TEST_F(DiagnoseTool, ABrokenRecordingIsADataFaultWithItsPlace) {
  std::string text = "time_s,current_a,voltage_v\n";
  for (int k = 0; k < 4'000; ++k)
    text += std::to_string(k) + "," + std::to_string(k / 50 % 2 == 0 ? 3 : -3) + "," +
            std::to_string(k / 50 % 2 == 0 ? 3.25 : 3.33) + "\n";
  std::ofstream(path("inverted.csv")) << text;
  const json r = result("--cell table9 --recording " + path("inverted.csv"));
  EXPECT_EQ(r["verdict"], "DATA_FAULT");
  ASSERT_EQ(r["faults"].size(), 1U);
  EXPECT_EQ(r["faults"][0]["id"], "current_inverted");
  EXPECT_EQ(r["statement"], r["faults"][0]["text"]);
}

TEST_F(DiagnoseTool, SaysWhereTheInitialSocComesFrom) {
  const json referenced = result("--cell table9 --recording " + shift);
  EXPECT_THAT(referenced["notes"].dump(), HasSubstr("starts at the first value of soc_ref, 98.0 %"));
  std::string text = content(simulated("now.csv", hysteresis));
  text.replace(text.find(",soc_ref"), 8, ",other");
  std::ofstream(path("now.csv")) << text;
  const json read = result("--cell table9 --recording " + path("now.csv"));
  EXPECT_THAT(read["notes"].dump(), HasSubstr("starts at the state of charge estimated from the first voltage"));
  EXPECT_GT(read["recordings"][0]["initial_soc_sigma"], 0.005);
  const json given = result("--cell table9 --initial-soc 0.98 --recording " + shift);
  EXPECT_EQ(given["recordings"][0]["initial_soc"], 0.98);
  EXPECT_TRUE(given["notes"].empty());
  for (const json& r : {referenced, given}) EXPECT_THAT(r["warnings"].dump(), Not(HasSubstr("start")));
}

TEST_F(DiagnoseTool, AValueForTheRecordingsIsNotTheStartOfAHoldOut) {
  const std::string now = simulated("now.csv", hysteresis), later = simulated("later.csv", hysteresis, 2, "0.5");
  const std::string both = "--cell table9 --recording " + now + " --holdout " + later;
  const json by_column = result(both + " --initial-soc 0.98");
  EXPECT_NEAR(by_column["holdouts"][0]["initial_soc"], 0.5, 1e-3);
  EXPECT_LT(by_column["extended"]["holdout"]["rmse_v"], 0.003);
  const json by_user = result(both + " --initial-soc 0.98 0.51");
  EXPECT_EQ(by_user["holdouts"][0]["initial_soc"], 0.51);
  const ToolRun wrong = run_tool("diagnose " + both + " --initial-soc 0.98 0.5 0.6");
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_THAT(wrong.err, HasSubstr("--initial-soc:1: 3 values for 1 recordings and 1 hold-outs, expected one for all"));
}

TEST_F(DiagnoseTool, FindsAWrongStartOfAnySizeAndSaysSoBeforeTheSearch) {
  const std::string now = simulated("now.csv", "initial_soc:shift=0");
  const ToolRun run =
      run_tool("diagnose --cell table9 --recording " + now + " --initial-soc 0.3 --json " + path("r.json"));
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.err, HasSubstr("the start of 30.0 % (--initial-soc) is contradicted: the column soc_ref begins at "
                                 "98.0 % and the first voltage, 3."));
  const json r = json::parse(content(path("r.json")));
  EXPECT_EQ(r["verdict"], "CAUSE") << r["statement"];
  ASSERT_EQ(r["mechanisms"].size(), 1U) << r["statement"];
  EXPECT_EQ(r["mechanisms"][0]["id"], "initial_soc");
  EXPECT_NEAR(r["mechanisms"][0]["parameters"][0]["value"], 0.68, 0.01);
}

/// On the flat part of the OCV curve the linear signature of a wrong start is smaller than those of six other causes.
TEST_F(DiagnoseTool, FindsAWrongStartThatItsSignatureDoesNotShow) {
  const std::string hour = simulated("hour.csv", "initial_soc:shift=0", 1, "0.98", 3'600);
  const json r = result("--cell table9 --recording " + hour + " --initial-soc 0.3");
  EXPECT_EQ(r["verdict"], "CAUSE") << r["statement"];
  ASSERT_EQ(r["mechanisms"].size(), 1U) << r["statement"];
  EXPECT_EQ(r["mechanisms"][0]["id"], "initial_soc");
  EXPECT_NEAR(r["mechanisms"][0]["parameters"][0]["value"], 0.68, 0.01);
}

TEST_F(DiagnoseTool, RefusesReadingsThatItHasAlready) {
  const std::string now = simulated("now.csv", hysteresis);
  std::ofstream(path("copy.csv")) << content(now);
  for (const std::string& again : {" --holdout " + now, " --recording " + now, " --holdout " + path("copy.csv")}) {
    const ToolRun run = run_tool("diagnose --cell table9 --recording " + now + again);
    EXPECT_EQ(run.exit_code, 2) << again;
    EXPECT_THAT(run.err, HasSubstr("the same readings as in " + now + ", expected another recording")) << again;
  }
}

TEST_F(DiagnoseTool, TheErrorOfAHoldOutIsThatOfTheOtherCommands) {
  for (const char* cell : {"a123_26650_extended", "a123_esctoolbox_extended"}) {
    const std::string with = std::string(" --cell ") + cell;
    ASSERT_EQ(run_tool("simulate" + with + " --recording " + morning(3'000) + " --initial-soc 1 --out " + path("z.csv"))
                  .exit_code,
              0);
    const ToolRun replay = run_tool("replay " + path("z.csv") + with + " --json -");
    ASSERT_EQ(replay.exit_code, 0) << replay.err;
    EXPECT_LT(json::parse(replay.out)["voltage"]["open_loop_rmse_v"], 1e-6) << cell;
    EXPECT_THAT(replay.err, Not(HasSubstr("not used")));
    const json r = result("--recording " + path("z.csv") + with);
    EXPECT_EQ(r["verdict"], "NO_MISMATCH") << r["statement"];
    EXPECT_LT(r["baseline"]["recording"]["rmse_v"], 1e-6) << cell;
  }
}

TEST_F(DiagnoseTool, AHoldOutThatThePredictionMissesChangesTheHeadline) {
  const json r = result("--cell table9 --initial-soc 0.98 --recording " + simulated("now.csv", "initial_soc:shift=0") +
                        " --holdout " + simulated("later.csv", "resistance_growth:fraction=0.3", 2) + " --report " +
                        path("r.html"));
  EXPECT_EQ(r["verdict"], "NO_MISMATCH");
  ASSERT_EQ(r["holdouts_beyond"].size(), 1U);
  EXPECT_EQ(r["holdouts_beyond"][0], "later.csv");
  const std::string statement = r["statement"];
  EXPECT_THAT(statement, HasSubstr("No action is needed for this recording. But the prediction of the hold-out "
                                   "later.csv is off by "));
  EXPECT_THAT(statement, HasSubstr("Diagnose both together."));
  EXPECT_THAT(content(path("r.html")), HasSubstr("Diagnose the recordings and the hold-outs together:"));
  EXPECT_THAT(content(path("r.html")), HasSubstr("\"holdouts_beyond\":[\"later.csv\"]"));
}

/// A hold-out whose errors are within the tolerance, but in the pattern of one cause that the recording hides.
TEST_F(DiagnoseTool, AHoldOutThatHasACauseAloneChangesTheHeadline) {
  const auto part = [&](const std::string& name, const std::string& options) {
    run_tool("simulate --cell table9 --with self_heating:thermal_resistance_k_per_w=8 --noise-v 0.001 --recording " +
             shift + " " + options + " --out " + path(name));
    return path(name);
  };
  const json r = result("--cell table9 --recording " + part("now.csv", "--initial-soc 0.98 --until 12000") +
                        " --holdout " + part("later.csv", "--initial-soc 0.6 --from 12000 --until 24000"));
  EXPECT_EQ(r["verdict"], "NO_MISMATCH");
  EXPECT_EQ(r["holdouts_beyond"], json::array({"later.csv"}));
  EXPECT_THAT(r["statement"].get<std::string>(), HasSubstr("alone it says that the cell is warmer inside"));
}

TEST_F(DiagnoseTool, AnExtendedFileThatPredictsTheHoldOutWorseSaysSo) {
  const json r =
      result("--cell table9 --initial-soc 0.98 --recording " + simulated("now.csv", "resistance_growth:fraction=0.3") +
             " --holdout " + simulated("later.csv", "initial_soc:shift=0", 2) + " --out " + path("x.toml"));
  EXPECT_EQ(r["verdict"], "CAUSE");
  EXPECT_THAT(r["warnings"].dump(), HasSubstr("holdout_worse"));
  EXPECT_THAT(r["statement"].get<std::string>(), HasSubstr("do not rely on that file"));
  EXPECT_THAT(content(path("x.toml")), HasSubstr("; the error on the hold-out recordings increases from "));
}

/// A voltage offset, which a gain explains as well on an LFP cell; then the sense wires on a reference source.
TEST_F(DiagnoseTool, RequestsTheExperimentThatDecidesAndDecidesByIt) {
  const std::string now = simulated("now.csv", "voltage_offset:offset_v=0.012");
  const json r = result("--cell table9 --initial-soc 0.98 --recording " + now + " --report " + path("r.html"));
  ASSERT_EQ(r["verdict"], "AMBIGUOUS");
  const json& next = r["next_experiment"];
  ASSERT_TRUE(next.is_object());
  EXPECT_EQ(next["profile"], "meter_check");
  EXPECT_EQ(next["separates"].size(), r["mechanisms"][0]["equivalent_to"].size() + 1);
  EXPECT_GT(next["expected_gain"], 7);
  EXPECT_THAT(next["why"].get<std::string>(), HasSubstr("To distinguish "));
  EXPECT_THAT(content(path("r.html")), HasSubstr("bms experiment meter_check"));
  const std::string then = next["then"], measured = "meter_check_measured.csv";
  EXPECT_EQ(then,
            "bms diagnose --cell table9 --recording " + now + " --recording " + measured + " --initial-soc 0.98 0.95");
  EXPECT_THAT(content(path("r.html")), HasSubstr(then));
  ASSERT_EQ(run_tool("experiment meter_check --out " + path("p.csv")).exit_code, 0);
  // readings of the faulty channel: of the source, and of the resting cell
  std::istringstream profile(content(path("p.csv")));
  std::ofstream later(path(measured));
  std::string line;
  std::getline(profile, line);
  ASSERT_EQ(line, "time_s,current_a,current_ref_a,voltage_ref_v");
  later << "time_s,current_a,current_ref_a,voltage_ref_v,voltage_v\n";
  for (int k = 0; std::getline(profile, line); ++k) {
    const std::string source = line.substr(line.rfind(',') + 1);
    later << line << "," << (source.empty() ? 3.3895 : std::stod(source)) + 0.012 + 0.001 * ((7 * k) % 5 - 2) << "\n";
  }
  later.close();
  std::string both_arguments = then.substr(std::string("bms diagnose ").size());
  both_arguments.replace(both_arguments.find(measured), measured.size(), path(measured));
  const json both = result(both_arguments);
  EXPECT_EQ(both["verdict"], "CAUSE");
  EXPECT_EQ(both["mechanisms"][0]["id"], "voltage_offset");
  EXPECT_NEAR(both["mechanisms"][0]["parameters"][0]["value"], 0.012, 0.001);
  EXPECT_TRUE(both["next_experiment"].is_null());
  EXPECT_TRUE(both["nothing_more"].is_null()) << "one cause is left";
}

TEST_F(DiagnoseTool, BadUsageAndBadInputAreOneLineAndExitCode2) {
  const std::vector<std::string> wrong = {
      "",
      "--cell table9",
      "--recording " + shift,
      "--cell no_such_cell --recording " + shift,
      "--cell table9 --recording /no/such/file.csv",
      "--cell table9 --recording " + shift + " --holdout /no/such/file.csv",
      "--cell table9 --recording " + shift + " --initial-soc 98",
      "--cell table9 --recording " + shift + " --initial-soc nan",
      "--cell table9 --recording " + shift + " --recording " + shift +
          " --initial-soc 0.9 --initial-soc 0.8 --initial-soc 0.7",
      "--cell table9 --recording " + made(
                                         "nine.csv", 9, 1, [](int) { return 0.0; }, [](int) { return 3.3; }),
      "--cell table9 --recording " + shift + " --json - --report -",
  };
  for (const std::string& arguments : wrong) {
    const ToolRun run = run_tool("diagnose " + arguments);
    EXPECT_EQ(run.exit_code, 2) << arguments;
    EXPECT_THAT(run.err, MatchesRegex("[^\n]+\n")) << arguments;
    EXPECT_EQ(run.out, "") << arguments;
  }
  const ToolRun help = run_tool("diagnose --help");
  EXPECT_EQ(help.exit_code, 0);
  EXPECT_THAT(help.out, HasSubstr("Example: bms diagnose"));
}

TEST_F(DiagnoseTool, IsReproducible) {
  const std::string arguments = "diagnose --cell table9 --initial-soc 0.98 --recording " +
                                simulated("now.csv", hysteresis) + " --json - --out " + path("x.toml") + " --report " +
                                path("x.html");
  const ToolRun a = run_tool(arguments);
  const std::string cell = content(path("x.toml")), page = content(path("x.html"));
  const ToolRun b = run_tool(arguments);
  ASSERT_EQ(a.exit_code, 0) << a.err;
  EXPECT_EQ(reproducible(a.out), reproducible(b.out));
  EXPECT_EQ(cell, content(path("x.toml")));
  EXPECT_EQ(page, content(path("x.html")));
}

/// Half of a real drive: header and rows from a share of all on.
std::string half_of(const std::filesystem::path& file, bool second) {
  std::istringstream lines(content(file.string()));
  std::vector<std::string> rows;
  std::string header, text;
  for (std::string line; std::getline(lines, line);) {
    if (header.empty() && !line.starts_with("#"))
      header = line;
    else if (!line.starts_with("#"))
      rows.push_back(line);
  }
  const std::size_t middle = rows.size() / 2;
  text = header + "\n";
  for (std::size_t k = second ? middle : 0; k < (second ? rows.size() : middle); ++k) text += rows[k] + "\n";
  return text;
}

TEST_F(DiagnoseTool, AHealthySecondHalfOfARealDriveIsNotBlamed) {
  const std::filesystem::path a123 = data / "a123_26650";
  if (!std::filesystem::exists(a123)) GTEST_SKIP() << "the real recordings are not there: " << data;
  std::ofstream(path("first.csv")) << half_of(a123 / "udds_P25_A002.csv", false);
  std::ofstream(path("second.csv")) << half_of(a123 / "udds_P25_A002.csv", true);
  const auto identify = [&](const std::string& healthy, const std::string& out) {
    const ToolRun run = run_tool("identify --quiet --start a123_26650 --ocv " + (a123 / "ocv_P25_dis.csv").string() +
                                 " " + (a123 / "ocv_P25_chg.csv").string() + " --recording " + path("first.csv") +
                                 healthy + " --out " + path(out));
    EXPECT_EQ(run.exit_code, 0) << run.err;
  };
  identify(" --healthy " + path("first.csv"), "healthy.toml");
  EXPECT_THAT(content(path("healthy.toml")), HasSubstr("[[healthy.block]]"));
  const json with = result("--cell " + path("healthy.toml") + " --recording " + path("second.csv"));
  EXPECT_EQ(with["verdict"], "NOT_TESTABLE");
  EXPECT_TRUE(with["mechanisms"].empty());
  EXPECT_THAT(with["statement"].get<std::string>(), HasSubstr("its state of charge is 17 to 44 %"));
  EXPECT_FALSE(with["withheld"].empty());
  EXPECT_GT(with["healthy"]["hours"], 0.3);
  EXPECT_EQ(with["healthy"]["recordings"], 1);
  EXPECT_EQ(with["healthy"]["false_alarm_rate"], 0.01);
  EXPECT_EQ(run_tool("diagnose --cell table9 --recording x.csv --false-alarm-rate 0").exit_code, 2);
}

}  // namespace
}  // namespace bms
