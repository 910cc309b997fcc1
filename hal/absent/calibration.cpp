// Nothing to correct.
#include "hal/calibration.hpp"

namespace bms::hal {

void calibrate(const SensorCalibration&) {}

}  // namespace bms::hal
