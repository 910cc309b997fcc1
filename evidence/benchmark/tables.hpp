// The tables of the benchmark as Markdown: every figure of every method, the classes that were confused with each
// other, and detection over the strength of the effect.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "benchmark/run_case.hpp"
#include "benchmark/score.hpp"

namespace bms::benchmark {

/// A method and its outcomes in the order of the cases.
struct Column {
  std::string method;
  std::vector<Outcome> outcomes;
};

/// A measured figure, named as in targets.toml where a target is stated: a share or, if it has no cases, a number.
struct Figure {
  std::string name;
  Share share;
  double value = 0;
};

/// Those for which there were cases.
std::vector<Figure> figures_of(const Score& score);

/// Shares as "hits of cases: share (Wilson's 95 % interval)"; "-" without cases.
std::string figures_table(const std::vector<Column>& columns);

/// Single effects at twice the detection limit and above, nulls and effects outside the catalogue: the class that was
/// named first.
std::string confusion_table(const std::vector<Outcome>& outcomes);

/// Single effects that were detected, by strength in detection limits.
std::string detection_table(const std::vector<Column>& columns);

/// All three tables with headings that state split, seed and number of cases. The confusions are those of the first
/// column.
std::string report(const std::string& split, std::uint64_t seed, const std::vector<Column>& columns);

}  // namespace bms::benchmark
