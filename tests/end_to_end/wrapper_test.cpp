// ./bms from the outside: its help and docs/commands.md list every command, help installs and builds nothing, and a
// command names the packages that it needs.
#include <regex>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "files/text_file.hpp"
#include "tests/end_to_end/run_tool.hpp"

namespace bms {
namespace {

using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::IsSubsetOf;
using ::testing::Not;
using Names = std::set<std::string>;

const std::string wrapper = BMS_SOURCE_DIR "/bms";

/// The first group of every match.
Names matches(const std::string& text, const std::string& pattern) {
  const std::regex line(pattern, std::regex::ECMAScript | std::regex::multiline);
  Names found;
  for (std::sregex_iterator it(text.begin(), text.end(), line), end; it != end; ++it) found.insert((*it)[1]);
  return found;
}

/// The commands that a help lists: two spaces, the name, spaces.
Names listed(const std::string& help) { return matches(help, "^  ([a-z]+) "); }

/// A copy of the wrapper in an otherwise empty folder. The programs that install and build leave a file when they run.
class Wrapper : public ::testing::Test {
 protected:
  Wrapper() {
    std::filesystem::copy_file(wrapper, checkout_ / "bms");
    std::filesystem::create_directory(programs_);
    for (const char* program : {"apt-get", "sudo", "cmake", "ninja", "dpkg-query"}) {
      write_program(program, "touch " + (checkout_ / "ran").string() + "\nexit 1");
    }
  }

  void write_program(const std::string& name, const std::string& script) const {
    const auto path = programs_ / name;
    files::write_file(path.string(), "#!/bin/sh\n" + script + "\n");
    std::filesystem::permissions(path, std::filesystem::perms::owner_all);
  }

  /// Runs the copy; standard output and error together.
  std::string run(const std::string& arguments, int expected_exit_code = 0) const {
    const auto out = folder_.path() / "out";
    const int status = std::system(("PATH=" + programs_.string() + ":$PATH " + (checkout_ / "bms").string() + " " +
                                    arguments + " >" + out.string() + " 2>&1")
                                       .c_str());
    EXPECT_EQ(WEXITSTATUS(status), expected_exit_code) << arguments;
    return content(out);
  }
  bool touched_nothing() const {
    return !std::filesystem::exists(checkout_ / "ran") && !std::filesystem::exists(checkout_ / "build");
  }

  files::TemporaryFolder folder_;
  std::filesystem::path checkout_ = folder_.path(), programs_ = folder_.path() / "programs";
};

TEST_F(Wrapper, HelpListsEveryCommandOfTheTool) {
  const Names tool = listed(run_tool("--help").out);
  EXPECT_THAT(tool, ::testing::Contains("replay"));
  EXPECT_THAT(tool, IsSubsetOf(listed(run("help"))));
}

TEST_F(Wrapper, HelpListsEveryCommandOfItsOwnAndNoOther) {
  Names known = listed(run_tool("--help").out);
  for (const std::string& name : matches(content(wrapper), "^  ([a-z]+)(?: [|][^)]*)?[)] ")) known.insert(name);
  EXPECT_THAT(known, ::testing::IsSupersetOf({"demo", "test", "lint", "help"}));
  EXPECT_EQ(listed(run("help")), known);
}

/// What the wrapper builds for a command is next to the whole tool.
TEST_F(Wrapper, TheProgramThatIsBuiltForACommandHasIt) {
  for (const std::string program : {"bms_replay", "bms_cells"}) {
    const Names of_wrapper = matches(content(wrapper), "^    ([a-z |]+)[)] echo " + program + " ");
    ASSERT_EQ(of_wrapper.size(), 1U) << program;
    const auto out = folder_.path() / "help";
    const auto path = std::filesystem::path(BMS_TOOL).parent_path() / program;
    ASSERT_EQ(std::system((path.string() + " --help >" + out.string()).c_str()), 0);
    const Names commands = listed(content(out));
    EXPECT_GE(commands.size(), 3U);
    EXPECT_EQ(matches(*of_wrapper.begin(), "([a-z]+)"), commands) << program;
  }
}

TEST_F(Wrapper, HelpInstallsAndBuildsNothing) {
  const std::string help = run("help");
  for (const char* arguments : {"", "--help", "-h"}) EXPECT_EQ(run(arguments), help) << arguments;
  EXPECT_TRUE(touched_nothing());
}

TEST_F(Wrapper, RefusesAnUnknownCommandWithoutInstallingAnything) {
  EXPECT_THAT(run("tset", 2), HasSubstr("no such command 'tset'"));
  EXPECT_TRUE(touched_nothing());
}

TEST_F(Wrapper, NamesWhatItInstallsForACommandOfTheTool) {
  EXPECT_THAT(run("experiment rest_5s", 3), HasSubstr("libcli11-dev (the command line)"));
  EXPECT_FALSE(touched_nothing()) << "these programs stand for those that install and build";
}

TEST_F(Wrapper, InstallsTheCrossCompilerAndTheEmulatorForEachCommandThatBuildsAnImage) {
  for (const char* arguments : {"hil", "hil --board stm32f405_forklift", "replay a.csv --target netduinoplus2",
                                "replay a.csv --target=microbit --scalar fixed", "flash --board stm32f405_cell"}) {
    const std::string said = run(arguments, 3);
    EXPECT_THAT(said, HasSubstr("gcc-arm-none-eabi (")) << arguments;
    EXPECT_THAT(said, HasSubstr("qemu-system-arm (")) << arguments;
  }
  EXPECT_THAT(run("flash", 3), HasSubstr("openocd ("));
  for (const char* arguments : {"replay microbit", "simulate --out netduinoplus2", "hil --help"}) {
    EXPECT_THAT(run(arguments, 3), Not(HasSubstr("gcc-arm-none-eabi"))) << arguments;
  }
}

TEST_F(Wrapper, KnowsEveryFuzzTarget) {
  const std::filesystem::path folder = BMS_SOURCE_DIR "/tests/fuzz", copied = checkout_ / "tests" / "fuzz";
  std::filesystem::create_directories(copied);
  std::filesystem::copy_file(folder / "CMakeLists.txt", copied / "CMakeLists.txt");
  Names sources;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    const std::string name = entry.path().stem().string();
    if (entry.path().extension() == ".cpp" && name.ends_with("_fuzz")) sources.insert(name);
  }
  EXPECT_THAT(sources, ::testing::Contains("storage_fuzz"));
  EXPECT_EQ(matches(run("fuzz", 2), "\\b([a-z_]+_fuzz)\\b"), sources);
  EXPECT_THAT(run("fuzz stroage_fuzz", 2), HasSubstr("no such fuzz target 'stroage_fuzz'"));
  EXPECT_TRUE(touched_nothing());
}

/// A suite whose output fills a pipe, with every package installed and every build successful.
TEST_F(Wrapper, TestEndsWithTheSummaryAndTheExitCodeOfALongSuite) {
  write_program("dpkg-query", "echo installed");
  write_program("cmake", "exit 0");
  std::filesystem::create_directories(checkout_ / "tests");
  files::write_file((checkout_ / "tests" / "long.txt").string(), "A.Day 100 slow\n");
  const std::string tests = "seq 5000 | sed 's,.*,&/5000 Test #&: Some.Test ... Passed &.00 sec,'\n";
  write_program("ctest", tests + "echo '100% tests passed, 0 tests failed out of 5000'");
  EXPECT_THAT(run("test"), EndsWith("5000.00 Some.Test\n4999.00 Some.Test\n4998.00 Some.Test\n4997.00 Some.Test\n"
                                    "4996.00 Some.Test\n4995.00 Some.Test\n4994.00 Some.Test\n4993.00 Some.Test\n"
                                    "4992.00 Some.Test\n4991.00 Some.Test\n4990.00 Some.Test\n4989.00 Some.Test\n"
                                    "100% tests passed, 0 tests failed out of 5000\n"));
  write_program("ctest", tests + "echo '99% tests passed, 1 tests failed out of 5000'\nexit 8");
  EXPECT_THAT(run("test", 8), EndsWith("\n99% tests passed, 1 tests failed out of 5000\n"));
}

TEST_F(Wrapper, CommandsPageHasARowForEveryCommandAndNoOther) {
  const Names rows = matches(content(BMS_SOURCE_DIR "/docs/commands.md"), "^[|] `(?:[.]/)?bms ([a-z]+)");
  EXPECT_EQ(rows, listed(run("help")));
}

}  // namespace
}  // namespace bms
