// The engine slurm: its scripts, and a run on a cluster of one node with a task that is killed.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/end_to_end/run_tool.hpp"

namespace bms {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

class SlurmEngine : public ::testing::Test {
 protected:
  std::string path(const std::string& name) const { return (folder_.path() / name).string(); }

  void write_depot(int count, int rows) const {
    std::filesystem::create_directories(path("logs"));
    std::ofstream manifest(path("depot.csv"));
    manifest << "recording,cell,truck,cell_index\n";
    for (int n = 0; n < count; ++n) {
      const std::string name = "logs/r" + std::to_string(n) + ".csv";
      manifest << name << ",table9," << n / 4 << "," << n % 4 + 1 << "\n";
      std::ofstream out(path(name));
      out << "time_s,current_a," << (n % 50 == 7 ? "volts" : "voltage_v") << "\n";
      for (int k = 0; k < rows; ++k) out << k << "," << -1 - (k / 9 + n) % 3 << "," << 3.3 - 0.01 * (k % 5) << "\n";
    }
  }
  std::string command(const std::string& out) const {
    return "fleet run --manifest " + path("depot.csv") + " --task replay --pages none --out " + path(out) + " ";
  }

  files::TemporaryFolder folder_;
};

TEST_F(SlurmEngine, PrintsItsScriptsWithoutSlurm) {
  write_depot(45, 20);
  const ToolRun run =
      run_tool(command("out") +
               "--engine slurm --dry-run --units-per-task 10 --at-once 3 --partition night --time 01:00 "
               "--memory 2G --module gcc/12 --module 'a b' --sbatch=--account=bms -- --initial-soc 0.5");
  ASSERT_EQ(run.exit_code, 0) << run.err;
  for (const char* expected :
       {"#SBATCH --array=0-4%3\n", "#SBATCH --requeue\n", "#SBATCH --partition=night\n", "#SBATCH --time=01:00\n",
        "#SBATCH --mem=2G\n", "#SBATCH --account=bms\n", "module load gcc/12\n", "module load 'a b'\n",
        " --part \"$SLURM_ARRAY_TASK_ID/5\" -- --initial-soc 0.5 || {", "scontrol requeue"})
    EXPECT_THAT(run.out, HasSubstr(expected));
  std::ofstream(path("script.sh")) << run.out;
  EXPECT_EQ(std::system(("bash -n " + path("script.sh")).c_str()), 0);
  const ToolRun limited = run_tool(command("out2") + "--engine slurm --dry-run --units-per-task 1 --most-tasks 8");
  EXPECT_THAT(limited.out, HasSubstr("#SBATCH --array=0-7\n"));
}

TEST_F(SlurmEngine, SaysInOneLineThatSlurmIsMissing) {
  write_depot(1, 20);
  std::filesystem::create_directories(path("empty"));
  const files::TemporaryFolder streams;
  const std::string err = (streams.path() / "err").string();
  const int status =
      std::system(("PATH=" + path("empty") + " " BMS_TOOL " " + command("out") + "--engine slurm 2>" + err).c_str());
  EXPECT_EQ(WEXITSTATUS(status), 2);
  EXPECT_THAT(content(err), ::testing::MatchesRegex("sbatch:1: failed [^\n]*expected[^\n]*\n"));
}

TEST_F(SlurmEngine, AKilledTaskIsRunAgainAndTheTableIsThatOfTheLocalEngine) {
  for (const char* program : {"munged", "slurmctld", "slurmd", "sbatch"}) {
    const bool here = images::in_path(program) || std::filesystem::exists(std::string("/usr/sbin/") + program);
    if (!here) GTEST_SKIP() << "no " << program;
  }
  // munged wants a socket that everybody can reach
  std::filesystem::permissions(folder_.path(), std::filesystem::perms(0755));
  write_depot(200, 2'000);
  ASSERT_EQ(run_tool(command("local")).exit_code, 0);
  const std::string log = path("log"), scripts = BMS_SOURCE_DIR "/tests/host_sim/fleet/";
  const int status = std::system(("cd " + folder_.path().string() + " && " + scripts + "with_slurm.sh " + path("s") +
                                  " " + scripts + "kill_a_task.sh " BMS_TOOL " " + path("slurm") + " " +
                                  command("slurm") + "--engine slurm --units-per-task 25 >" + log + " 2>&1")
                                     .c_str());
  ASSERT_EQ(status, 0) << content(log);
  EXPECT_THAT(content(log), HasSubstr("COMPLETED"));
  EXPECT_EQ(content(path("slurm/fleet.csv")), content(path("local/fleet.csv")));
  EXPECT_TRUE(content(path("slurm/fleet.sqlite")) == content(path("local/fleet.sqlite")));
  EXPECT_THAT(content(log), HasSubstr("Restarts=1"));
}

}  // namespace
}  // namespace bms
