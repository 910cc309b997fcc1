// table9 with pulses of both directions: one image for all that tests ask of a cell file that rates them.
#pragma once

#include "files/cell_file.hpp"

namespace bms::firmware {

inline files::CellFile table9_rated() {
  files::CellFile rated = files::read_cell("table9");
  rated.pulses.discharge = {.for_10s_a = 18, .for_30s_a = 12};
  rated.pulses.charge = {.for_10s_a = 9};
  rated.name = "table9_rated";
  return files::parse_cell(files::cell_text(rated), rated.name);
}

}  // namespace bms::firmware
