// No requests.
#include "hal/requests.hpp"

namespace bms::hal {

bool next_request(can::Frame&) { return false; }

}  // namespace bms::hal
