// docs/your_own_cell.md from the first command to the last, on exports of a 100 Ah cell whose parameters are known.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <sstream>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "tests/end_to_end/run_tool.hpp"

namespace bms {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::Not;

/// A cell of one RC branch without hysteresis, stepped exactly. Nothing of model/ is used. size: cells of 100 Ah in
/// parallel.
class Truth {
 public:
  static constexpr double capacity_ah = 100, r0_ohm = 0.0006, r1_ohm = 0.0004, c1_f = 60'000;

  Truth(double soc, double size) : size_(size), soc_(soc) {}
  static double ocv(double soc) {
    constexpr std::array<double, 12> at = {0, 0.03, 0.1, 0.2, 0.3, 0.4, 0.6, 0.65, 0.7, 0.9, 0.97, 1};
    constexpr std::array<double, 12> volt = {2.75,  3.05,  3.205, 3.245, 3.275, 3.287,
                                             3.294, 3.305, 3.325, 3.334, 3.342, 3.45};
    std::size_t k = 0;
    while (k + 2 < at.size() && soc > at[k + 1]) ++k;
    return volt[k] + (volt[k + 1] - volt[k]) * (soc - at[k]) / (at[k + 1] - at[k]);
  }
  void step(double current_of_all_a, double seconds) {
    const double current_a = current_of_all_a / size_;
    const double decay = std::exp(-seconds / (r1_ohm * c1_f));
    rc_v_ = decay * rc_v_ + (1 - decay) * r1_ohm * current_a;
    soc_ += current_a * seconds / 3'600 / capacity_ah;
    voltage_ = ocv(soc_) + rc_v_ + r0_ohm * current_a;
    time_s_ += seconds;
  }
  double soc() const { return soc_; }
  double voltage() const { return voltage_; }
  double time_s() const { return time_s_; }

 private:
  double size_, soc_, rc_v_ = 0, voltage_ = 0, time_s_ = 0;
};

/// An export with the columns of a Neware tester: no state of charge, 0.1 mV and 1 mA.
class Export {
 public:
  Export(const std::filesystem::path& path, double soc, double size) : out_(path), size_(size), cell_(soc, size) {
    out_ << "DataPoint,Step Type,Total Time,Current(A),Voltage(V)\n";
  }
  /// cell_a: of each 100 Ah.
  void run(double cell_a, double duration_s, double step_s) {
    const double current_a = size_ * cell_a;
    for (double t = 0; t < duration_s - 1e-6 && inside(current_a); t += step_s) {
      cell_.step(current_a, step_s);
      const auto s = static_cast<long>(std::lround(cell_.time_s()));
      const char* const step = current_a == 0 ? "Rest" : "CC";
      out_ << fmt::format("{},{},{}:{:02}:{:02},{:.3f},{:.4f}\n", ++point_, step, s / 3'600, s / 60 % 60, s % 60,
                          current_a, cell_.voltage());
      soc_.push_back(cell_.soc());
    }
  }
  const std::vector<double>& soc() const { return soc_; }

 private:
  bool inside(double current_a) const {
    if (current_a == 0) return true;
    return current_a > 0 ? cell_.soc() < 1 : cell_.soc() > 0;
  }
  std::ofstream out_;
  double size_;
  Truth cell_;
  int point_ = 0;
  std::vector<double> soc_;  ///< of each row
};

/// A slow discharge and charge in one file, a pulse test, and a day in a truck, whose true SOC is returned.
std::vector<double> write_exports(const std::filesystem::path& folder, double size = 1) {
  Export slow(folder / "slow.csv", 1, size);
  slow.run(0, 3'600, 60);
  slow.run(-5, 30 * 3'600, 60);
  slow.run(0, 7'200, 60);
  slow.run(5, 30 * 3'600, 60);
  slow.run(0, 7'200, 60);
  Export pulses(folder / "hppc.csv", 1, size);
  pulses.run(0, 600, 1);
  for (int k = 0; k < 9; ++k) {
    pulses.run(-100, 30, 1);
    pulses.run(0, 60, 1);
    pulses.run(75, 30, 1);
    pulses.run(0, 60, 1);
    pulses.run(-50, 705, 1);
    pulses.run(0, 1'800, 1);
  }
  Export truck(folder / "truck.csv", 0.95, size);
  truck.run(0, 1'200, 1);
  for (int k = 0; k < 45; ++k) {
    truck.run(-80, 60, 1);
    truck.run(30, 20, 1);
    truck.run(-20, 60, 1);
    truck.run(0, 40, 1);
  }
  return truck.soc();
}

/// RMS of the SOC in a trace of bms replay.
double soc_rms(const std::filesystem::path& trace, const std::vector<double>& truth) {
  std::ifstream in(trace);
  double squares = 0;
  std::size_t rows = 0;
  std::string line;
  for (std::getline(in, line); std::getline(in, line); ++rows) {
    const double error = std::stod(line.substr(line.find(',') + 1)) - truth.at(rows);
    squares += error * error;
  }
  EXPECT_EQ(rows, truth.size());
  return std::sqrt(squares / static_cast<double>(rows));
}

/// A command of the page with what it prints.
struct Step {
  std::string command, output;
};

std::vector<Step> steps_of(const std::string& page) {
  std::vector<Step> steps;
  std::istringstream lines(page);
  bool inside = false;
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("```"))
      inside = line == "```console";
    else if (inside && line.starts_with("$ "))
      steps.push_back({line.substr(2), ""});
    else if (inside && !steps.empty())
      steps.back().output += line + "\n";
  }
  return steps;
}

std::string output_of(const std::string& command, const std::filesystem::path& folder) {
  const std::string out = (folder / "printed").string();
  const std::string tool = command.substr(command.find(' '));
  std::system(("cd '" + folder.string() + "' && '" BMS_TOOL "' " + tool + " >" + out + " 2>&1").c_str());
  return content(out);
}

/// Numbers become '#': digits of a fit may differ between compilers, and speeds between machines.
std::string shape(const std::string& text) {
  return std::regex_replace(text, std::regex(R"([-+]?[0-9]+(\.[0-9]+)?(e[-+]?[0-9]+)?)"), "#");
}

class OwnCell : public ::testing::Test {
 protected:
  files::TemporaryFolder folder_;
  const std::string page_path_ = BMS_SOURCE_DIR "/docs/your_own_cell.md";
};

TEST_F(OwnCell, EveryCommandOfThePagePrintsWhatThePageShows) {
  write_exports(folder_.path());
  std::string page = content(page_path_);
  const std::vector<Step> steps = steps_of(page);
  ASSERT_GE(steps.size(), 6U);
  const bool write = std::getenv("BMS_WRITE_PAGE") != nullptr;
  for (const Step& step : steps) {
    if (step.command.find(" flash ") != std::string::npos) continue;  // flash_test builds images
    const std::string printed = output_of(step.command, folder_.path());
    if (write) {
      const std::size_t at = page.find("$ " + step.command + "\n") + step.command.size() + 3;
      page.replace(at, step.output.size(), printed);
    } else {
      const auto squeezed = [](const std::string& s) { return std::regex_replace(shape(s), std::regex(" +"), " "); };
      EXPECT_EQ(squeezed(printed), squeezed(step.output)) << step.command;
    }
  }
  if (write) std::ofstream(page_path_) << page;
}

/// Without commands and what they print.
TEST_F(OwnCell, NoStepOfThePageHasMoreThanEightLinesOfText) {
  std::istringstream page(content(page_path_));
  std::string step;
  int lines = 0, steps = 0;
  bool fenced = false;
  for (std::string line; std::getline(page, line);) {
    if (line.starts_with("## ")) {
      step = line;
      lines = 0;
      ++steps;
    }
    if (line.starts_with("```")) fenced = !fenced;
    if (!fenced && !line.empty() && !line.starts_with("```") && !line.starts_with("#")) ++lines;
    EXPECT_LE(lines, 8) << step;
  }
  EXPECT_GE(steps, 5);
}

TEST_F(OwnCell, TheCellIsFoundAndItsEstimatesAreRight) {
  const std::vector<double> true_soc = write_exports(folder_.path());
  for (const Step& step : steps_of(content(page_path_))) {
    if (step.command.find(" identify ") != std::string::npos || step.command.find(" replay ") != std::string::npos)
      output_of(step.command + (step.command.find(" replay ") != std::string::npos ? " --trace t.csv --json r.json"
                                                                                   : " --json i.json"),
                folder_.path());
  }
  const json identified = json::parse(content(folder_.path() / "i.json"));
  const auto nodes = identified["parameters"];
  for (const auto& p : nodes) {
    if (p["name"] == "r0_ohm") {
      EXPECT_NEAR(p["value"], Truth::r0_ohm, 0.1 * Truth::r0_ohm);
    } else if (p["name"] == "r1_ohm") {
      EXPECT_NEAR(p["value"], Truth::r1_ohm, 0.25 * Truth::r1_ohm);
    }
    EXPECT_FALSE(p["at_bound"]) << p;
  }
  const json replayed = json::parse(content(folder_.path() / "r.json"));
  EXPECT_NEAR(replayed["soc"]["final"], true_soc.back(), 0.01);
  const double rms = soc_rms(folder_.path() / "t.csv", true_soc);
  EXPECT_LT(rms, 0.01);
  RecordProperty("soc_rms_percent", fmt::format("{:.2f}", 100 * rms));
  EXPECT_TRUE(replayed["reliable"]);
  const std::string cell = content(folder_.path() / "my_cell.toml");
  EXPECT_THAT(cell, HasSubstr("discharge_current_max_a = 200"));
  EXPECT_THAT(cell, Not(HasSubstr("charge_current_max_a = 6")));
}

TEST_F(OwnCell, ACellOf280AhMeetsNoBound) {
  constexpr double size = 2.8;
  const std::vector<double> true_soc = write_exports(folder_.path(), size);
  const std::string in = folder_.path().string() + "/";
  const ToolRun run = run_tool("identify --ocv " + in + "slow.csv --recording " + in +
                               "hppc.csv --initial-soc 1 --voltage-min-v 2.5 --voltage-max-v 3.65 "
                               "--charge-current-max-a 280 --discharge-current-max-a 560 --json - --out " +
                               in + "large.toml");
  ASSERT_EQ(run.exit_code, 0) << run.err;
  for (const auto& p : json::parse(run.out)["parameters"]) {
    EXPECT_FALSE(p["at_bound"]) << p;
    if (p["name"] == "c1_f") {
      EXPECT_NEAR(p["value"], size * Truth::c1_f, 0.3 * size * Truth::c1_f);
    }
  }
  const ToolRun replayed = run_tool("replay " + in + "truck.csv --cell " + in +
                                    "large.toml --initial-soc 0.95 --trace " + in + "t.csv --json -");
  ASSERT_EQ(replayed.exit_code, 0) << replayed.err;
  EXPECT_NEAR(json::parse(replayed.out)["soc"]["final"], true_soc.back(), 0.01);
  EXPECT_LT(soc_rms(in + "t.csv", true_soc), 0.01);
  EXPECT_THAT(content(in + "large.toml"), HasSubstr("discharge_current_max_a = 560"));
}

TEST_F(OwnCell, WithoutASlowTestTheRestsGiveTheOcv) {
  const double end_soc = write_exports(folder_.path()).back();
  const std::string in = folder_.path().string() + "/";
  const ToolRun run = run_tool("identify --recording " + in +
                               "hppc.csv --capacity-ah 100 --initial-soc 1 "
                               "--ocv-from-rests --chemistry LFP --out " +
                               in + "rests.toml");
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.err, HasSubstr("limits of use: "));
  EXPECT_THAT(run.err, HasSubstr("100 A charging, 100 A discharging"));
  EXPECT_THAT(run.err, HasSubstr("OCV from "));
  const ToolRun replay = run_tool("replay " + in + "truck.csv --cell " + in + "rests.toml --initial-soc 0.95 --json -");
  const json soc = json::parse(replay.out)["soc"];
  EXPECT_NEAR(soc["final"], end_soc, 2 * soc["final_sigma"].get<double>()) << "a coarse OCV is stated as such";
  EXPECT_NEAR(soc["final"], end_soc, 0.05);
}

TEST_F(OwnCell, AnotherCapacityThanTheChargeMovedIsRefused) {
  write_exports(folder_.path());
  const std::string in = folder_.path().string() + "/";
  const auto refused = [&](const std::string& options, const std::string& what) {
    const ToolRun run =
        run_tool("identify --recording " + in + "hppc.csv --initial-soc 1 " + options + " --out " + in + "none.toml");
    EXPECT_EQ(run.exit_code, 2) << options;
    EXPECT_THAT(run.err, HasSubstr(what)) << options;
    EXPECT_FALSE(std::filesystem::exists(in + "none.toml")) << options;
  };
  refused("", "expected the capacity of this cell: --capacity-ah");
  refused("--capacity-ah 50", "those of --capacity-ah");
  refused("--ocv " + in + "slow.csv --capacity-ah 110", "91 % of the state of charge, and are not stretched");
  refused("--ocv " + in + "slow.csv --capacity-ah 50", "expected the 50 Ah of --capacity-ah");
}

}  // namespace
}  // namespace bms
