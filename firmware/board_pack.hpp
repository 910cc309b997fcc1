// The pack of this image: cell file, board and truck.
#pragma once

#include "cell_constants.hpp"  // generated from the cell file
#include "firmware/board_design.hpp"

namespace bms::firmware {

inline constexpr protection::PackDesign board_pack =
    board_design(generated::parameters.limits, generated::parameters.capacity_ah, generated::pulses);

}  // namespace bms::firmware
