// No back end: the core runs portable.hpp as it is. The functions are declared, so that code which calls a back end
// compiles, and never called. Included by backend.hpp only.
#pragma once

#include <cstdint>

#include "arithmetic/portable.hpp"

#define BMS_CALLED

namespace bms::arithmetic::backend {

inline constexpr bool present = false;

std::int64_t wide_product(std::int32_t a, std::int32_t b);
template <int shift, int bits>
inline constexpr bool has_rounded_product = false;
template <int shift, int bits, int of>
std::int32_t rounded_product(std::int32_t a, std::int32_t b);

portable::Packed product(std::int32_t am, std::int32_t ae, std::int32_t bm, std::int32_t be);
portable::Packed sum(std::int32_t am, std::int32_t ae, std::int32_t bm, std::int32_t be);
portable::Packed normalised(std::int32_t m, std::int32_t e);

}  // namespace bms::arithmetic::backend
