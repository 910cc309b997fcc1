// Progress of long work on the host.
#pragma once

#include <functional>
#include <string>

namespace bms::workflow {

/// Called as the work goes on. done: 0..1; what: the part that is being worked on.
using Progress = std::function<void(double done, const std::string& what)>;

inline void report(const Progress& progress, double done, const std::string& what) {
  if (progress) progress(done, what);
}

}  // namespace bms::workflow
