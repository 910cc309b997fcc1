// The values of a cell file over the state of charge, as charts of a page.
#pragma once

#include <vector>

#include "files/cell_file.hpp"
#include "files/page_content.hpp"

namespace bms::reports {

/// OCV, R0 and R1, C1. Bands: two standard deviations, if the file has them; of the OCV, the slow charge and discharge.
std::vector<files::PageChart> cell_charts(const files::CellFile& cell);

}  // namespace bms::reports
