// An image for a product (BMS_PRODUCTION=ON).
#include "hal/device_key.hpp"

namespace bms::hal {

bool development_image() { return false; }

}  // namespace bms::hal
