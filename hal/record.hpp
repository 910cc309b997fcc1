// Where every estimate is kept word for word. Back ends: emulated/samples_stream (a file), absent/ (nowhere).
#pragma once

#include "estimator/estimate.hpp"

namespace bms::hal {

void record(const EstimateWords& words);

}  // namespace bms::hal
