#include "firmware/estimator_step.hpp"

#include "cell_constants.hpp"  // generated from the cell file

namespace bms {

Estimate<BoardScalar> estimator_step(SocEstimator<BoardScalar>& estimator, const Sample& sample) {
  return estimator.step(generated::cell<BoardScalar>, sample);
}

std::uint32_t cell_hash() { return generated::cell_hash; }

}  // namespace bms
