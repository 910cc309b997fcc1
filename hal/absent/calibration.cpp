// Nothing to correct.
#include "hal/calibration.hpp"

namespace bms::hal {

void calibrate(const Calibration&) {}

}  // namespace bms::hal
