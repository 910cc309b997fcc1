// Design of this board's pack: the cell file's limits, and what the board has.
#pragma once

#include "board_config.hpp"    // generated from boards/<board>/board.cmake and the build options
#include "cell_constants.hpp"  // generated from the cell file
#include "protection/pack_design.hpp"

namespace bms::firmware {

constexpr protection::PackDesign board_design() {
  return {.limits = generated::parameters.limits,
          .capacity_ah = generated::parameters.capacity_ah,
          .cells = hal::pack_cells,
          .temperatures = hal::pack_cells > 1 ? 4 : 1,
          .sample_period_s = hal::sample_period_s,
          .dc_link = hal::has_dc_link,
          .current_range_a = hal::current_range_a};
}

}  // namespace bms::firmware
