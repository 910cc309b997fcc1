// bms replay: a recording through the estimator, on the host or on an emulated board.
#pragma once

#include <optional>
#include <string>

#include "host_sim/replay.hpp"
#include "tool/output.hpp"

namespace bms::tool {

struct ReplayOptions {
  std::string recording;
  std::string cell = "table9";
  std::string board_cell;  ///< cell file of the board's image; empty: the same
  std::string target = "host";
  std::string scalar = "float";
  std::optional<double> initial_soc;
  double initial_soc_sigma = 0.02;
  bool verify = false;
  std::string trace;
  Output output;
};

/// 0: done; 1: the board computed something else.
int run(const ReplayOptions& options);

}  // namespace bms::tool
