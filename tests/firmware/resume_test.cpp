// Switches the application image in the emulator off and on again. Both runs share a file as flash.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>

#include "files/cell_file.hpp"
#include "files/recording.hpp"
#include "files/text_file.hpp"
#include "images/firmware_image.hpp"
#include "replay/replay.hpp"
#include "tests/firmware/slcan_board.hpp"

namespace bms::firmware {
namespace {

constexpr double percent = 500;  // raw soc: 0.002 %
constexpr const char* start_at_80_percent_to_1 = "t31080008AF2F80969800\r";

std::filesystem::path image() {
  return images::firmware_image("netduinoplus2", files::read_cell("table9"), images::Image::application);
}

/// Seven minutes of the shift, one sample per second.
std::vector<measurement::Sample> some_minutes() {
  const auto all =
      measurement::samples(files::read_recording(BMS_SOURCE_DIR "/evidence/recordings/forklift_shift.csv"));
  return {all.begin() + 3'000, all.begin() + 3'420};
}

class Board {
 public:
  explicit Board(const std::filesystem::path& flash) : board_(image(), {flash.string()}) {
    board_.read();
    board_.write("O\r");
    board_.read();
  }
  void send(const char* frame) { board_.write(frame); }
  BoardTelemetry sample(const measurement::Sample& s) {
    board_.send_sample(s.time_us, s.current_ua, s.voltage_uv, s.temperature_cdegc);
    return board_.telemetry();
  }
  BoardTelemetry drive(const std::vector<measurement::Sample>& part) {
    BoardTelemetry last;
    for (const measurement::Sample& s : part) last = sample(s);
    return last;
  }
  /// Sends the first sample and returns the message Storage: state, broken sectors, newer records, erases, starts.
  std::string storage(const measurement::Sample& s) {
    board_.send_sample(s.time_us, s.current_ua, s.voltage_uv, s.temperature_cdegc);
    return board_.read_until("t1B88").substr(5);
  }
  void switch_off() {
    board_.write("C\r");
    EXPECT_EQ(board_.wait(), 0);
  }

 private:
  SlcanBoard board_;
};

/// The frame with a starting point, taken from telemetry.
std::string start(const BoardTelemetry& t) {
  std::string frame = "t3108";
  for (const std::uint32_t ppb : {20'000U * t.soc, 20'000U * t.soc_sigma}) {
    for (int k = 0; k < 4; ++k) frame += fmt::format("{:02X}", ppb >> (8 * k) & 0xFF);
  }
  return frame + "\r";
}

class Resume : public ::testing::Test {
 protected:
  std::filesystem::path flash() const { return folder_.path() / "flash"; }
  /// Starts a board without stored data from a given starting point.
  BoardTelemetry start_given(const BoardTelemetry& t, const measurement::Sample& s) const {
    Board board(folder_.path() / "empty");
    board.send(start(t).c_str());
    return board.sample(s);
  }
  files::TemporaryFolder folder_;
  std::vector<measurement::Sample> part_ = some_minutes();
};

void print_soc(const char* what, const BoardTelemetry& t) {
  std::printf("%s: soc %.2f %% +- %.2f %%\n", what, t.soc / percent, t.soc_sigma / percent);
}

TEST_F(Resume, AfterAShutdownSocContinues) {
  BoardTelemetry before;
  {
    Board board(flash());
    board.send(start_at_80_percent_to_1);
    before = board.drive(part_);
    board.switch_off();
  }
  EXPECT_EQ(std::filesystem::file_size(flash()), 3U * 16 * 1024);
  BoardTelemetry fresh;
  {
    Board board(folder_.path() / "another");
    fresh = board.sample(part_.back());
  }
  const BoardTelemetry given = start_given(before, part_.back());
  Board board(flash());
  const BoardTelemetry after = board.sample(part_.back());
  print_soc("at the shutdown", before);
  print_soc("resumed, including the first voltage", after);
  print_soc("started from the value shown at the shutdown", given);
  print_soc("without stored data", fresh);
  EXPECT_NEAR(after.soc, given.soc, 2)
      << "counts of 0.002 %: equal to a given starting point, to the last digit of the message";
  EXPECT_NEAR(after.soc_sigma, given.soc_sigma, 2);
  EXPECT_LT(std::abs(static_cast<int>(after.soc) - static_cast<int>(before.soc)), static_cast<int>(before.soc_sigma));
  EXPECT_GT(fresh.soc_sigma, 3 * after.soc_sigma) << "a voltage on the plateau carries little information";
}

TEST_F(Resume, AfterALossOfSupplySocIsThatOfTheLastMinuteWithALargerSigma) {
  BoardTelemetry before;
  {
    Board board(flash());
    board.send(start_at_80_percent_to_1);
    before = board.drive(part_);
  }  // the emulator is killed
  Board board(flash());
  const BoardTelemetry after = board.sample(part_.back());
  print_soc("when the supply was cut", before);
  print_soc("resumed", after);
  EXPECT_NEAR(after.soc, before.soc, 2 * percent) << "change in a minute at 1C";
  EXPECT_LT(std::abs(static_cast<int>(after.soc) - static_cast<int>(before.soc)),
            2 * static_cast<int>(after.soc_sigma));
}

TEST_F(Resume, AGivenStartingPointReplacesTheStoredOne) {
  {
    Board board(flash());
    board.send(start_at_80_percent_to_1);
    board.drive({part_.begin(), part_.begin() + 200});
    board.switch_off();
  }
  Board board(flash());
  board.send(
      "t3108"
      "00E9A435"
      "40420F00"
      "\r");  // 900,000,000 and 1,000,000 ppb
  EXPECT_NEAR(board.sample(part_[0]).soc, 90 * percent, 0.2 * percent);
}

TEST_F(Resume, StorageMessageCountsTheStarts) {
  for (int starts = 1; starts <= 3; ++starts) {
    Board board(flash());
    const std::string bytes = board.storage(part_[0]);
    EXPECT_EQ(bytes[2], '1') << "works: " << bytes;
    EXPECT_EQ(bytes.substr(4, 2), "00") << "no broken sector, no newer record: " << bytes;
    EXPECT_EQ(bytes.substr(10), fmt::format("{:02X}0000", starts)) << bytes;
    board.switch_off();
  }
}

TEST_F(Resume, AFlashFileOfAnyContentIsUsable) {
  std::string noise(3 * 16 * 1024, '\0');
  unsigned state = 1;
  for (char& c : noise) c = static_cast<char>((state = state * 1'664'525 + 1'013'904'223) >> 24);
  files::write_file(flash(), noise);
  BoardTelemetry before;
  {
    Board board(flash());
    board.send(start_at_80_percent_to_1);
    before = board.drive({part_.begin(), part_.begin() + 200});
    board.switch_off();
  }
  const BoardTelemetry given = start_given(before, part_[0]);
  Board board(flash());
  EXPECT_NEAR(board.sample(part_[0]).soc, given.soc, 2);
}

}  // namespace
}  // namespace bms::firmware
