// The package from the outside: a project that uses the estimator by find_package(), add_subdirectory() and
// FetchContent, on this machine and for two cores without an operating system; and `bms cell header`.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <nlohmann/json.hpp>

#include "files/text_file.hpp"
#include "tests/end_to_end/run_tool.hpp"

namespace bms {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class Package : public ::testing::Test {
 protected:
  Package() {
    std::filesystem::copy(BMS_SOURCE_DIR "/tests/package/consumer", consumer_,
                          std::filesystem::copy_options::recursive);
    std::filesystem::copy_file(BMS_SOURCE_DIR "/model/cells/table9.toml", consumer_ / "my_cell.toml");
  }

  /// Runs a command of a shell; its output if it fails.
  void run(const std::string& command) const {
    const auto out = folder_.path() / "out";
    ASSERT_EQ(std::system(("( " + command + " ) >" + out.string() + " 2>&1").c_str()), 0) << command << "\n"
                                                                                          << content(out);
  }
  void configure_and_build(const std::string& options) const {
    run("cmake -G Ninja -S " + consumer_.string() + " -B " + build_.string() +
        " -DGREYBOX_BMS=" BMS_TOOL " -DGREYBOX_SOURCE=" BMS_SOURCE_DIR " -DEXAMPLES=" BMS_SOURCE_DIR
        "/library/examples " +
        options + " && cmake --build " + build_.string());
  }
  std::string output_of(const std::string& program) const {
    run((build_ / program).string());
    return content(folder_.path() / "out");
  }
  void expect_examples_agree() const {
    const std::string c = output_of("in_c");
    EXPECT_EQ(std::count(c.begin(), c.end(), '\n'), 4) << c;
    EXPECT_THAT(c, HasSubstr("60 s: 0.7998 +- 0.0664"));
    EXPECT_EQ(output_of("in_cpp"), c);
  }
  /// The command that compiles a source of the consumer.
  std::string command_of(const std::string& source) const {
    for (const auto& entry : nlohmann::json::parse(content(build_ / "compile_commands.json"))) {
      if (entry["file"].get<std::string>().ends_with(source)) return entry["command"];
    }
    return "";
  }
  void expect_no_flag_elsewhere() const {
    EXPECT_THAT(command_of("/both.cpp"), AllOf(HasSubstr("-ffp-contract=off"), HasSubstr("-std=")));
    EXPECT_THAT(command_of("/plain.cpp"),
                AllOf(HasSubstr("-c "), Not(HasSubstr("-ffp-contract")), Not(HasSubstr("-W")), Not(HasSubstr("-O")),
                      Not(HasSubstr("-std=")), Not(HasSubstr("ccache")), Not(HasSubstr(BMS_SOURCE_DIR))));
  }

  files::TemporaryFolder folder_;
  std::filesystem::path consumer_ = folder_.path() / "consumer", build_ = folder_.path() / "build";
};

TEST_F(Package, IsFoundAfterAnInstallation) {
  const std::string prefix = (folder_.path() / "installed").string();
  run("cmake --install " BMS_BUILD_DIR " --component library --prefix " + prefix);
  configure_and_build("-DGREYBOX_BY=find -DCMAKE_PREFIX_PATH=" + prefix);
  expect_examples_agree();
  expect_no_flag_elsewhere();
  for (const auto& file : std::filesystem::recursive_directory_iterator(prefix)) {
    if (!file.is_regular_file()) continue;
    EXPECT_THAT(content(file), Not(HasSubstr(BMS_SOURCE_DIR))) << file.path();
  }
}

TEST_F(Package, AnotherVersionIsRefused) {
  const std::string prefix = (folder_.path() / "installed").string();
  run("cmake --install " BMS_BUILD_DIR " --component library --prefix " + prefix);
  run("sed -i 's/greybox 0.2/greybox 0.3/' " + (consumer_ / "CMakeLists.txt").string());
  run("! cmake -G Ninja -S " + consumer_.string() + " -B " + build_.string() +
      " -DGREYBOX_BY=find -DCMAKE_PREFIX_PATH=" + prefix);
  EXPECT_THAT(content(folder_.path() / "out"), HasSubstr("compatible with requested version"));
}

TEST_F(Package, IsASubdirectory) {
  configure_and_build("-DGREYBOX_BY=subdirectory");
  expect_examples_agree();
  expect_no_flag_elsewhere();
}

TEST_F(Package, IsFetched) {
  configure_and_build("-DGREYBOX_BY=fetch");
  expect_examples_agree();
  expect_no_flag_elsewhere();
}

/// The toolchain file of this project, with the flags of a core.
std::string core(const std::string& flags) {
  return " --toolchain " BMS_SOURCE_DIR
         "/cmake/toolchain-arm-none-eabi.cmake -DCMAKE_BUILD_TYPE=MinSizeRel "
         "-DCMAKE_C_FLAGS='" +
         flags + "' -DCMAKE_CXX_FLAGS='" + flags + " -fno-exceptions -fno-rtti'";
}

TEST_F(Package, CompilesForACortexM4F) {
  configure_and_build("-DGREYBOX_BY=subdirectory" + core("-mcpu=cortex-m4 -mthumb -mfloat-abi=hard -mfpu=fpv4-sp-d16"));
  EXPECT_TRUE(std::filesystem::exists(build_ / "libmy_estimator.a"));
}

TEST_F(Package, CompilesForACortexM0WithoutDoubles) {
  configure_and_build("-DGREYBOX_BY=subdirectory -DBMS_FIXED=FIXED" + core("-mcpu=cortex-m0 -mthumb"));
  run("arm-none-eabi-nm -C " + (build_ / "libmy_estimator.a").string());
  EXPECT_THAT(content(folder_.path() / "out"), AllOf(HasSubstr("T greybox_step"), Not(HasSubstr("__aeabi_d"))));
}

TEST_F(Package, TheHeaderOfACellFollowsItsFile) {
  configure_and_build("-DGREYBOX_BY=subdirectory");
  run("sed -i 's/^capacity_ah = .*/capacity_ah = 7.5/' " + (consumer_ / "my_cell.toml").string());
  run("cmake --build " + build_.string());
  EXPECT_THAT(content(build_ / "my_cell.hpp"), HasSubstr(".capacity_ah = 7.5"));
}

TEST_F(Package, AMissingToolIsNamed) {
  run("! cmake -G Ninja -S " + consumer_.string() + " -B " + build_.string() +
      " -DGREYBOX_BY=subdirectory -DGREYBOX_SOURCE=" BMS_SOURCE_DIR " -DGREYBOX_BMS=");
  EXPECT_THAT(content(folder_.path() / "out"), HasSubstr("the tool bms is missing"));
}

TEST_F(Package, SingleHeaderHasTheSameEstimates) {
  configure_and_build("-DGREYBOX_BY=subdirectory");
  const std::string f = folder_.path().string();
  std::filesystem::create_directories(folder_.path() / "single/greybox");
  run("/usr/bin/python3 " BMS_SOURCE_DIR "/library/amalgamate.py " + f + "/single/greybox_single.hpp");
  run("echo '#include \"greybox_single.hpp\"' >" + f + "/single/greybox/estimator.hpp");
  run(BMS_TOOL " cell header " + f + "/consumer/my_cell.toml --include '\"greybox_single.hpp\"' -o " + f +
      "/single/my_cell.hpp");
  run("g++ -std=c++20 -O1 -ffp-contract=off -Wall -Wextra -Werror -I " + f +
      "/single " BMS_SOURCE_DIR "/library/examples/estimator.cpp -o " + f + "/build/single");
  EXPECT_EQ(output_of("single"), output_of("in_cpp"));
  const std::string single = content(f + "/single/greybox_single.hpp");
  EXPECT_NE(single.find("MIT"), std::string::npos);
  EXPECT_EQ(single.find("\n#include \""), std::string::npos);
  EXPECT_EQ(single.find(BMS_SOURCE_DIR), std::string::npos);
}

TEST_F(Package, SingleHeaderCompilesForACortexM0) {
  const std::string f = folder_.path().string();
  run("/usr/bin/python3 " BMS_SOURCE_DIR "/library/amalgamate.py " + f + "/greybox_single.hpp");
  run(BMS_TOOL " cell header table9 --fixed --include '\"greybox_single.hpp\"' -o " + f + "/my_cell.hpp");
  files::write_file(f + "/m0.cpp",
                    "#include \"my_cell.hpp\"\n"
                    "greybox::Estimator<greybox::FixedPoint, bms::generated::Model> e;\n"
                    "bool step(const greybox::Sample& s) {\n"
                    "  return e.step(bms::generated::cell<greybox::FixedPoint>, s).flags == 0;\n}\n");
  run("arm-none-eabi-g++ -mcpu=cortex-m0 -mthumb -std=c++20 -Os -fno-exceptions -fno-rtti -c " + f + "/m0.cpp -o " + f +
      "/m0.o && arm-none-eabi-nm " + f + "/m0.o");
  EXPECT_THAT(content(folder_.path() / "out"), Not(HasSubstr("__aeabi_d")));
}

TEST_F(Package, FootprintIsThatOfTheReadme) {
  run("/usr/bin/python3 " BMS_SOURCE_DIR "/library/footprint.py " BMS_TOOL " " BMS_BUILD_DIR
      "/library/include --check");
}

TEST(CellHeader, IsThatOfTheBuildExceptForItsIncludeAndPulseRatings) {
  const files::TemporaryFolder folder;
  const std::string a = (folder.path() / "a.hpp").string(), b = (folder.path() / "b.hpp").string();
  ASSERT_EQ(run_tool("cell header a123_26650_extended -o " + a + " --include '\"x/single.hpp\"'").exit_code, 0);
  ASSERT_EQ(std::system((BMS_CELL_HEADER_TOOL " a123_26650_extended " + b).c_str()), 0);
  const std::string by_tool = content(a);
  std::string by_build = content(b);
  EXPECT_THAT(by_tool, HasSubstr("#include \"x/single.hpp\"\n"));
  // the library has no protection
  const std::size_t pulses = by_build.find("inline constexpr model::PulseRatings");
  ASSERT_NE(pulses, std::string::npos);
  by_build.erase(pulses, by_build.find("template <class S>", pulses) - pulses);
  EXPECT_EQ(by_tool.substr(by_tool.find("namespace")), by_build.substr(by_build.find("namespace")));
}

TEST(CellHeader, BadUsageIsOneLineAndExitCode2) {
  const files::TemporaryFolder folder;
  const std::string out = " -o " + (folder.path() / "x.hpp").string();
  for (const std::string& arguments :
       {std::string("cell header table9"), "cell header no_such" + out, "cell header table9 --include x.hpp" + out,
        "cell header table9 --include '<x>\n<y>'" + out, std::string("cell header table9 -o /no/such/folder/x.hpp")}) {
    const ToolRun run = run_tool(arguments);
    EXPECT_EQ(run.exit_code, 2) << arguments;
    EXPECT_EQ(std::count(run.err.begin(), run.err.end(), '\n'), 1) << run.err;
  }
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "x.hpp"));
}

}  // namespace
}  // namespace bms
