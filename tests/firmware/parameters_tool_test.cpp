// bms parameters and the forklift board's product image in the emulator: the test is the line between them and another
// node that measures the cells. get, set, save and load as a workshop uses them, and after the next start.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "files/cell_file.hpp"
#include "files/temporary_folder.hpp"
#include "files/text_file.hpp"
#include "hal/sample_frames.hpp"
#include "images/child_process.hpp"
#include "images/firmware_image.hpp"
#include "tests/firmware/unicorn_board.hpp"
#include "tests/pseudo_terminal.hpp"

namespace bms::firmware {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

constexpr const char *own_key = "1032547698BADCFE0F1E2D3C4B5A6978", *other_key = "00000000000000000000000000000001";
/// The key and its CRC-32, of Python's zlib.crc32.
constexpr std::array<std::uint8_t, 20> block_of_the_key{0x10, 0x32, 0x54, 0x76, 0x98, 0xBA, 0xDC, 0xFE, 0x0F, 0x1E,
                                                        0x2D, 0x3C, 0x4B, 0x5A, 0x69, 0x78, 0x94, 0xCC, 0x18, 0x70};

/// A battery behind a serial adapter, with a sample each 100 ms of its own time.
class Battery {
 public:
  explicit Battery(const std::vector<std::uint8_t>& flash = {}) : board_(product()) {
    if (!flash.empty()) board_.flash.bytes = flash;
    board_.write_one_time_memory(block_of_the_key);
    EXPECT_TRUE(board_.run_until([&] { return board_.can.on_the_bus(); }, 2'000));
    for (int k = 0; k < 5; ++k) pass();
  }
  ~Battery() {
    EXPECT_THAT(board_.can.violations, IsEmpty());
    EXPECT_THAT(board_.flash.violations, IsEmpty());
  }
  Battery(const Battery&) = delete;
  Battery& operator=(const Battery&) = delete;

  const char* line() const { return line_.name(); }
  const std::vector<std::uint8_t>& flash() const { return board_.flash.bytes; }
  /// Passes 100 ms, and all frames both ways.
  void pass() {
    from_the_tool();
    measurement::PackSample<cells> pack;
    pack.time_us = 100'000 * ++samples_;
    pack.current_ua = 0;
    pack.cell_uv.fill(3'280'000 + static_cast<std::int32_t>(samples_ % 3) * 300);
    pack.pack_uv = static_cast<std::int32_t>(cells) * pack.cell_uv[0];
    pack.temperature_cdegc.fill(2'500);
    for (const can::Frame& f : hal::frames_of(pack, 0, static_cast<std::uint16_t>(samples_), 0))
      board_.can.others.push_back({wire_frame(f), board_.can.now_bit, true});
    board_.run_for_ms(100);
    for (; seen_ < board_.can.seen.size(); ++seen_) {
      if (board_.can.seen[seen_].from_board && open_) line_.write(text_of(board_.can.seen[seen_].frame));
    }
  }

 private:
  static constexpr std::size_t cells = 16;  // of the forklift board

  static std::filesystem::path product() {
    return images::firmware_image("stm32f405_forklift", files::read_cell("table9"), images::Image::remote_product);
  }
  static std::string text_of(const can::Frame& f) {
    std::string text = fmt::format("t{:03X}{}", f.id, f.length);
    for (unsigned k = 0; k < f.length; ++k) text += fmt::format("{:02X}", f.data[k]);
    return text + "\r";
  }
  void from_the_tool() {
    typed_ += line_.read();
    for (std::size_t end; (end = typed_.find('\r')) != std::string::npos; typed_.erase(0, end + 1)) {
      if (typed_[0] == 'O') open_ = true;
      if (typed_[0] == 't') receive(typed_.substr(1, end - 1));
      line_.write("\r");
    }
  }
  void receive(const std::string& hex) {
    can::Frame f{static_cast<std::uint32_t>(std::stoul(hex.substr(0, 3), nullptr, 16)),
                 static_cast<std::uint8_t>(hex[3] - '0'),
                 {}};
    for (unsigned k = 0; k < f.length; ++k)
      f.data[k] = static_cast<std::uint8_t>(std::stoul(hex.substr(4 + 2 * k, 2), nullptr, 16));
    board_.can.others.push_back({wire_frame(f), board_.can.now_bit, true});
  }

  UnicornBoard board_;
  tests::PseudoTerminal line_;
  std::uint64_t samples_ = 0;
  std::size_t seen_ = 0;
  bool open_ = false;
  std::string typed_;
};

class ParametersTool : public ::testing::Test {
 protected:
  ParametersTool() {
    files::write_file(path("own.key"), own_key);
    files::write_file(path("other.key"), other_key);
  }
  std::string path(const char* name) const { return (folder_.path() / name).string(); }
  /// Runs the command to its end, and returns what it has written.
  std::string run(Battery& battery, const std::vector<std::string>& words, int exit_code = 0) const {
    std::vector<std::string> argv{BMS_TOOL, "parameters", std::string("slcan:") + battery.line()};
    argv.insert(argv.end(), words.begin(), words.end());
    images::ChildProcess tool(argv, path("log"));
    for (int k = 0; k < 3'000 && tool.running(); ++k) battery.pass();
    EXPECT_FALSE(tool.running()) << "five minutes of the battery";
    const int code = tool.wait();
    const std::string text = files::read_file(path("log"));
    EXPECT_EQ(code, exit_code) << text;
    return text;
  }
  std::string value(Battery& battery, const std::string& name) const {
    const std::string text = run(battery, {"get", name});
    const std::size_t at = text.find(name);
    if (at == std::string::npos) return text;
    const std::size_t first = text.find_first_not_of(' ', at + name.size());
    return text.substr(first, text.find(' ', first) - first);
  }

  files::TemporaryFolder folder_;
  tests::PseudoTerminal probe_;  ///< skips a test whose batteries could open none
};

TEST_F(ParametersTool, GetsSetsSavesAndLoadsAndTheNextStartHasThem) {
  std::vector<std::uint8_t> flash;
  {
    Battery battery;
    EXPECT_THAT(run(battery, {"get"}), AllOf(HasSubstr("cell_voltage_max"), HasSubstr("can_bit_rate"),
                                             HasSubstr("block: "), HasSubstr("revision 0")));
    EXPECT_EQ(value(battery, "cell_voltage_max"), "3.650");
    run(battery, {"save", path("before.toml")});
    EXPECT_THAT(files::read_file(path("before.toml")), HasSubstr("cell_voltage_max = 3.650"));
    EXPECT_THAT(run(battery, {"set", "cell_voltage_max", "3.55", "--key", path("own.key"), "--operator", "42"}),
                HasSubstr("cell_voltage_max: 3.650 -> 3.550 V"));
    EXPECT_EQ(value(battery, "cell_voltage_max"), "3.550");
    flash = battery.flash();
  }
  Battery battery(flash);
  EXPECT_EQ(value(battery, "cell_voltage_max"), "3.550") << "after a start";
  EXPECT_THAT(run(battery, {"load", path("before.toml"), "--key", path("own.key")}),
              HasSubstr("cell_voltage_max: 3.550 -> 3.650 V"));
  EXPECT_EQ(value(battery, "cell_voltage_max"), "3.650");
}

TEST_F(ParametersTool, RefusesInOneLineAndChangesNothing) {
  Battery battery;
  const std::string out_of_range = run(battery, {"set", "cell_voltage_max", "3.9", "--key", path("own.key")}, 2);
  EXPECT_THAT(out_of_range, AllOf(HasSubstr("out of range"), HasSubstr("3.650")));
  EXPECT_EQ(std::count(out_of_range.begin(), out_of_range.end(), '\n'), 1) << out_of_range;
  EXPECT_THAT(run(battery, {"set", "cell_voltage_max", "3.5", "--key", path("other.key")}, 1),
              AllOf(HasSubstr("no parameter has changed"), Not(HasSubstr("->"))));
  EXPECT_THAT(run(battery, {"set", "cell_voltage_max", "3.5"}, 2), HasSubstr("--key"));
  files::write_file(path("odd.toml"), "format = 1\n\n[parameters]\ncell_voltage_max = 3.5\ncell_votlage_min = 2.6\n");
  EXPECT_THAT(run(battery, {"load", path("odd.toml"), "--key", path("own.key")}, 2), HasSubstr("odd.toml:5"));
  EXPECT_EQ(value(battery, "cell_voltage_max"), "3.650");
}

}  // namespace
}  // namespace bms::firmware
