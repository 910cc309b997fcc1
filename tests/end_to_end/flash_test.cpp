// bms flash: the commands for OpenOCD, and how OpenOCD executes them without a probe: with its dummy adapter, a test
// processor without function and a simulated flash.
#include <regex>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "files/temporary_folder.hpp"
#include "images/child_process.hpp"
#include "images/firmware_image.hpp"
#include "images/flash_plan.hpp"
#include "images/image_file.hpp"
#include "tests/end_to_end/run_tool.hpp"

namespace bms {
namespace {

using ::testing::HasSubstr;

const ToolRun& dry_run() {
  static const ToolRun run = run_tool("flash --board stm32f405_forklift --dry-run");
  return run;
}

/// The -c arguments, in their order, without quotes.
std::vector<std::string> commands(const std::string& line) {
  static const std::regex command("-c ('[^']*'|[^ \\n]+)");
  std::vector<std::string> found;
  for (std::sregex_iterator it(line.begin(), line.end(), command), end; it != end; ++it) {
    std::string text = (*it)[1];
    found.push_back(text[0] == '\'' ? text.substr(1, text.size() - 2) : text);
  }
  return found;
}

std::vector<std::string> that_begin(const std::vector<std::string>& all, const std::string& with) {
  std::vector<std::string> found;
  for (const std::string& c : all) {
    if (c.starts_with(with)) found.push_back(c);
  }
  return found;
}

struct Written {
  std::string path;
  std::uint32_t address = 0;
};
std::vector<Written> written(const std::vector<std::string>& all) {
  static const std::regex write("flash write_image erase \\{(.*)\\} (0x[0-9a-f]+) bin");
  std::vector<Written> found;
  for (const std::string& c : that_begin(all, "flash write")) {
    std::smatch m;
    if (std::regex_match(c, m, write))
      found.push_back({m[1], static_cast<std::uint32_t>(std::stoul(m[2], nullptr, 16))});
  }
  return found;
}

TEST(Flash, MakesOpenOcdWriteCompareAndReset) {
  ASSERT_EQ(dry_run().exit_code, 0) << dry_run().err;
  EXPECT_THAT(dry_run().out, ::testing::StartsWith("openocd -f interface/stlink.cfg -f target/stm32f4x.cfg "));
  const auto all = commands(dry_run().out);
  const auto parts = written(all);
  ASSERT_EQ(parts.size(), 2U);
  EXPECT_EQ(parts[0].address, 0x08000000U);
  EXPECT_EQ(parts[1].address, 0x08010000U);
  for (const Written& w : parts) {
    EXPECT_THAT(w.path, HasSubstr("bms_stm32f405_forklift.elf"));
    EXPECT_THAT(all, ::testing::Contains(fmt::format("verify_image {{{}}} {:#010x} bin", w.path, w.address)));
  }
  EXPECT_EQ(that_begin(all, "flash").size(), parts.size()) << "nothing else is written or erased";
  const auto at = [&](const std::string& c) {
    return std::find_if(all.begin(), all.end(), [&](const std::string& one) { return one.starts_with(c); }) -
           all.begin();
  };
  EXPECT_LT(at("init"), at("reset halt"));
  EXPECT_LT(at("reset halt"), at("dump_image"));
  EXPECT_LT(at("dump_image"), at("flash write_image"));
  EXPECT_LT(at("flash write_image"), at("verify_image"));
  EXPECT_EQ(all[all.size() - 2], "reset run");
  EXPECT_EQ(all.back(), "shutdown");
}

TEST(Flash, PartsAreTheImageAndLeaveTheStoredRecordsSectorsAlone) {
  const auto all = commands(dry_run().out);
  const auto parts = written(all);
  ASSERT_FALSE(parts.empty());
  const std::string elf = parts[0].path.substr(0, parts[0].path.find(".elf") + 4);
  const images::ImageFile image(elf);
  for (const images::LoadedPart& part : image.parts()) {
    const auto holds = std::find_if(parts.begin(), parts.end(), [&](const Written& w) {
      return w.address <= part.address && part.address + part.bytes.size() <= w.address + content(w.path).size();
    });
    ASSERT_NE(holds, parts.end()) << std::hex << part.address;
    EXPECT_EQ(content(holds->path).substr(part.address - holds->address, part.bytes.size()), part.bytes);
  }
  for (std::size_t k = 0; k < parts.size(); ++k) {
    const std::uint64_t begin = parts[k].address, end = begin + content(parts[k].path).size();
    // RM0090, table 5: sectors 0 to 3 have 16 KiB, 4 has 64, the others 128; boards/stm32f405_forklift/memory.ld gives
    // 1 to 3 to the records
    EXPECT_TRUE(end <= 0x08004000U || begin >= 0x08010000U) << std::hex << begin << " to " << end;
  }
  EXPECT_THAT(that_begin(all, "dump_image")[0], HasSubstr("0x08004000 0xc000"));
  const auto storage = images::storage_of(image);
  ASSERT_TRUE(storage);
  EXPECT_EQ(storage->begin, 0x08004000U);
  EXPECT_EQ(storage->end, 0x08010000U);
}

TEST(Flash, RefusesAnImageWithBytesInTheStoredRecordsSectors) {
  const images::AddressRange storage{0x08004000, 0x08010000};
  EXPECT_EQ(images::parts_to_write({{0x08000000, std::string(0x4000, 'x')}, {0x08010000, "x"}}, storage).size(), 2U);
  EXPECT_THROW(images::parts_to_write({{0x08000000, std::string(0x4001, 'x')}}, storage), std::runtime_error);
  EXPECT_THROW(images::parts_to_write({{0x0800FFFF, "x"}}, storage), std::runtime_error);
  EXPECT_THROW(images::parts_to_write({{0x08000000, std::string(0x20000, 'x')}}, storage), std::runtime_error);
  EXPECT_THROW(images::parts_to_write({}, storage), std::runtime_error);
}

TEST(Flash, WritesPartsThatMayShareASectorAtOnce) {
  const auto joined = images::parts_to_write({{0x08010000, "abc"}, {0x08010004, "d"}, {0x08010005, "e"}},
                                             images::AddressRange{0x08004000, 0x08010000});
  ASSERT_EQ(joined.size(), 1U);
  EXPECT_EQ(joined[0].bytes,
            "abc\xFF"
            "de");
  EXPECT_THROW(images::parts_to_write({{0, "abc"}, {2, "d"}}, std::nullopt), std::runtime_error);
}

/// The same commands without those that read memory, which the test processor does not have.
TEST(Flash, OpenOcdAcceptsTheCommandsAndWritesNothingBetweenTheParts) {
  const files::TemporaryFolder folder;
  std::string command =
      "openocd -c 'adapter driver dummy' -c 'transport select jtag' -c 'jtag newtap chip cpu -irlen 4' -c 'target "
      "create chip.cpu testee -chain-position chip.cpu' "
      "-c 'flash bank chip.flash faux 0x08000000 0x100000 0 0 chip.cpu'";
  std::uint64_t bytes = 0;
  const auto all = commands(dry_run().out);
  for (const std::string& c : all) {
    if (!c.starts_with("dump_image") && !c.starts_with("verify_image") && !c.starts_with("reset"))
      command += " -c '" + c + "'";
  }
  const auto log = folder.path() / "log";
  const int status = std::system((command + " >" + log.string() + " 2>&1").c_str());
  const std::string said = content(log);
  EXPECT_EQ(status, 0) << said;
  for (const Written& w : written(all)) {
    bytes = (content(w.path).size() + 0xFFFF) & ~std::uint64_t{0xFFFF};  // the simulated flash has sectors of 64 KiB
    EXPECT_THAT(said, HasSubstr(fmt::format("wrote {} bytes from file {}", bytes, w.path)));
  }
  EXPECT_THAT(said, ::testing::Not(HasSubstr("extra erase range")));
}

/// OpenOCD knows the probe and the chip of every board, and the commands before init.
TEST(Flash, OpenOcdKnowsEveryBoardsProbeAndChip) {
  for (const std::string& board : images::board_names()) {
    const files::TemporaryFolder folder;
    const images::Probe probe{images::board_setting(board, "BMS_PROBE"),
                              images::board_setting(board, "BMS_PROBE_TARGET"), "no-such-probe"};
    auto command = images::openocd_command(probe, {}, std::nullopt, "");
    const auto init = std::find(command.begin(), command.end(), "init");
    ASSERT_NE(init, command.end());
    *init = "shutdown";
    command.erase(init + 1, command.end());
    EXPECT_EQ(images::ChildProcess(command, folder.path() / "log").wait(), 0)
        << board << ": " << content(folder.path() / "log");
  }
}

TEST(Flash, NamesWhatIsMissing) {
  // a serial number that no probe has, so nothing is written even if a probe is connected
  const ToolRun no_probe = run_tool("flash --board stm32f405_forklift --serial no-such-probe");
  EXPECT_EQ(no_probe.exit_code, 2) << no_probe.out << no_probe.err;
  EXPECT_THAT(no_probe.err, HasSubstr("no stlink probe with the serial number no-such-probe found"));
  const ToolRun no_such_kind = run_tool("flash --board stm32f405_forklift --probe no-such-kind");
  EXPECT_EQ(no_such_kind.exit_code, 2);
  EXPECT_THAT(no_such_kind.err, HasSubstr("no interface/no-such-kind.cfg"));
  const ToolRun no_board = run_tool("flash --board no-such-board --dry-run");
  EXPECT_EQ(no_board.exit_code, 2);
  EXPECT_THAT(no_board.err, HasSubstr("no such board"));
  const files::TemporaryFolder empty;
  const int status = std::system(
      ("PATH=" + empty.path().string() + " \"" BMS_TOOL "\" flash 2>" + (empty.path() / "err").string()).c_str());
  EXPECT_EQ(WEXITSTATUS(status), 2);
  EXPECT_THAT(content(empty.path() / "err"), HasSubstr("openocd:1: not installed"));
}

TEST(Flash, NamesTheFailure) {
  const images::Probe probe{"stlink", "stm32f4x", ""};
  EXPECT_TRUE(images::failure_in("Error: open failed\n", probe).no_probe);
  const images::FlashFailure no_chip = images::failure_in(
      "Info : Target voltage: 3.2\nError: init mode failed (unable to connect to the target)\n", probe);
  EXPECT_FALSE(no_chip.no_probe);
  EXPECT_THAT(no_chip.what, HasSubstr("the chip does not answer"));
  EXPECT_THAT(
      images::failure_in(
          "Error: checksum mismatch - attempting binary compare\ndiff 0 address 0x08000000. Was 0xff instead of 0x00\n",
          probe)
          .what,
      HasSubstr("does not contain"));
  EXPECT_THAT(images::failure_in("image verified\nError: checksum mismatch\n", probe).what,
              HasSubstr("stored records"));
  EXPECT_EQ(images::failure_in("Info : x\nError: something else\n", probe).what, "something else");
}

}  // namespace
}  // namespace bms
