// Data faults: errors of the file rather than of the cell or an instrument.
#pragma once

#include <array>

#include "benchmark/truth/cases.hpp"
#include "plant/random.hpp"

namespace bms::benchmark::truth {

/// Changes the series; writes where and how large into the answer.
struct DataFault {
  const char* name;
  void (*apply)(Series& recording, Series& holdout, Answer& answer, plant::Random& random);
};

/// The order decides which case of a split has which fault.
extern const std::array<DataFault, 5> data_faults;

double rms(const std::vector<double>& values);

}  // namespace bms::benchmark::truth
