#include "firmware/board_cell.hpp"
#include "firmware/board_tables.hpp"

/// Identifies the cell file of an image without running it. On CAN the message Identity has the same value.
extern "C" {
extern const std::uint32_t image_cell_hash;
constexpr std::uint32_t image_cell_hash = bms::generated::cell_hash;
}

namespace bms::firmware {

// flatten: with everything inline the cell is a constant, which saves one instruction in seven
[[gnu::flatten]] BoardEstimator::Result estimator_step(BoardEstimator& estimator, const measurement::Sample& sample) {
  if constexpr (BMS_IN_SLOT) {
    return tables_of_update != nullptr ? step_of_update(estimator, sample) : estimator.step(tables_of_build, sample);
  } else {
    return estimator.step(generated::cell<BoardScalar>, sample);
  }
}

float capacity_ah() { return static_cast<float>(generated::parameters.capacity_ah); }

messages::Identity identity() {
  if constexpr (BMS_IN_SLOT)
    return {.cell_hash = acting_cell_hash, .version = BMS_VERSION};
  else
    return {.cell_hash = image_cell_hash, .version = BMS_VERSION};
}

}  // namespace bms::firmware
