// bms proof from the outside: invalid input, and the output for small simulated recordings. Whether its claims hold on
// real recordings is for a person to judge: ./bms proof.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <regex>
#include <set>
#include <sstream>

#include <nlohmann/json.hpp>

#include "tests/end_to_end/run_tool.hpp"

namespace bms {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::MatchesRegex;

class ProofTool : public ::testing::Test {
 protected:
  std::string path(const std::string& name) const { return (folder_.path() / name).string(); }

  /// A current through the built-in cell, with soc_ref and temperature as in the real recordings.
  void simulated(const std::string& name, const std::string& profile, const std::string& initial_soc,
                 double temperature_c, const std::string& with = "") const {
    std::ofstream(path("profile.csv")) << profile;
    const ToolRun run =
        run_tool("simulate --quiet --cell a123_26650 --profile " + path("profile.csv") + " --initial-soc " +
                 initial_soc + " --noise-v 0.0005 " + with + " --out " + path("simulated.csv"));
    ASSERT_EQ(run.exit_code, 0) << run.err;
    std::istringstream rows(content(path("simulated.csv")));
    std::ofstream out(path("data/" + name + ".csv"));
    std::string line;
    std::getline(rows, line);
    out << "time_s,current_a,voltage_v,soc,soc_ref,temperature_c\n";
    while (std::getline(rows, line)) out << line << "," << temperature_c << "\n";
  }
  static std::string slow(double current_a) {
    std::string profile = "time_s,current_a\n";
    for (int k = 0; k <= 400; ++k)
      profile += std::to_string(300 * k) + "," + std::to_string(k < 5 || k > 372 ? 0 : current_a) + "\n";
    return profile;
  }
  /// Pulses of a minute, with a rest at the start and at the end.
  static double current_a(int k) {
    if (k < 30 || k > 420) return 0;
    if (k % 60 < 30) return -2.5;
    return k % 60 < 45 ? 1.5 : 0.005;
  }
  static std::string drive(double scale) {
    std::string profile = "time_s,current_a\n";
    for (int k = 0; k < 500; ++k) profile += std::to_string(k) + "," + std::to_string(scale * current_a(k)) + "\n";
    return profile;
  }
  void small_folder() const {
    std::filesystem::create_directories(path("data/a123_26650"));
    std::filesystem::create_directories(path("data/a123_esctoolbox"));
    for (const std::string folder : {"a123_26650/", "a123_esctoolbox/"}) {
      simulated(folder + "ocv_P25_dis", slow(-0.0838), "1", 25);
      simulated(folder + "ocv_P25_chg", slow(0.0838), "0", 25);
    }
    for (const std::string name :
         {"a123_esctoolbox/dyn50_P25", "a123_esctoolbox/dyn45_P05", "a123_26650/dyn20_P25_A002",
          "a123_26650/udds_P25_A002", "a123_26650/pulse_P25_A002", "a123_26650/dyn10_N15_A002",
          "a123_26650/dyn10_N05_A002", "a123_26650/dyn10_P05_A002", "a123_26650/dyn10_P15_A002",
          "a123_26650/dyn10_P45_A002", "a123_26650/cccv1C_P25_A002", "a123_26650/fsae_P25_A004"}) {
      simulated(name, drive(name.find("udds") != std::string::npos ? 6 : 1), "0.7", 25);
    }
    // as in the repository
    ASSERT_EQ(std::system(("gzip " + path("data/a123_26650/udds_P25_A002.csv")).c_str()), 0);
  }
  files::TemporaryFolder folder_;
};

TEST_F(ProofTool, RefusesMissingRecordingsInOneLine) {
  const ToolRun none = run_tool("proof --data " + path("nowhere"));
  EXPECT_EQ(none.exit_code, 2);
  EXPECT_THAT(none.err, MatchesRegex("[^\n]*nowhere[^\n]*:1: no folder, expected [^\n]*a123_26650[^\n]*\n"));
  std::filesystem::create_directories(path("half/a123_26650"));
  std::filesystem::create_directories(path("half/a123_esctoolbox"));
  const ToolRun half = run_tool("proof --data " + path("half") + " --json " + path("r.json"));
  EXPECT_EQ(half.exit_code, 2);
  EXPECT_THAT(half.err, MatchesRegex("[^\n]*\\.csv:1: no such recording, expected [^\n]*\n"));
  EXPECT_FALSE(std::filesystem::exists(path("r.json")));
  const ToolRun unknown = run_tool("proof --data " + path("half") + " --only colour");
  EXPECT_EQ(unknown.exit_code, 2);
  EXPECT_THAT(unknown.err, HasSubstr("expected one of: hysteresis"));
}

TEST_F(ProofTool, EveryClaimIsInJsonAndPageWhetherItHoldsOrNot) {
  small_folder();
  const ToolRun run = run_tool("proof --data " + path("data") + " --json " + path("r.json") + " --report " +
                               path("r.html") + " --table " + path("r.md"));
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const json r = json::parse(content(path("r.json")));
  EXPECT_EQ(r["command"], "proof");
  std::size_t claims = 0, holding = 0;
  std::set<std::string> ids;
  const std::string page = content(path("r.html")), table = content(path("r.md"));
  for (const char* name : {"hysteresis", "hysteresis_b", "temperature", "relaxation", "balance", "balance_b", "faults",
                           "no_mismatch", "holdouts"}) {
    const auto at =
        std::find_if(r["experiments"].begin(), r["experiments"].end(), [&](const json& e) { return e["id"] == name; });
    ASSERT_NE(at, r["experiments"].end()) << name;
    EXPECT_FALSE((*at)["claims"].empty()) << name;
    for (const json& c : (*at)["claims"]) {
      for (const char* key : {"id", "claim", "said", "measured", "tolerance", "number", "errors", "within_uncertainty",
                              "holds", "verdict"})
        EXPECT_TRUE(c.contains(key)) << c << key;
      EXPECT_TRUE(ids.insert(c["id"]).second) << c["id"] << " twice";
      EXPECT_THAT(page, HasSubstr(c["claim"].get<std::string>()));
      EXPECT_THAT(table, HasSubstr("| `" + c["id"].get<std::string>() + "` |"));
      EXPECT_THAT(run.out, HasSubstr(c["claim"].get<std::string>()));
      EXPECT_EQ(c["verdict"] == "fails", !c["holds"].get<bool>());
      EXPECT_THAT(c["id"].get<std::string>(), ::testing::Not(::testing::EndsWith(".run"))) << c["said"];
      ++claims;
      holding += c["holds"].get<bool>() ? 1 : 0;
    }
  }
  EXPECT_EQ(r["claims"], claims);
  EXPECT_EQ(r["holding"], holding);
  EXPECT_GT(claims, 40U);
  // the recordings were simulated with the same cell, which does not depend on the temperature
  const auto& temperature = r["experiments"][2]["claims"][0];
  EXPECT_EQ(temperature["holds"], false) << temperature;
  EXPECT_FALSE(r["diagnoses"].empty());
  // independent of which experiment made a shared diagnosis first
  ASSERT_EQ(run_tool("proof --quiet --data " + path("data") + " --json " + path("again.json")).exit_code, 0);
  EXPECT_EQ(reproducible(content(path("again.json"))), reproducible(content(path("r.json"))));
}

/// Every recording that an experiment names is part of the repository.
TEST(ProofRecordings, AreInTheRepository) {
  const std::filesystem::path experiments = BMS_SOURCE_DIR "/evidence/proof/experiments",
                              recordings = BMS_SOURCE_DIR "/evidence/recordings";
  std::set<std::string> named;
  for (const auto& entry : std::filesystem::directory_iterator(experiments)) {
    const std::string text = content(entry.path());
    const std::regex name("a123_[a-z0-9]+/[A-Za-z0-9_]+");
    for (std::sregex_iterator at(text.begin(), text.end(), name), end; at != end; ++at) named.insert(at->str());
  }
  EXPECT_GT(named.size(), 12U);
  for (const std::string& name : named) EXPECT_TRUE(std::filesystem::exists(recordings / (name + ".csv.gz"))) << name;
}

/// The second page of ./bms demo: leads and contacts that the cell file does not contain, in a real recording. What a
/// second voltmeter found stands in evidence/recordings/nasa_18650/README.md.
TEST(RealRecording, ContactsThatTheCellFileDoesNotContainAreNamedMeasuredAndModelled) {
  const files::TemporaryFolder folder;
  const std::string recordings = BMS_SOURCE_DIR "/evidence/recordings/nasa_18650/B0025/",
                    cell = (folder.path() / "cell.toml").string(), result = (folder.path() / "r.json").string();
  ASSERT_EQ(
      run_tool("identify --quiet --recording " + recordings + "d005.csv.gz " + recordings +
               "d007.csv.gz --ocv-from-load --initial-soc 1 --start table9 --chemistry NCA --capacity-ah 1.85 --out " +
               cell)
          .exit_code,
      0);
  const ToolRun run =
      run_tool("diagnose --quiet --cell " + cell + " --recording " + recordings +
               "d003_load.csv.gz --initial-soc 1 1 --holdout " + recordings + "d056_load.csv.gz --json " + result);
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const json r = json::parse(content(result));
  ASSERT_EQ(r["mechanisms"].size(), 1U) << r["mechanisms"];
  EXPECT_EQ(r["mechanisms"][0]["id"], "resistance_growth");
  // The current changes between any two readings, 10 s apart: to them a pair faster than that is a resistance, and the
  // cell file has one of 4 s. Nothing else may come into question.
  const json rivals = r["mechanisms"][0]["equivalent_to"];
  EXPECT_TRUE(rivals.empty() || rivals == json::array({"polarisation_growth"})) << rivals;
  EXPECT_EQ(r["verdict"], rivals.empty() ? "CAUSE" : "AMBIGUOUS");
  const double added_ohm = r["mechanisms"][0]["resistances"][0]["value"];
  EXPECT_NEAR(added_ohm, 0.465, 0.03) << "the difference of both voltmeters";
  EXPECT_LT(r["extended"]["holdout"]["rmse_v"].get<double>(), 0.1 * r["baseline"]["holdout"]["rmse_v"].get<double>());
}

}  // namespace
}  // namespace bms
