// A recording on its way into the replay image and the estimates on their way out, as both sides have them in memory
// (little-endian):   in: StreamHeader, Sample...      out: words of an estimate, ...
//
// An estimate is estimator::EstimateWords and one word more for each state of a mechanism (estimator/estimate.hpp).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "estimator/estimate.hpp"
#include "measurement/sample.hpp"

namespace bms::hal {

struct StreamHeader {
  std::array<char, 4> magic = {'B', 'M', 'S', 'R'};
  std::uint32_t version = 1;
  std::uint32_t has_start = 0;  ///< 1: soc_ppb and soc_sigma_ppb are known
  std::int32_t soc_ppb = 0;
  std::int32_t soc_sigma_ppb = 0;
  std::uint32_t reserved = 0;
};

static_assert(sizeof(StreamHeader) == 24 && std::is_trivially_copyable_v<StreamHeader>);
static_assert(sizeof(measurement::Sample) == 24 && offsetof(measurement::Sample, current_ua) == 8 &&
              offsetof(measurement::Sample, voltage_uv) == 12 &&
              offsetof(measurement::Sample, temperature_cdegc) == 16);
static_assert(sizeof(estimator::EstimateWords) == 20);

}  // namespace bms::hal
