// No second current sensor.
#include "hal/second_current.hpp"

#include "measurement/sample.hpp"

namespace bms::hal {

bool second_current_fitted() { return false; }
std::int32_t second_current_ua() { return measurement::no_reading; }

}  // namespace bms::hal
