// bms monitor: what the BMS says on CAN, shown, logged and served as a page (monitor/).
#pragma once

#include <optional>
#include <string>

#include "tool/output.hpp"

namespace bms::tool {

struct MonitorOptions {
  std::string source;  ///< monitor/frame_source.hpp
  bool once = false;
  std::optional<double> duration_s;  ///< of this machine's clock; of a log that is not served, of its own
  std::string csv, record;
  std::optional<int> serve_port;  ///< 0: any that is free
  Output output;
};

/// 0: done; 1: --once, and no complete picture came; or the source went away.
int run(const MonitorOptions& options);

}  // namespace bms::tool
