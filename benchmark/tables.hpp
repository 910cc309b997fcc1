// The benchmark's tables, as Markdown: every figure of every method beside what is required, the classes that were
// mistaken for each other, and detection over the strength of the effect.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "benchmark/run_case.hpp"

namespace bms::benchmark {

/// A method and what it made of the cases, in their order.
struct Column {
  std::string method;
  std::vector<Outcome> outcomes;
};

/// Shares as "hits of cases: share (Wilson's 95 % interval)"; "-" where no case counts.
std::string figures_table(const std::vector<Column>& columns);

/// Single effects at twice the detection limit and above, nulls and what is outside the catalogue: what was named
/// first, by class.
std::string confusion_table(const std::vector<Outcome>& outcomes);

/// Single effects that were not passed over, by strength in detection limits.
std::string detection_table(const std::vector<Column>& columns);

/// All three under headings that say of which split, seed and how many cases. The confusions are the first column's.
std::string report(const std::string& split, std::uint64_t seed, const std::vector<Column>& columns);

}  // namespace bms::benchmark
