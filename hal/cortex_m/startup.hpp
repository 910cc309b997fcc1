// Result of the RAM test at start-up.
#pragma once

namespace bms::hal::cortex_m {

/// Returns true if the march test (ram_test.hpp) of data and stack failed.
bool ram_failed();

}  // namespace bms::hal::cortex_m
