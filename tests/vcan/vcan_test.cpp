// The firmware on a real CAN bus with noise: SocketCAN, in User-Mode Linux if this machine has no vcan0. The output of
// bms monitor must agree with bms replay for the same samples, and with candump and canmatrix for the same frames.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <sstream>

#include "files/cell_file.hpp"
#include "images/firmware_image.hpp"
#include "tests/end_to_end/run_tool.hpp"
#include "tests/pseudo_terminal.hpp"

namespace bms {
namespace {

using ::testing::HasSubstr;

/// Exit code, standard output and standard error of a shell command.
ToolRun run_shell(const std::string& command) {
  const files::TemporaryFolder folder;
  const std::string out = (folder.path() / "out").string(), err = (folder.path() / "err").string();
  const int status = std::system((command + " >" + out + " 2>" + err).c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : 128, content(out), content(err)};
}

/// Writes `count` rows of the forklift shift, from row 3000 on, as a recording.
void write_part(const std::filesystem::path& path, int count) {
  std::ifstream in(BMS_SOURCE_DIR "/evidence/recordings/forklift_shift.csv");
  std::ofstream out(path);
  int row = -1;
  for (std::string line; std::getline(in, line);) {
    if (line.starts_with("#")) continue;
    if (row < 0 || (row >= 3000 && row < 3000 + count)) out << line << "\n";
    ++row;
  }
}

std::vector<double> column(const std::filesystem::path& csv, const std::string& name) {
  std::ifstream in(csv);
  std::string line, field;
  std::getline(in, line);
  std::istringstream head(line);
  std::size_t wanted = 0;
  while (std::getline(head, field, ',') && field != name) ++wanted;
  std::vector<double> values;
  while (std::getline(in, line)) {
    std::istringstream row(line);
    for (std::size_t k = 0; k <= wanted && std::getline(row, field, ','); ++k) {
    }
    values.push_back(field.empty() ? NAN : std::stod(field));
  }
  return values;
}

/// The emulator's serial line is a pseudo-terminal.
class Vcan : public ::testing::Test {
  const tests::PseudoTerminal line_;
};

TEST_F(Vcan, MonitorAndCandumpAgreeWithReplayOnANoisyBus) {
  constexpr int samples = 200;
  const files::TemporaryFolder folder;
  const auto part = folder.path() / "part.csv", trace = folder.path() / "trace.csv";
  write_part(part, samples);
  ASSERT_EQ(run_tool(fmt::format("replay {} --initial-soc 0.8 --initial-soc-sigma 0.05 --trace {} --quiet",
                                 part.string(), trace.string()))
                .exit_code,
            0);
  const auto image = images::firmware_image("netduinoplus2", files::read_cell("table9"), images::Image::application);

  const ToolRun run =
      run_shell(fmt::format("{}/tests/vcan/telemetry.sh {} {} {} {} 0.8 0.05 {}", BMS_SOURCE_DIR, BMS_TOOL,
                            BMS_FEED_SAMPLES, image.string(), part.string(), folder.path().string()));
  if (run.exit_code == 125) GTEST_SKIP() << run.err;
  ASSERT_EQ(run.exit_code, 0) << run.out << run.err << content(folder.path() / "emulator.log");
  EXPECT_THAT(run.out, HasSubstr(fmt::format("{} samples", samples)));

  const auto report = nlohmann::json::parse(content(folder.path() / "monitor.json"));
  EXPECT_EQ(report["dropped"], 0);
  EXPECT_GT(report["other_ids"]["frames"], 2'000) << "the bus must be noisy";
  EXPECT_GT(report["other_kinds"]["remote"], 0);
  EXPECT_GT(report["other_kinds"]["fd"], 0);
  for (const auto& [name, message] : report["messages"].items()) {
    EXPECT_EQ(message["lost"], 0) << name;
    EXPECT_EQ(message["repeated"], 0) << name;
    EXPECT_EQ(message["crc_errors"], 0) << name;
  }
  EXPECT_EQ(report["messages"]["Status"]["frames"], samples);

  // the published estimate of each sample, within half a step of 0.002 %
  const auto soc = column(trace, "soc"), sigma = column(trace, "soc_sigma"),
             monitored = column(folder.path() / "rows.csv", "PackState.Soc [%]"),
             monitored_sigma = column(folder.path() / "rows.csv", "PackState.SocSigma [%]");
  ASSERT_EQ(soc.size(), samples);
  ASSERT_EQ(monitored.size(), samples);
  for (std::size_t k = 0; k < soc.size(); ++k) {
    ASSERT_NEAR(monitored[k], 100 * soc[k], 0.00101) << k;
    ASSERT_NEAR(monitored_sigma[k], 100 * sigma[k], 0.00101) << k;
  }
  EXPECT_NEAR(report["pack"]["soc"].get<double>(), soc.back(), 1.01e-5);
  EXPECT_GT(std::abs(soc.back() - soc.front()), 1e-3) << "the state of charge must change";

  const ToolRun other =
      run_shell(fmt::format("/usr/bin/python3 {}/tests/vcan/compare_with_canmatrix.py {}/firmware/can/greybox_bms.dbc "
                            "{f}/candump.log {f}/rows.csv {f}/monitor.json",
                            BMS_SOURCE_DIR, BMS_SOURCE_DIR, fmt::arg("f", folder.path().string())));
  EXPECT_EQ(other.exit_code, 0) << other.out << other.err;
  std::printf("%s", other.out.c_str());

  // the recorded log gives the same report
  const auto again = run_tool("monitor file:" + (folder.path() / "record.log").string() + " --json -");
  ASSERT_EQ(again.exit_code, 0) << again.err;
  auto live = report, replayed = nlohmann::json::parse(again.out);
  for (auto* json : {&live, &replayed}) {
    json->erase("source");
    json->erase("silent_s");
  }
  EXPECT_EQ(live, replayed);
}

}  // namespace
}  // namespace bms
