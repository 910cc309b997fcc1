// Times and limits of the contactors, from the design of the pack.
#pragma once

#include <algorithm>
#include <cstdint>

#include "protection/pack_design.hpp"

namespace bms::protection {

struct ContactorPlan {
  static constexpr std::uint32_t without_readings_us = 5'000'000;  ///< longest opening without readings
  static constexpr std::uint32_t max_half_time_constants = 14;

  std::uint32_t test_us, half_time_constant_us;
  std::int32_t rest_ua, max_closing_gap_uv;
  bool dc_link;

  /// Limit up to which the time in a state is counted.
  constexpr std::uint32_t longest_us() const {
    return std::max({test_us, max_half_time_constants * half_time_constant_us, without_readings_us});
  }
};

constexpr ContactorPlan contactor_plan(const PackDesign& d) {
  const std::uint32_t half_us = in_us(d.precharge_time_constant_s / 2);
  return {std::max(half_us, in_us(3 * d.sample_period_s)), half_us, in_micro(d.rest_current_c_rate * d.capacity_ah),
          in_micro(d.closing_current_max_a * d.closing_loop_ohm), d.dc_link};
}

}  // namespace bms::protection
