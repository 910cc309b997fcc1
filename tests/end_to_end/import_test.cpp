// bms import as a user calls it: every sample of log_samples is read with the right values, or refused with the reason.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <array>
#include <cmath>
#include <map>
#include <sstream>

#include "files/committed_figures.hpp"
#include "tests/end_to_end/log_samples.hpp"
#include "tests/end_to_end/log_table.hpp"
#include "tests/end_to_end/run_tool.hpp"

namespace bms {
namespace {

using log_samples::Answer;
using log_samples::Row;
using log_samples::Sample;
using ::testing::HasSubstr;
using ::testing::Not;

/// A table of numbers; an empty field is NaN.
std::vector<std::vector<double>> table(const std::filesystem::path& path, std::vector<std::string>& header) {
  std::ifstream in(path);
  std::string line, field;
  std::vector<std::vector<double>> rows;
  for (bool first = true; std::getline(in, line); first = first && line.starts_with('#')) {
    if (line.starts_with('#')) continue;
    std::istringstream fields(line);
    if (!first) rows.emplace_back();
    while (std::getline(fields, field, ',')) {
      if (first)
        header.push_back(field);
      else
        rows.back().push_back(field.empty() ? std::nan("") : std::strtod(field.c_str(), nullptr));
    }
  }
  return rows;
}

class Import : public ::testing::TestWithParam<Sample> {};

TEST_P(Import, IsReadOrRefusedWithTheReason) {
  const Sample& sample = GetParam();
  const files::TemporaryFolder folder;
  const ToolRun run = log_samples::import_sample(sample, folder.path());
  if (sample.answer == Answer::refused) {
    EXPECT_EQ(run.exit_code, 2) << run.out;
    EXPECT_THAT(run.err, HasSubstr(sample.says));
    EXPECT_THAT(run.err, HasSubstr(", expected"));
    EXPECT_FALSE(std::filesystem::exists(folder.path() / "out.csv"));
    return;
  }
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.err, HasSubstr(sample.says));
  std::vector<std::string> header;
  const auto rows = table(folder.path() / "out.csv", header);
  const std::vector<Row> truth = log_samples::signal();
  ASSERT_GE(rows.size(), truth.size());
  ASSERT_GE(header.size(), 3U);
  EXPECT_EQ(header[0] + header[1] + header[2], "time_scurrent_avoltage_v");
  const double first_s = rows[0][0];
  for (std::size_t k = 0; k < truth.size(); ++k) {
    ASSERT_NEAR(rows[k][0] - first_s, sample.time_factor * truth[k].time_s, 1e-4)
        << "row " << k;  // a millionth of a minute
    ASSERT_NEAR(rows[k][1], truth[k].current_a, sample.current_step_a) << "row " << k;
    ASSERT_NEAR(rows[k][2], truth[k].voltage_v, sample.voltage_step_v) << "row " << k;
  }
  const auto t = std::find(header.begin(), header.end(), "temperature_c");
  if (t == header.end()) return;
  for (std::size_t k = 0; k < truth.size(); ++k)
    ASSERT_NEAR(rows[k][static_cast<std::size_t>(t - header.begin())], truth[k].temperature_c, 0.06) << "row " << k;
}

INSTANTIATE_TEST_SUITE_P(Logs, Import, ::testing::ValuesIn(log_samples::samples()), [](const auto& of) {
  std::string name;
  for (const char c : of.param.file) name += std::isalnum(static_cast<unsigned char>(c)) != 0 ? c : '_';
  return name;
});

/// ./bms figures writes it.
TEST(ImportTable, IsThatOfTheDocumentation) {
  const std::string page = content(BMS_SOURCE_DIR "/docs/log_formats.md");
  EXPECT_THAT(page, HasSubstr(log_samples::markdown_table()));
}

TEST(ImportTable, HasAtLeastThirtySamples) { EXPECT_GE(log_samples::samples().size(), 30U); }

class ImportFiles : public ::testing::Test {
 protected:
  std::string path(const std::string& name) const { return (folder_.path() / name).string(); }
  std::string write(const std::string& name, const std::string& text) const {
    std::ofstream(path(name), std::ios::binary) << text;
    return path(name);
  }
  files::TemporaryFolder folder_;
};

TEST_F(ImportFiles, TheBatteryDataFormatLosesNothingOnItsWayThroughARecording) {
  std::string text =
      "Test Time / s,Voltage / V,Current / A,Unix Time / s,Cycle Count / 1,Surface Temperature T1 / degC,"
      "Surface Temperature T2 / degC,Charging Capacity / Ah,Step Type,Note\n";
  for (int k = 0; k < 40; ++k) {
    const double i = k % 8 < 4 ? -1.2345678901234567 : 0.1;
    char line[300];
    std::snprintf(line, sizeof line, "%.17g,%.17g,%.17g,%d.25,%d,%.3f,%.3f,%.17g,%s,\"a, %d\"\n", 0.1 * k,
                  3.3 + 0.02 * i + 1e-13 * k, i, 1772690400 + k, k / 10, 25 + 0.001 * k, 24.5, 0.1 / 3 * k,
                  k % 8 < 4 ? "cc discharge" : "rest", k);
    text += line;
  }
  const std::string in = write("in.bdf.csv", text);
  ASSERT_EQ(run_tool("import " + in + " --out " + path("middle.csv")).exit_code, 0);
  EXPECT_THAT(content(path("middle.csv")), HasSubstr("time_s,current_a,voltage_v,temperature_c,unix_time_second"));
  const ToolRun back = run_tool("import " + path("middle.csv") + " --out " + path("out.bdf.csv"));
  ASSERT_EQ(back.exit_code, 0) << back.err;
  // the same columns with the same values, in any order
  const auto columns = [](const std::string& csv) {
    std::map<std::string, std::vector<std::string>> of;
    std::istringstream in_lines(csv);
    std::string line;
    std::vector<std::string> names;
    while (std::getline(in_lines, line)) {
      std::vector<std::string> fields(1);
      bool quoted = false;
      for (const char c : line) {
        if (c == '"') quoted = !quoted;
        if (c == ',' && !quoted)
          fields.emplace_back();
        else if (c != '"')
          fields.back() += c;
      }
      if (names.empty()) {
        names = fields;
        continue;
      }
      for (std::size_t k = 0; k < fields.size(); ++k) of[names[k]].push_back(fields[k]);
    }
    return of;
  };
  const auto before = columns(text), after = columns(content(path("out.bdf.csv")));
  ASSERT_EQ(before.size(), after.size());
  for (const auto& [name, values] : before) {
    ASSERT_TRUE(after.contains(name)) << name;
    ASSERT_EQ(values.size(), after.at(name).size()) << name;
    for (std::size_t k = 0; k < values.size(); ++k) {
      char* end = nullptr;
      const double number = std::strtod(values[k].c_str(), &end);
      if (end != values[k].c_str() && *end == '\0')
        ASSERT_EQ(number, std::strtod(after.at(name)[k].c_str(), nullptr)) << name << " row " << k;
      else
        ASSERT_EQ(values[k], after.at(name)[k]) << name << " row " << k;
    }
  }
}

TEST_F(ImportFiles, AMappingFileNamesTheColumns) {
  std::string text = "t,i,u\n";
  for (const Row& r : log_samples::signal())
    text += std::to_string(r.time_s) + "," + std::to_string(r.current_a) + "," + std::to_string(r.voltage_v) + "\n";
  const std::string csv = write("a.csv", text),
                    map = write("map.txt", "# truck 7\ntime_s = t\ncurrent_a = i\nvoltage_v = u\n");
  const ToolRun run = run_tool("import " + csv + " --map-file " + map + " --out " + path("b.csv"));
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run_tool("import " + csv + " --map-file " + write("bad.txt", "time_s t\n")).err,
              HasSubstr("bad.txt:1: "));
  EXPECT_THAT(run_tool("import " + csv + " --map time_s=x").err, HasSubstr("no column 'x'"));
  EXPECT_THAT(run_tool("import " + csv + " --map speed=t").err, HasSubstr("--map:1: 'speed=t' names no column"));
  EXPECT_THAT(run_tool("import " + csv + " --unit current_a=bar").err, HasSubstr("not a unit of current_a"));
  EXPECT_THAT(run_tool("import " + csv + " --format x").err, HasSubstr("not a format"));
}

TEST_F(ImportFiles, EveryCommandThatReadsARecordingTakesTheSameOptions) {
  std::string text = "t,i,u\n";
  for (int k = 0; k < 1'200; ++k) {
    const double a = k / 60 % 2 == 0 ? -3 : 2;
    text += std::to_string(k) + "," + std::to_string(1e3 * -a) + "," + std::to_string(3.28 + 0.02 * a) + "\n";
  }
  const std::string csv = write("a.csv", text);
  const std::string how =
      " --map time_s=t --map current_a=i --map voltage_v=u --unit time_s=s --unit current_a=mA --unit voltage_v=V "
      "--discharge-positive ";
  const ToolRun replay = run_tool("replay " + csv + how + "--json -");
  EXPECT_EQ(replay.exit_code, 0) << replay.err;
  EXPECT_THAT(replay.out, HasSubstr("current_a from 'i' in mA"));
  EXPECT_EQ(run_tool("simulate --cell table9 --recording " + csv + how + "--out " + path("s.csv")).exit_code, 0);
  EXPECT_EQ(run_tool("diagnose --cell table9 --recording " + csv + how).exit_code, 0);
  EXPECT_THAT(run_tool("identify --help").out, HasSubstr("--discharge-positive"));
  EXPECT_THAT(run_tool("hil --help").out, HasSubstr("--discharge-positive"));
  const ToolRun inverted = run_tool("replay " + csv + how + "--charge-positive");
  EXPECT_EQ(inverted.exit_code, 2);
}

/// Each refusal names an option; with it the next one is another, until the log is read.
TEST_F(ImportFiles, ARefusedHeaderIsReadAfterWhatTheRefusalsAskFor) {
  const auto rows = [](const std::string& header, const char* format) {
    std::string text = header + "\n";
    for (const Row& r : log_samples::signal())
      text += fmt::format(fmt::runtime(format), r.time_s, r.current_a, r.voltage_v) + "\n";
    return text;
  };
  const auto says = [](const std::string& log, const std::string& options) {
    const ToolRun run = run_tool("import " + log + " " + options);
    return run.exit_code == 0 ? "read" : run.err;
  };
  const std::string names = write("names.csv", rows("Time (s),i_batt,u_cell", "{},{},{}"));
  EXPECT_THAT(says(names, ""), HasSubstr("expected --unit current_a=UNIT"));
  EXPECT_THAT(says(names, "--unit current_a=A"), HasSubstr("--map voltage_v=COLUMN"));
  EXPECT_EQ(says(names, "--unit current_a=A --map voltage_v=u_cell"), "read");
  const std::string daly = write("daly.csv", rows("Time (s),Current,SumVoltage", "{},{},5{}"));
  EXPECT_THAT(says(daly, "--map pack_voltage_v=SumVoltage"), HasSubstr("expected --unit current_a=UNIT"));
  EXPECT_EQ(says(daly, "--map pack_voltage_v=SumVoltage --unit current_a=A --series 16"), "read");
  EXPECT_THAT(says(daly, "--unit current_a=A"), HasSubstr("expected --unit pack_voltage_v=UNIT"));
  EXPECT_EQ(says(daly, "--unit current_a=A --unit pack_voltage_v=V --series 16"), "read");
  const std::string cells = write("cells.csv", rows("Time (s),Current (A),Cell 1", "{},{},{}"));
  EXPECT_THAT(says(cells, ""), HasSubstr("column 'Cell 1' states no unit, expected --unit v_*=UNIT"));
  EXPECT_EQ(says(cells, "--unit 'v_*=V'"), "read");
  EXPECT_EQ(says(cells, "'--map=v_1=Cell 1'"), "read");
  const std::string unknown = write("unknown.csv", rows("Time (s),Current (foo),Voltage (V)", "{},{},{}"));
  EXPECT_THAT(says(unknown, ""), HasSubstr("column 'Current (foo)' has the unit 'foo', which is not known, expected "
                                           "--unit current_a=UNIT with one of: A"));
  EXPECT_EQ(says(unknown, "--unit current_a=A"), "read");
  EXPECT_THAT(says(write("time.csv", rows("Time (foo),Current (A),Voltage (V)", "{},{},{}")), ""),
              HasSubstr("has the unit 'foo', which is not known, expected --unit time_s=UNIT"));
  EXPECT_THAT(says(write("arbin.csv", rows("Data_Point,Test_Time,Current", "{},{},{}")), ""),
              HasSubstr("no column 'voltage_v'"))
      << "the format states the unit of the current";
}

TEST_F(ImportFiles, TwoColumnsWithTheNameThatIsUsedAreRefused) {
  const auto says = [&](const std::string& header, const std::string& options = "") {
    std::string text = header + "\n";
    for (const Row& r : log_samples::signal())
      text += fmt::format("{},{},{},1,5\n", r.time_s, r.current_a, r.voltage_v);
    const ToolRun run = run_tool("import " + write("a.csv", text) + " " + options);
    return run.exit_code == 0 ? "read" : run.err;
  };
  EXPECT_THAT(says("Time (s),Current (A),Voltage (V),State,Voltage (V)"),
              HasSubstr("a.csv:1: columns 'Voltage (V)' (3 and 5) have the same name, expected one of them"));
  EXPECT_THAT(says("Time (s),I,Volt,State,Volt", "--map voltage_v=Volt --unit current_a=A"),
              HasSubstr("columns 'Volt' (3 and 5) have the same name"));
  EXPECT_EQ(says("Time (s),Current (A),Voltage (V),Power,Power"), "read") << "not used";
}

/// Four cells of table9's kind at different states of charge, where its OCV is steep.
TEST_F(ImportFiles, APackIsReplayedAsItsMeanAndCellByCell) {
  std::string text = "time_s,current_a,v_1,v_2,v_3,v_4\n";
  for (int k = 0; k < 1'200; ++k) {
    text += std::to_string(k) + ",0";
    for (const double soc : {0.93, 0.95, 0.97, 0.99}) text += "," + std::to_string(2.126 + 1.33 * soc);
    text += "\n";
  }
  const std::string pack = write("pack.csv", text);
  const ToolRun all = run_tool("replay " + pack);
  EXPECT_THAT(all.out, ::testing::ContainsRegex(
                           "Cells at the end: 9[23]\\.[0-9] % \\(cell 1\\) to 9[89]\\.[0-9] % \\(cell 4\\)"));
  EXPECT_THAT(all.out, HasSubstr("at 96."));
  const ToolRun one = run_tool("replay " + pack + " --map voltage_v=v_1");
  EXPECT_THAT(one.out, ::testing::ContainsRegex("at 9[23]\\.[0-9] %"));
  EXPECT_THAT(one.out, Not(HasSubstr("Cells at the end")));
  EXPECT_EQ(run_tool("simulate --cell table9 --recording " + pack + " --initial-soc 0.93 --map voltage_v=v_1 --out " +
                     path("s.csv"))
                .exit_code,
            0);
}

TEST_F(ImportFiles, WithoutTheOptionItIsAnErrorAndWithConfirmationItIsRead) {
  std::string text = "time_s,current_a,voltage_v\n";
  for (const Row& r : log_samples::signal())
    text += std::to_string(r.time_s) + "," + std::to_string(-r.current_a) + "," + std::to_string(r.voltage_v) + "\n";
  const std::string csv = write("a.csv", text);
  const ToolRun refused = run_tool("replay " + csv);
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, HasSubstr("the sign of the current looks inverted"));
  EXPECT_EQ(run_tool("import " + csv + " --charge-positive --out " + path("b.csv")).exit_code, 0);
  EXPECT_THAT(content(path("b.csv")), HasSubstr("15,2.5,3.249"));
  EXPECT_EQ(run_tool("import " + csv + " --discharge-positive --out " + path("c.csv")).exit_code, 0);
  EXPECT_THAT(content(path("c.csv")), HasSubstr("15,-2.5,3.249"));
}

/// Two cells in series whose states of charge differ by 12 %, by the model itself.
TEST_F(ImportFiles, APackIsSimulatedAndIdentifiedCellByCell) {
  std::string profile = "time_s,current_a\n";
  for (int k = 0; k <= 7'200; ++k) {
    constexpr std::array<double, 3> drive = {-5.5, 2.0, -1.0};
    const double drive_a = drive[static_cast<std::size_t>(k) / 60 % 3];
    profile += std::to_string(k) + "," + std::to_string(k < 900 ? 0.0 : drive_a) + "\n";
  }
  write("p.csv", profile);
  std::vector<std::vector<std::string>> lines;
  for (const char* soc : {"0.83", "0.71"}) {
    ASSERT_EQ(run_tool("simulate --cell table9 --noise-v 0.0005 --profile " + path("p.csv") + " --initial-soc " + soc +
                       " --out " + path("c.csv"))
                  .exit_code,
              0);
    std::istringstream in(content(path("c.csv")));
    lines.emplace_back();
    for (std::string line; std::getline(in, line);) lines.back().push_back(line);
  }
  std::string pack = "time_s,current_a,v_1,v_2\n";
  for (std::size_t k = 1; k < lines[0].size(); ++k) {
    const auto voltage = [&](std::size_t cell) {
      const std::string& line = lines[cell][k];
      const std::size_t at = line.find(',', line.find(',') + 1) + 1;
      return line.substr(at, line.find(',', at) - at);
    };
    pack += lines[0][k].substr(0, lines[0][k].find(',', lines[0][k].find(',') + 1)) + "," + voltage(0) + "," +
            voltage(1) + "\n";
  }
  const std::string log = write("pack.csv", pack);
  const ToolRun simulated = run_tool("simulate --cell table9 --initial-soc 0.77 --recording " + log + " --out " +
                                     path("s.csv") + " --json -");
  ASSERT_EQ(simulated.exit_code, 0) << simulated.err;
  const auto cells = nlohmann::json::parse(simulated.out)["cells"];
  ASSERT_EQ(cells.size(), 2U);
  EXPECT_NEAR(cells[0]["initial_soc"], 0.83, 0.01);
  EXPECT_NEAR(cells[1]["initial_soc"], 0.71, 0.01);
  EXPECT_LT(cells[1]["rmse_v"], 0.002);
  EXPECT_THAT(content(path("s.csv")), HasSubstr("time_s,current_a,voltage_v,soc,v_1,v_2"));
  const ToolRun identified =
      run_tool("identify --each-cell --nodes 0.5,0.8 --recording " + log + " --out " + path("my.toml"));
  EXPECT_EQ(identified.exit_code, 0) << identified.err;
  EXPECT_THAT(content(path("my_cell1.toml")), HasSubstr("my_cell1"));
  EXPECT_THAT(content(path("my_cell2.toml")), HasSubstr("my_cell2"));
}

TEST_F(ImportFiles, CutsARecordingByTheTimeSinceItsFirstRow) {
  std::string text = "time_s,current_a,voltage_v,note\n";
  for (int k = 0; k <= 100; ++k) text += std::to_string(5'000 + k) + ",-1,3.3,n" + std::to_string(k) + "\n";
  const std::string log = write("log.csv", text);
  const ToolRun run = run_tool("import " + log + " --from 20 --until 60 --out " + path("part.csv"));
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("41 rows"));
  const std::string part = content(path("part.csv"));
  EXPECT_THAT(part, HasSubstr("5020,-1,3.3"));
  EXPECT_THAT(part, HasSubstr("5060,-1,3.3"));
  EXPECT_THAT(part, HasSubstr("n20"));
  for (const char* outside : {"5019,", "5061,", "n19", "n61"}) EXPECT_THAT(part, Not(HasSubstr(outside)));
  const ToolRun simulated =
      run_tool("simulate --cell table9 --initial-soc 0.5 --recording " + log + " --until 30 --out " + path("s.csv"));
  EXPECT_EQ(simulated.exit_code, 0) << simulated.err;
  EXPECT_THAT(simulated.out, HasSubstr("31 rows"));
  const ToolRun empty = run_tool("import " + log + " --from 95 --out " + path("none.csv"));
  EXPECT_EQ(empty.exit_code, 2);
  EXPECT_THAT(empty.err, HasSubstr("leaves 6 rows of 100 s, expected 10 or more"));
  EXPECT_FALSE(std::filesystem::exists(path("none.csv")));
}

}  // namespace
}  // namespace bms
