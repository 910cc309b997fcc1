// What of a list of real recordings gave no result.
#pragma once

#include <cstddef>

namespace bms::proof {

/// Sets or cases.
struct NotRun {
  std::size_t skipped = 0;  ///< their recordings are not in the folder
  std::size_t without_cell_file = 0;
};

}  // namespace bms::proof
