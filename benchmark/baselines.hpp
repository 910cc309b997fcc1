// Simpler rules on the same cases, scored by the same score: what the diagnosis has to be better than.
//
// Each gets the recording as the diagnosis prepares it: bad readings taken out, the current quieted where it is
// constant. Each knows the noise floor that the diagnosis begins with (converter, cell file's tolerance and drift).
// None looks for data faults. README.md tells each in a paragraph.
#pragma once

#include <array>

#include "benchmark/run_case.hpp"

namespace bms::benchmark {

/// RMS of a residual that is a mismatch, in noise floors: in quarters, the least that calls no more than a tenth of the
/// development split's nulls one.
inline constexpr double frozen_factor = 2, refit_factor = 0.75;

/// The cell file as it is. A residual above the factor is UNKNOWN: it names nothing.
Outcome frozen_model(const truth::Case& c);

/// Every base parameter refitted to the recording, within the cell file's tolerance; the hold-out is predicted with
/// them. Names nothing.
Outcome base_refit(const truth::Case& c);

/// The same, ten times as free.
Outcome free_refit(const truth::Case& c);

/// Mechanisms added as long as AICc falls, which takes the residual for white noise of unknown variance. At most five.
Outcome aicc_forward(const truth::Case& c);

/// The mechanism whose signature has the largest cosine with the frozen model's residual, as both are.
Outcome nearest_signature(const truth::Case& c);

struct Method {
  const char* name;
  Outcome (*run)(const truth::Case& c);
};
/// Ours first.
inline constexpr std::array<Method, 6> methods = {
    Method{"greybox-bms", run_case},      Method{"frozen", frozen_model},
    Method{"base refit", base_refit},     Method{"free refit", free_refit},
    Method{"AICc forward", aicc_forward}, Method{"nearest signature", nearest_signature}};

}  // namespace bms::benchmark
