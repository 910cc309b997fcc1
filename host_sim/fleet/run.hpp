// The engine of one machine: runs the units of a depot, several at a time, each in a process of its own.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>

#include "fleet/depot.hpp"

namespace bms::fleet {

struct RunOptions {
  std::filesystem::path program;          ///< the tool itself
  std::size_t jobs = 1;                   ///< processes at a time
  std::size_t processors = 1;             ///< of each process
  std::size_t part = 0, parts = 1;        ///< every `parts`-th unit, from `part`
  std::function<bool()> stopped;          ///< asked between units; running ones are then killed
  std::function<void(std::size_t)> done;  ///< called after each unit with the number of units that are done
};

struct RunCounts {
  std::size_t units = 0;       ///< of this part
  std::size_t skipped = 0;     ///< finished before
  std::size_t ran = 0;         ///< finished now, those with an error included
  std::size_t errors = 0;      ///< of `ran`: the tool refused the recording or the cell file
  std::size_t unfinished = 0;  ///< killed from outside: run again
};

/// Runs what is not finished. Memory does not depend on the number of units. Throws BadInput if a result cannot be
/// written.
RunCounts run_units(const Depot& depot, const RunOptions& options);

}  // namespace bms::fleet
