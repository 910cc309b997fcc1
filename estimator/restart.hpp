// The starting point after the power was off: the stored estimate, with a sigma that grows with the time.
//
// Nothing is measured while the contactor is open. A lithium iron phosphate cell loses 1 to 3 % a month by
// self-discharge, and the battery's own electronics take about as much: 0.2 % of the capacity a day, with a standard
// deviation of the same size. Charge is only lost, so the mean decreases as well. After a long rest the first voltage
// corrects the SOC (start.hpp) and overrides a starting point that it contradicts.
#pragma once

#include <cstdint>
#include <optional>

#include "measurement/sample.hpp"

namespace bms::estimator {

/// What a battery stores, e.g. once a minute and when the power fails.
struct StoredEstimate {
  std::int32_t soc_ppb = 0;
  std::int32_t soc_sigma_ppb = 0;
  constexpr bool operator==(const StoredEstimate&) const = default;
};

inline constexpr std::int32_t self_discharge_ppb_per_day = 2'000'000;
// Without a clock the power may have been off for a night or a winter, mostly for a night: the loss of a week, with a
// standard deviation of a month's.
inline constexpr std::uint32_t assumed_off_s = 7U * 86'400, assumed_off_sigma_s = 30U * 86'400;

/// off_s: how long the power was off; nullopt if unknown.
constexpr measurement::StartingPoint starting_point_after_off_time(const StoredEstimate& stored,
                                                                   std::optional<std::uint32_t> off_s) {
  const std::int64_t lost = std::int64_t{self_discharge_ppb_per_day} * off_s.value_or(assumed_off_s) / 86'400,
                     sigma_growth =
                         std::int64_t{self_discharge_ppb_per_day} * off_s.value_or(assumed_off_sigma_s) / 86'400;
  // the loss keeps its sign, so standard deviations add
  const std::int64_t sigma = stored.soc_sigma_ppb + sigma_growth, soc = stored.soc_ppb - lost;
  constexpr std::int64_t widest = 289'000'000;  // uniform from 0 to 1: 1 / sqrt(12)
  return {static_cast<std::int32_t>(soc > 0 ? soc : 0), static_cast<std::int32_t>(sigma < widest ? sigma : widest)};
}

}  // namespace bms::estimator
