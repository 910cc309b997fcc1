// Nobody asks.
#include "hal/requests.hpp"

namespace bms::hal {

bool next_request(CanFrame&) { return false; }

}  // namespace bms::hal
