// An image for development.
#include "hal/device_key.hpp"

namespace bms::hal {

bool development_image() { return true; }

}  // namespace bms::hal
