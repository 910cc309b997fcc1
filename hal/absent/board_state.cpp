// No self-tests: reports no fault.
#include "hal/board_state.hpp"

namespace bms::hal {

void board_start() {}
BoardState board_state() { return {}; }

}  // namespace bms::hal
