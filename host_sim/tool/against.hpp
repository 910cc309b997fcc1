// bms replay --against: two firmwares on one log.
#pragma once

#include <string>

#include "files/read_options.hpp"
#include "tool/output.hpp"

namespace bms::tool {

struct AgainstOptions {
  std::string recording;
  std::string firmware;  ///< the new one: an image for the loop, a checkout, or a commit
  std::string base;      ///< the present one, likewise; empty: these sources
  std::string board = "stm32f405_forklift";
  std::string cell;      ///< of both firmwares, unless the new one has another
  std::string new_cell;  ///< of the new one; empty: the same
  double sample_period_s = 0.1;
  files::ReadOptions reading;
  Output output;
};

/// Returns the exit code: 0 if both firmwares publish the same over the whole log, else 1.
int run_against(const AgainstOptions& options);

using RunAgainst = int (*)(const AgainstOptions&);

}  // namespace bms::tool
