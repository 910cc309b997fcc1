// The estimator one sample at a time, for a cell that is chosen at run time. run_on_host() computes the same bits.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "files/cell_file.hpp"
#include "measurement/sample.hpp"
#include "replay/replay.hpp"

namespace bms::replay {

class Stepper {
 public:
  virtual ~Stepper() = default;

  /// Processes one sample.
  virtual EstimateRow step(const measurement::Sample& sample) = 0;
};

/// The estimator of a cell in float, as on a board with an FPU.
std::unique_ptr<Stepper> make_stepper(const files::CellFile& cell,
                                      const std::optional<measurement::StartingPoint>& start);

}  // namespace bms::replay
