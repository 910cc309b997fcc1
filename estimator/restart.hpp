// Where to begin after the power was away: at the last estimate that was stored, as sure as it was less what may have
// happened since.
//
// With the contactor open nothing is measured. A lithium iron phosphate cell loses 1 to 3 % a month by itself and a
// battery's own electronics take about as much: 0.2 % of the capacity a day, give or take the same; lost, never won, so
// the mean goes down, too. The first voltage after a long rest then says its part (start.hpp); a belief that it
// contradicts loses.
#pragma once

#include <cstdint>
#include <optional>

#include "measurement/sample.hpp"

namespace bms::estimator {

/// What a battery writes down, e.g. once a minute and when the power goes.
struct StoredEstimate {
  std::int32_t soc_ppb = 0;
  std::int32_t soc_sigma_ppb = 0;
  constexpr bool operator==(const StoredEstimate&) const = default;
};

inline constexpr std::int32_t self_discharge_ppb_per_day = 2'000'000;
// Where no clock ran on, it may have been a night or a winter, a night mostly: what a week loses, give or take a
// month's.
inline constexpr std::uint32_t assumed_off_s = 7U * 86'400, assumed_off_sigma_s = 30U * 86'400;

/// off_s: how long the power was away; nothing: nobody knows.
constexpr measurement::StartingPoint starting_point_after_off_time(const StoredEstimate& stored,
                                                                   std::optional<std::uint32_t> off_s) {
  const std::int64_t lost = std::int64_t{self_discharge_ppb_per_day} * off_s.value_or(assumed_off_s) / 86'400,
                     sigma_growth =
                         std::int64_t{self_discharge_ppb_per_day} * off_s.value_or(assumed_off_sigma_s) / 86'400;
  // standard deviations add: what is lost goes on in one direction
  const std::int64_t sigma = stored.soc_sigma_ppb + sigma_growth, soc = stored.soc_ppb - lost;
  constexpr std::int64_t widest = 289'000'000;  // anything from 0 to 1
  return {static_cast<std::int32_t>(soc > 0 ? soc : 0), static_cast<std::int32_t>(sigma < widest ? sigma : widest)};
}

}  // namespace bms::estimator
