// The engine of a cluster: two job scripts for Slurm. Slurm queues, starts again and watches; nothing of that is here.
//
//   units.sh   a job array; each task runs one part of the units, several processes at a time. A task that fails is
//              requeued, at most twice
//   merge.sh   starts when all tasks have ended. It runs what has no result, which is nothing unless a task failed
//              for good or was killed, and merges
//
// A task that was requeued may run next to an older copy of itself: both write the same results.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "fleet/depot.hpp"

namespace bms::fleet {

struct SlurmOptions {
  std::size_t units_per_task = 50;            ///< ten seconds of work or more
  std::size_t most_tasks = 1'000;             ///< usual MaxArraySize; more units then go to one task
  std::size_t at_once = 0;                    ///< tasks at the same time; 0: as many as Slurm allows
  std::size_t jobs = 1;                       ///< processes of a task
  std::string partition, time_limit, memory;  ///< as sbatch takes them; empty: the cluster's default
  std::vector<std::string> modules;           ///< loaded before the tool runs
  std::vector<std::string> sbatch;            ///< further options of sbatch, for both jobs
};

struct SlurmScripts {
  std::size_t tasks = 0;
  std::string units, merge;
};

/// program: absolute path of the tool on the nodes.
SlurmScripts slurm_scripts(const Depot& depot, const std::filesystem::path& program, std::size_t units,
                           const SlurmOptions& options);

struct SlurmJobs {
  std::string array, merge;  ///< job numbers
};

/// Writes the scripts to the depot's folder `slurm` and submits them. Throws BadInput with sbatch's message if it
/// refuses them.
SlurmJobs submit(const Depot& depot, const SlurmScripts& scripts);

}  // namespace bms::fleet
