// A case as files that `bms` reads.
#pragma once

#include <string>

#include "benchmark/truth/cases.hpp"

namespace bms::benchmark::truth {

/// Columns time_s, current_a, voltage_v, temperature_c (unless empty), soc_ref.
std::string csv_of(const Series& series);

/// The cell file.
std::string cell_toml(const CalibratedCell& cell, const std::string& name);

}  // namespace bms::benchmark::truth
