// Estimates are kept nowhere.
#include "hal/record.hpp"

namespace bms::hal {

void record(const EstimateWords&) {}

}  // namespace bms::hal
