// No contactors.
#include "hal/power_path.hpp"

#include "measurement/sample.hpp"

namespace bms::hal {

void power_path_set(const PowerPath&) {}
std::int32_t dc_link_uv() { return measurement::no_reading; }

}  // namespace bms::hal
