// Errors that real instruments make, in forms of their own: no law of the catalogue is used. Each is put into a healthy
// recording.
#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "benchmark/truth/cases.hpp"

namespace bms::benchmark {

struct InstrumentForm {
  std::string_view name;  ///< "dead band around zero"
  std::string_view size;  ///< what `sizes` are: "of 1C"
  std::vector<double> sizes;
  void (*put)(truth::Series& s, double size, double capacity_ah);
  std::vector<std::string_view> right;  ///< ids of the catalogue that describe it; empty: only UNKNOWN does
};

std::span<const InstrumentForm> instrument_forms();

}  // namespace bms::benchmark
