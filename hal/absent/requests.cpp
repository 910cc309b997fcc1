// No requests.
#include "hal/requests.hpp"

namespace bms::hal {

bool next_request(can::Frame&) { return false; }
bool next_network_frame(can::Frame&) { return false; }

}  // namespace bms::hal
