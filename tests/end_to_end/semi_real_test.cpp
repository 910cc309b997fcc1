// The benchmark on real recordings, from the outside, on a folder with lists of its own.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "files/text_file.hpp"
#include "tests/end_to_end/run_tool.hpp"

namespace bms {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

// the recording that is left out is one of the calibration: a limit needs two healthy recordings, and here are two
const std::string set = R"(
[[set]]
name = "B0025 d005, d007 -> d005"
cell = "B0025"
held_out = false
start = "table9"
chemistry = "NCA"
capacity_ah = 1.85
ocv_from_load = true
initial_soc = 1
calibration = ["d005.csv.gz", "d007.csv.gz"]
test = "d005.csv.gz"
)";
const std::string absent_set = R"(
[[set]]
name = "not here"
cell = "B0025"
held_out = false
start = "table9"
calibration = ["d999.csv.gz"]
test = "d007.csv.gz"
)";
const std::string cases = R"(
[[case]]
name = "B0025 d007 healthy"
set = "B0025 d005, d007 -> d005"
recording = "d007.csv.gz"
truth = []
set_aside = false

[[case]]
name = "B0025 d003 behind the leads"
set = "B0025 d005, d007 -> d005"
recording = "d003_load.csv.gz"
before = "d007.csv.gz"
truth = []
set_aside = true
)";

class SemiReal : public ::testing::Test {
 protected:
  SemiReal() {
    for (const char* name : {"d003_load.csv.gz", "d005.csv.gz", "d007.csv.gz"})
      std::filesystem::copy_file(std::filesystem::path(BMS_SOURCE_DIR "/evidence/recordings/nasa_18650/B0025") / name,
                                 folder_.path() / name);
  }
  void write(const std::string& name, const std::string& text) { files::write_file(folder_.path() / name, text); }

  /// Runs the script. arguments: behind the folder with the programs.
  ToolRun run(const std::string& arguments) const {
    const std::string out = (folder_.path() / "stdout").string(), err = (folder_.path() / "stderr").string();
    const int status =
        std::system((BMS_PYTHON " -B " BMS_SOURCE_DIR "/evidence/proof/semi_real.py " BMS_BENCHMARKS " " + arguments +
                     " >" + out + " 2>" + err)
                        .c_str());
    return {WEXITSTATUS(status), content(out), content(err)};
  }
  std::string data() const { return folder_.path().string(); }

  files::TemporaryFolder folder_;
};

TEST_F(SemiReal, CountsNullsFaultsAndNaturalFaultsOfAFolderWithItsOwnLists) {
  write("semi_real.toml", set + absent_set);
  write("natural.toml", cases);
  const ToolRun r = run(data() + " --times-limit 2 --json -");
  ASSERT_EQ(r.exit_code, 0) << r.err;
  const json j = json::parse(r.out);
  EXPECT_EQ(j["nulls"]["cases"], 1);
  EXPECT_NEAR(j["nulls"]["hours"], 1.8, 0.2);
  EXPECT_EQ(j["skipped_sets"], 1) << "its recording is not in the folder";
  EXPECT_THAT(r.err, HasSubstr("skipped 1 sets: recordings are not in " + data() + " (first 'not here': d999.csv.gz)"));
  // a healthy recording and one behind leads of 0.46 ohm, of which the list says that nothing is there
  EXPECT_EQ(j["natural"]["cases"], 2);
  EXPECT_EQ(j["natural"]["with_recordings"]["cases"], 1);
  EXPECT_EQ(j["natural"]["with_references"]["cases"], 0);

  std::size_t false_names = 0, faults = 0, detected = 0, first_right = 0, within = 0, right = 0, results = 0;
  for (const json& one : j["results"]) {
    ++results;
    if (one["kind"] == "null") false_names += one["named"].get<bool>() ? 1 : 0;
    if (one["kind"] == "natural" && one["given"] == "alone") right += one["outcome"] == "right" ? 1 : 0;
    if (one["kind"] != "fault" || one["over_limit"].is_null() || !one["within_bounds"].get<bool>()) continue;
    EXPECT_NEAR(one["over_limit"], 2, 1e-9);
    ++faults;
    detected += one["detected"].get<bool>() ? 1 : 0;
    first_right += one["first_right"].get<bool>() ? 1 : 0;
    within += !one["sigmas"].is_null() && std::abs(one["sigmas"].get<double>()) <= 2 ? 1 : 0;
  }
  EXPECT_GE(faults, 1U);
  EXPECT_EQ(results, 1 + faults + j["faults"]["beyond_bounds"]["cases"].get<std::size_t>() + 3);
  EXPECT_EQ(j["nulls"]["false"], false_names);
  EXPECT_EQ(j["faults"]["cases"], faults);
  EXPECT_EQ(j["faults"]["detected"], detected);
  EXPECT_EQ(j["faults"]["first_right"], first_right);
  EXPECT_EQ(j["faults"]["size_within_2_sigma"], within);
  EXPECT_EQ(j["natural"]["right"], right);
}

TEST_F(SemiReal, OnlyRunsWhatIsAskedForAndWritesAFile) {
  write("semi_real.toml", set);
  write("natural.toml", cases);
  const std::string file = (folder_.path() / "out.json").string();
  const ToolRun r = run(data() + " --only healthy --quiet --json " + file);
  ASSERT_EQ(r.exit_code, 0) << r.err;
  EXPECT_EQ(r.out + r.err, "");
  const json j = json::parse(content(file));
  EXPECT_EQ(j["nulls"]["cases"], 0);
  EXPECT_EQ(j["natural"]["cases"], 1);
}

TEST_F(SemiReal, UsesTheListsOfTheRepositoryWhereTheFolderHasNone) {
  const ToolRun r = run(data());
  EXPECT_EQ(r.exit_code, 2) << "none of these recordings is in the folder";
  EXPECT_THAT(r.err, ::testing::ContainsRegex("skipped [0-9]+ sets: recordings are not in .*first 'A123 udds"));
  EXPECT_THAT(r.err, HasSubstr(data() + ":1: nothing to run, expected recordings of the lists\n"));
}

TEST_F(SemiReal, AMissingFolderAndABrokenListGiveOneLine) {
  const ToolRun missing = run("/nowhere --json " + (folder_.path() / "none.json").string());
  EXPECT_EQ(missing.exit_code, 2);
  EXPECT_EQ(missing.err, "/nowhere:1: no such folder, expected one with recordings\n");
  EXPECT_FALSE(std::filesystem::exists(folder_.path() / "none.json"));
  write("semi_real.toml", "[[set]]\nname = 'without the rest'\n");
  const ToolRun broken = run(data());
  EXPECT_EQ(broken.exit_code, 2);
  EXPECT_THAT(broken.err, ::testing::MatchesRegex(data() + "/semi_real.toml:1: [^\n]*'set.cell'[^\n]*\n"));
}

}  // namespace
}  // namespace bms
