// A second RC pair that a fit has reduced to nothing.
#pragma once

#include "identification/joint_fit.hpp"

namespace bms::identification {

/// True if the second pair of the circuit ended at the lower bound of its resistance.
inline bool pair_vanished(const JointModel& model, const JointFit& fit) {
  for (std::size_t k = 0; k < model.unknowns.size(); ++k) {
    if (model.unknowns[k].name() == "slow_polarisation.resistance_ohm")
      return fit.at_bound[static_cast<Eigen::Index>(k)] < 0;
  }
  return false;
}

}  // namespace bms::identification
