// A start of an estimator in plain numbers.
#pragma once

#include <cstdint>

#include "measurement/sample.hpp"

namespace bms::tests {

/// soc and its standard deviation as fractions of the capacity, to the nearest 1e-9. Both >= 0.
constexpr measurement::StartingPoint start_at(double soc, double soc_sigma) {
  constexpr double ppb = 1e9;
  return {static_cast<std::int32_t>(ppb * soc + 0.5), static_cast<std::int32_t>(ppb * soc_sigma + 0.5)};
}

}  // namespace bms::tests
