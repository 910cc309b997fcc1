// What all cells share, in means over blocks of time: there, a reading that is some rows late does not matter.
#pragma once

#include <cstddef>
#include <limits>
#include <string>
#include <vector>

#include "diagnosis/pack/pack_recording.hpp"
#include "diagnosis/pack/track.hpp"

namespace bms::diagnosis::pack {

class Blocks {
 public:
  /// Rows with a current and with neighbours_v.
  Blocks(const Track& track, const PackRecording& pack);

  /// Mean over each block of a column by row.
  std::vector<double> means(const std::vector<double>& by_row) const;
  std::size_t count() const { return count_; }

  std::vector<double> time_s, voltage_v, current_a, warmer_k;
  std::vector<double> change_a;  ///< of the current from row to row

 private:
  static constexpr std::size_t none = std::numeric_limits<std::size_t>::max();
  std::vector<std::size_t> block_of_row_;
  std::size_t count_ = 0;
};

/// By row: charge that the current sensor has counted since the start, over the capacity.
std::vector<double> counted_charge(const Track& track, const PackRecording& pack);

/// By row: mean of the temperature sensors minus that of the first row; 0 if unknown.
std::vector<double> warmer_than_at_start(const PackRecording& pack);

/// Why the mean of the cells does not test the current sensor; empty if it does.
std::string reason_not_to_test(const Track& track, const PackRecording& pack);

}  // namespace bms::diagnosis::pack
