// What start-up has found out before there were data.
#pragma once

namespace bms::hal::cortex_m {

/// Of data and stack, by a march (ram_test.hpp).
bool ram_failed();

}  // namespace bms::hal::cortex_m
