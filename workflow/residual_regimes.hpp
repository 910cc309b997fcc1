// The residual of several blocks, sorted by state of charge, current, temperature, time since a step of the current and
// time since the start.
#pragma once

#include <map>
#include <utility>
#include <vector>

#include "diagnosis/prepared_recording.hpp"
#include "measurement/healthy_data.hpp"

namespace bms::workflow {

class ResidualRegimes {
 public:
  /// simulated_v: by row of the record.
  void add_block(const diagnosis::PreparedRecording& record, const std::vector<double>& simulated_v,
                 double capacity_ah);

  /// Ranges that any block has visited.
  /// Of all blocks, or of those that are kept: as long as there are blocks.
  std::vector<measurement::HealthyRegime> regimes(const std::vector<char>& kept = {}) const;

 private:
  struct Sum {
    double count = 0, sum_v = 0, squares = 0, hours = 0;
  };
  std::vector<std::map<std::pair<std::size_t, std::size_t>, Sum>> blocks_;  ///< by axis and range
};

}  // namespace bms::workflow
