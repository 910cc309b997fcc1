// bms log and the application image in the emulator: a fault is read back as it happened. The test is the line between
// them; it loses frames. And batteries that cannot answer.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <functional>
#include <nlohmann/json.hpp>

#include "can_messages.hpp"
#include "files/cell_file.hpp"
#include "files/text_file.hpp"
#include "hal/slcan/codec.hpp"
#include "images/firmware_image.hpp"
#include "tests/firmware/slcan_board.hpp"
#include "tests/pseudo_terminal.hpp"

namespace bms::firmware {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

/// The line to an adapter: the tool opens its name.
class AdapterLine : public tests::PseudoTerminal {
 public:
  /// The lines that the tool has sent since the last call; frames only.
  std::vector<std::string> frames() {
    received_ += read();
    std::vector<std::string> lines;
    for (std::size_t end = 0; (end = received_.find('\r')) != std::string::npos; received_.erase(0, end + 1)) {
      if (received_[0] == 't') lines.push_back(received_.substr(0, end));
    }
    return lines;
  }

 private:
  std::string received_;
};

class LogTool : public ::testing::Test {
 protected:
  std::string path(const char* name) const { return (folder_.path() / name).string(); }
  std::vector<std::string> command() const {
    return {"/usr/bin/env", "BMS_PROGRESS=off", BMS_TOOL, "log",           std::string("slcan:") + line_.name(),
            "--out",        path("faults.csv"), "--json", path("log.json")};
  }
  static std::filesystem::path image() {
    return images::firmware_image("netduinoplus2", files::read_cell("table9"), images::Image::application);
  }

  files::TemporaryFolder folder_;
  AdapterLine line_;
};

/// The emulated board with its samples, one per second.
class Board {
 public:
  Board(const std::filesystem::path& image, const std::string& flash) : board_(image, {flash}) {
    board_.read();
    board_.write("O\r");
    board_.read();
  }
  void forward(const std::string& frame) const { board_.write(frame + "\r"); }
  /// Sends a sample and returns the frames up to Status.
  std::vector<std::string> sample(std::int32_t voltage_uv, std::int32_t current_ua) {
    ++seconds_;
    board_.send_sample(1'000'000 * seconds_, current_ua, voltage_uv + static_cast<std::int32_t>(seconds_ % 7) * 10,
                       2'500);
    std::vector<std::string> frames;
    for (std::string text; !text.starts_with("t182");) {
      text = board_.read();
      if (text.starts_with("t")) frames.push_back(text);
    }
    return frames;
  }

 private:
  SlcanBoard board_;
  std::uint64_t seconds_ = 0;
};

TEST_F(LogTool, ReadsAFaultOfTheEmulatedBoardAndAsksAgainForALostFrame) {
  Board board(image(), path("flash"));
  for (int k = 0; k < 70; ++k) board.sample(3'300'000, -1'000'000);
  for (int k = 0; k < 8; ++k) board.sample(3'750'000, 3'000'000);
  for (int k = 0; k < 20; ++k) board.sample(3'300'000, -6'000'000);
  images::ChildProcess tool(command(), path("out"));
  int asked = 0, lost = 0;
  while (tool.running()) {
    for (const std::string& frame : line_.frames()) {
      asked += frame.starts_with("t1A0") ? 1 : 0;
      board.forward(frame);
    }
    for (const std::string& frame : board.sample(3'300'000, -1'000'000)) {
      if (frame.starts_with("t1A5") && lost++ == 1) continue;  // the readings of the second fault
      line_.write(frame + "\r");
    }
  }
  EXPECT_EQ(tool.wait(), 0) << files::read_file(path("out"));
  EXPECT_GE(asked, 2) << "the lost frame";
  const json log = json::parse(files::read_file(path("log.json")));
  const json* fault = nullptr;
  for (const json& f : log["faults"]) {
    if (f["name"] == "cell overvoltage") fault = &f;
  }
  ASSERT_NE(fault, nullptr) << log.dump();
  EXPECT_NEAR((*fault)["cell_voltage_max_v"].get<double>(), 3.75, 0.0011);
  EXPECT_NEAR((*fault)["cell_voltage_min_v"].get<double>(), 3.75, 0.0011);
  EXPECT_EQ((*fault)["current_a"], 3);
  EXPECT_EQ((*fault)["temperature_max_c"], 25);
  EXPECT_GT((*fault)["unix_time_s"], 1'700'000'000) << "the emulated calendar clock runs";
  EXPECT_NEAR(log["highest"]["cell_voltage_v"].get<double>(), 3.75, 0.0011);
  EXPECT_EQ(log["lowest"]["current_a"], -6) << log.dump();
  EXPECT_EQ(log["highest"]["current_a"], 3);
  EXPECT_NEAR(log["operating_s"].get<double>(), 90, 40);
  EXPECT_EQ(log["can"]["state"], "active");
  const std::string csv = files::read_file(path("faults.csv"));
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), static_cast<long>(log["faults"].size()) + 1);
  EXPECT_THAT(csv, HasSubstr("cell overvoltage,"));
}

/// A battery that only answers the commands.
TEST_F(LogTool, SaysInOneLineThatAnOldFirmwareCannotAnswer) {
  images::ChildProcess tool(command(), path("out"));
  std::uint8_t counter = 0;
  while (tool.running()) {
    for (const std::string& text : line_.frames()) {
      can::Frame frame;
      ASSERT_TRUE(hal::slcan::decode(text, frame));
      can::CommandAnswer answer;
      answer.code = can::Command::of(frame).code;
      answer.command_counter = can::counter_of(frame);
      answer.result = can::CommandAnswer::result_no_such_command;
      std::array<char, hal::slcan::longest_frame> encoded;
      line_.write(std::string(hal::slcan::encode(answer.frame(counter), encoded)));
      counter = can::next(counter);
    }
    usleep(10'000);
  }
  EXPECT_EQ(tool.wait(), 1);
  EXPECT_EQ(files::read_file(path("out")), std::string("slcan:") + line_.name() +
                                               ": the firmware of this battery cannot send its stored data; update the "
                                               "firmware\n");
  EXPECT_FALSE(std::filesystem::exists(path("faults.csv"))) << "nothing incomplete is written";
}

TEST_F(LogTool, SaysInOneLineThatNothingArrives) {
  images::ChildProcess tool(command(), path("out"));
  EXPECT_EQ(tool.wait(), 1);
  EXPECT_EQ(files::read_file(path("out")),
            std::string("slcan:") + line_.name() +
                ": no frames received; check that the battery is switched on, the wiring and the bit rate\n");
}

}  // namespace
}  // namespace bms::firmware
