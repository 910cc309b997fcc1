// What bms simulate has computed, before it is JSON or a page.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "measurement/recording.hpp"

namespace bms::replay {

struct SimulationResult {
  std::string cell;        ///< name of the cell
  std::string input, out;  ///< files read and written
  std::string read_as;     ///< of the input
  std::size_t samples = 0;
  double duration_s = 0, initial_soc = 0, final_soc = 0, final_voltage_v = 0;
  double steps_per_second = 0;  ///< of processor time
  std::vector<measurement::Warning> warnings;
};

}  // namespace bms::replay
