// What is installed with the tool: it runs there, finds its data there, and has man pages and completions.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <regex>

#include "tests/end_to_end/run_tool.hpp"

namespace bms {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

/// An installation of the tool into a folder of its own.
class Installed : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new files::TemporaryFolder;
    EXPECT_EQ(run("cmake --install " BMS_BUILD_DIR " --component tool --prefix " + path("")), 0) << output();
  }
  static void TearDownTestSuite() {
    delete folder_;
    folder_ = nullptr;
  }

  static std::string path(const std::string& file) { return (folder_->path() / "usr" / file).string(); }
  /// Exit code of a command of a shell.
  static int run(const std::string& command) {
    const int status = std::system(("( " + command + " ) >" + (folder_->path() / "out").string() + " 2>&1").c_str());
    return WEXITSTATUS(status);
  }
  static std::string output() { return content(folder_->path() / "out"); }
  static std::vector<std::string> commands() {
    const std::string help = run_tool("--help").out;
    const std::regex line("\n  ([a-z]+) +[A-Z]");
    std::vector<std::string> names;
    const std::string list = help.substr(help.find("Subcommands:"));
    for (std::sregex_iterator it(list.begin(), list.end(), line), end; it != end; ++it) names.push_back((*it)[1]);
    return names;
  }

  static inline files::TemporaryFolder* folder_ = nullptr;
};

TEST_F(Installed, ToolIsStrippedAndReplays) {
  EXPECT_LT(std::filesystem::file_size(path("bin/bms")), 20'000'000U);
  EXPECT_EQ(run("cd / && " + path("bin/bms") + " replay " + path("share/greybox/recordings/forklift_shift.csv") +
                " --cell " + path("share/greybox/cells/table9.toml")),
            0);
  EXPECT_THAT(output(), HasSubstr("steps/s"));
}

TEST_F(Installed, ToolBuildsFirmwareFromWhatIsInstalled) {
  const std::string cache = (folder_->path() / "cache").string();
  EXPECT_EQ(run("cd / && env -u BMS_ROOT XDG_CACHE_HOME=" + cache + " " + path("bin/bms") + " replay " +
                path("share/greybox/recordings/forklift_shift.csv") + " --target netduinoplus2 --verify"),
            0)
      << output();
  EXPECT_THAT(output(), HasSubstr("every bit equal on netduinoplus2"));
  const std::string built = content(cache + "/greybox-bms/netduinoplus2/build.ninja");
  EXPECT_THAT(built,
              AllOf(HasSubstr(path("share/greybox/source/firmware")), Not(HasSubstr(BMS_SOURCE_DIR "/firmware"))));
  EXPECT_FALSE(std::filesystem::exists(path("share/greybox/source/build")));
}

TEST_F(Installed, WithoutAFolderForImagesTheToolSaysSo) {
  EXPECT_EQ(run("cd / && env -u HOME -u XDG_CACHE_HOME -u BMS_ROOT " + path("bin/bms") + " replay " +
                path("share/greybox/recordings/forklift_shift.csv") + " --target netduinoplus2"),
            2);
  EXPECT_THAT(output(), HasSubstr("expected HOME or XDG_CACHE_HOME"));
}

TEST_F(Installed, EveryCommandHasAManPageWithoutWarnings) {
  EXPECT_THAT(commands(), AllOf(::testing::Contains("replay"), ::testing::SizeIs(::testing::Ge(14))));
  for (const std::string& command : commands()) {
    const std::string page = path("share/man/man1/bms-" + command + ".1");
    EXPECT_EQ(run("man --warnings -E UTF-8 -l " + page + " 2>&1 >/dev/null"), 0) << command;
    EXPECT_EQ(output(), "") << command;
    EXPECT_THAT(content(path("share/man/man1/bms.1")), HasSubstr(".BR bms\\-" + command + " (1)"));
    EXPECT_THAT(content(page), AllOf(HasSubstr(".SH SYNOPSIS\nbms " + command), HasSubstr(".B \\-h, \\-\\-help\n")));
  }
}

/// The words that bash offers for a command line whose last word is incomplete.
std::string completed(const std::string& script, const std::string& words, int last) {
  return "bash -c '. " + script + "; COMP_WORDS=(" + words + ") COMP_CWORD=" + std::to_string(last) +
         "; _bms; echo \"${COMPREPLY[*]}\"'";
}

TEST_F(Installed, BashCompletesCommandsOptionsValuesAndFiles) {
  const std::string script = path("share/bash-completion/completions/bms");
  ASSERT_EQ(run(completed(script, "bms repl", 1)), 0);
  EXPECT_EQ(output(), "replay\n");
  ASSERT_EQ(run(completed(script, "bms replay --scalar \"\"", 3)), 0);
  EXPECT_EQ(output(), "float fixed double\n");
  ASSERT_EQ(run(completed(script, "bms replay --initial-soc", 2)), 0);
  EXPECT_EQ(output(), "--initial-soc --initial-soc-sigma\n");
  ASSERT_EQ(run(completed(script, "bms cell h", 2)), 0);
  EXPECT_THAT(output(), HasSubstr("header"));
  ASSERT_EQ(run("cd " + path("share/greybox/recordings") + " && " + completed(script, "bms replay fork", 2)), 0);
  EXPECT_EQ(output(), "forklift_shift.csv\n");
  ASSERT_EQ(run("cd / && " + completed(script, "bms replay --cell tab", 3)), 0);
  EXPECT_EQ(output(), "table9\n");
}

TEST_F(Installed, EveryOptionIsInEachCompletion) {
  const std::string zsh = content(path("share/zsh/vendor-completions/_bms")),
                    fish = content(path("share/fish/vendor_completions.d/bms.fish"));
  for (const std::string& command : commands()) {
    const std::string help = run_tool(command + " --help").out;
    const std::regex option("\n  (?:-[a-z],)?--([a-z-]+)");
    for (std::sregex_iterator it(help.begin(), help.end(), option), end; it != end; ++it) {
      const std::string name = (*it)[1];
      EXPECT_THAT(zsh, HasSubstr("'*--" + name + "[")) << command;
      EXPECT_THAT(fish, HasSubstr("__fish_seen_subcommand_from " + command + "' ")) << command;
      EXPECT_THAT(fish, HasSubstr("-l " + name + " ")) << command;
    }
  }
  for (const std::string shell : {"zsh", "fish"}) {
    if (run("command -v " + shell) != 0) continue;
    const std::string file =
        shell == "zsh" ? "share/zsh/vendor-completions/_bms" : "share/fish/vendor_completions.d/bms.fish";
    EXPECT_EQ(run(shell + " -n " + path(file)), 0) << output();
  }
}

}  // namespace
}  // namespace bms
