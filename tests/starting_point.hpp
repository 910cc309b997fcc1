// Starting points of the estimator as fractions instead of units of 1e-9, for every test.
#pragma once

#include <cstdint>

#include "measurement/sample.hpp"

namespace bms {

/// starting_at(0.65, 0.05): a state of charge of 65 % with a standard deviation of 5 %.
constexpr measurement::StartingPoint starting_at(double soc, double soc_sigma) {
  return {.soc_ppb = static_cast<std::int32_t>(1e9 * soc + 0.5),
          .soc_sigma_ppb = static_cast<std::int32_t>(1e9 * soc_sigma + 0.5)};
}
static_assert(starting_at(0.65, 0.05).soc_ppb == 650'000'000 && starting_at(0.65, 0.05).soc_sigma_ppb == 50'000'000);

}  // namespace bms
