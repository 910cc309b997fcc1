#include "firmware/board_tables.hpp"

namespace bms::firmware {

[[gnu::flatten]] BoardEstimator::Result step_of_update(BoardEstimator& estimator, const measurement::Sample& sample) {
  return estimator.step(*tables_of_update, sample);
}

}  // namespace bms::firmware
