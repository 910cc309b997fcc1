// Even sampling for models that need it (discrete_model.hpp), from a recording whose steps vary.
#pragma once

#include "identification/data.hpp"

namespace bms::identification {

struct EvenData {
  Data data;
  double step_s = 0;
  bool resampled = false;       ///< false: the data were even already and are unchanged
  std::size_t gap_samples = 0;  ///< samples without a voltage, because the recording has a gap there
};

/// The step is the median step of the data. The current of a new sample is the mean over its interval, so that no
/// charge is lost; its voltage lies on the straight line between the two samples around it, or is missing (NaN) where
/// these are more than five steps apart. Throws std::invalid_argument: fewer than two samples, time that does not rise,
/// or a step so short that the even data would have more than ten million samples.
EvenData evenly_sampled(const Data& data);

}  // namespace bms::identification
