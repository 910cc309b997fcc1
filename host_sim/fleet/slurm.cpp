#include "fleet/slurm.hpp"

#include <sys/wait.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "files/text_file.hpp"
#include "fleet/process.hpp"

namespace bms::fleet {

namespace {

namespace fs = std::filesystem;
using files::BadInput;

constexpr const char* requeue = R"( || {
  # at most twice; a requeued task starts again with the same part
  if [ "${SLURM_RESTART_COUNT:-0}" -lt 2 ]; then
    scontrol requeue "${SLURM_ARRAY_JOB_ID}_${SLURM_ARRAY_TASK_ID}" && sleep 60
  fi
  exit 1
}
)";

/// #SBATCH lines that both jobs have.
std::string head(const std::string& name, const fs::path& log, const SlurmOptions& o) {
  std::string text = "#!/bin/bash\n";
  const auto line = [&](const std::string& option) { text += "#SBATCH " + option + "\n"; };
  line("--job-name=" + name);
  line("--output=" + log.string());
  line(fmt::format("--cpus-per-task={}", o.jobs));
  if (!o.partition.empty()) line("--partition=" + o.partition);
  if (!o.time_limit.empty()) line("--time=" + o.time_limit);
  if (!o.memory.empty()) line("--mem=" + o.memory);
  for (const std::string& option : o.sbatch) line(option);
  return text;
}

std::string modules(const SlurmOptions& o) {
  std::string text;
  for (const std::string& module : o.modules) text += "module load " + shell_word(module) + "\n";
  return text;
}

/// Standard output of a program of Slurm. Throws BadInput with its message if it fails.
std::string output_of(const std::string& name, const std::vector<std::string>& arguments) {
  std::vector<std::string> argv = {"/usr/bin/env", name};
  argv.insert(argv.end(), arguments.begin(), arguments.end());
  Process process(argv);
  int status = 0;
  while (waitpid(process.pid(), &status, 0) < 0 && errno == EINTR) continue;
  process.ended();
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) {
    std::string message = process.standard_error();
    message.erase(std::min(message.find('\n'), message.size()));
    throw BadInput(name, 1, "failed (" + message + "), expected a computer from which Slurm takes jobs");
  }
  std::string text = process.standard_output();
  text.erase(std::min(text.find_first_of(";\n"), text.size()));
  return text;
}

}  // namespace

SlurmScripts slurm_scripts(const Depot& depot, const fs::path& program, std::size_t units, const SlurmOptions& o) {
  const fs::path folder = depot.folder / "slurm";
  SlurmScripts scripts;
  scripts.tasks = std::clamp<std::size_t>((units + o.units_per_task - 1) / o.units_per_task, 1, o.most_tasks);
  std::string run = fmt::format("{} fleet run --manifest {} --task {} --out {} --pages {} --jobs {} --quiet",
                                shell_word(program.string()), shell_word(depot.manifest().string()),
                                name_of(depot.task), shell_word(depot.folder.string()), name_of(depot.pages), o.jobs);
  std::string arguments;
  if (!depot.arguments.empty()) arguments += " --";
  for (const std::string& a : depot.arguments) arguments += " " + shell_word(a);
  const std::string at_once = o.at_once > 0 ? fmt::format("%{}", o.at_once) : "";
  scripts.units = head("bms-fleet", folder / "units_%a.log", o) +
                  fmt::format("#SBATCH --array=0-{}{}\n#SBATCH --requeue\n", scripts.tasks - 1, at_once) + modules(o) +
                  run + fmt::format(" --part \"$SLURM_ARRAY_TASK_ID/{}\"", scripts.tasks) + arguments + requeue;
  scripts.merge =
      head("bms-fleet-merge", folder / "merge.log", o) + "#SBATCH --requeue\n" + modules(o) + run + arguments + "\n";
  return scripts;
}

SlurmJobs submit(const Depot& depot, const SlurmScripts& scripts) {
  const fs::path folder = depot.folder / "slurm";
  fs::create_directories(folder);
  files::write_file(folder / "units.sh", scripts.units);
  files::write_file(folder / "merge.sh", scripts.merge);
  SlurmJobs jobs;
  jobs.array = output_of("sbatch", {"--parsable", (folder / "units.sh").string()});
  // afterany: also after a task that failed for good, whose units are then run by the merge
  jobs.merge =
      output_of("sbatch", {"--parsable", "--dependency=afterany:" + jobs.array, (folder / "merge.sh").string()});
  return jobs;
}

}  // namespace bms::fleet
