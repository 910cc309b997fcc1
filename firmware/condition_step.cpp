// Apart from the step: this is not in the hot path, and small rather than fast.
#include "firmware/estimator_step.hpp"

namespace bms {

void condition_step(Condition<BoardEstimator>& condition, const BoardEstimator& estimator, const Sample& sample, const BoardEstimator::Result& estimate, bool limits_wanted) {
  condition.update(generated::cell<BoardScalar>, sample, estimate, estimator.state(), limits_wanted);
}

}  // namespace bms
