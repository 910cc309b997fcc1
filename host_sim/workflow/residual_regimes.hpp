// The residual of several blocks, sorted by state of charge, current, temperature, time since a step of the current and
// time since the start.
#pragma once

#include <map>
#include <utility>
#include <vector>

#include "diagnosis/prepared_recording.hpp"
#include "healthy_data/healthy_data.hpp"

namespace bms::workflow {

class ResidualRegimes {
 public:
  /// recording: the one that the record is a block of. simulated_v, expected_v: the voltage, and the standard deviation
  /// of its error by the cell file alone, by row of the record.
  void add_block(std::size_t recording, const diagnosis::PreparedRecording& record,
                 const std::vector<double>& simulated_v, const std::vector<double>& expected_v, double capacity_ah);

  /// Ranges that any block has visited.
  /// Of all blocks, or of those that are kept: as long as there are blocks.
  std::vector<healthy_data::HealthyRegime> regimes(const std::vector<char>& kept = {}) const;
  /// HealthyData::beyond_tolerance_v of the blocks that are kept.
  double beyond_tolerance_v(const std::vector<char>& kept) const;

 private:
  struct Sum {
    double count = 0, sum_v = 0, squares = 0, hours = 0;
  };
  struct Block {
    std::size_t recording = 0;
    std::map<std::pair<std::size_t, std::size_t>, Sum> sums;  ///< by axis and range
    double rows = 0, squares = 0, expected = 0;               ///< squares: of the error; expected: by the cell file
  };

  /// The recording of a block; of a single recording, the block.
  std::size_t part_of(std::size_t block) const;

  std::vector<Block> blocks_;
};

}  // namespace bms::workflow
