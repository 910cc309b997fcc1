// Simpler rules on the same cases, with the same score: the diagnosis must be better than these.
//
// Each rule gets the recording as the diagnosis prepares it: invalid readings removed, sensor noise removed from the
// current at constant load. Each knows the noise floor that the diagnosis begins with (converter, tolerance and drift
// of the cell file). They do not check for data faults. README.md describes each rule.
#pragma once

#include <array>

#include "benchmark/run_case.hpp"

namespace bms::benchmark {

/// RMS of the residual, in noise floors, above which a rule reports a mismatch: the smallest multiple of 0.25 with
/// mismatches in at most a tenth of the nulls of the development split.
inline constexpr double frozen_factor = 2, refit_factor = 0.75;

/// The cell file without any change. A residual above the factor is UNKNOWN; no cause is named.
Outcome frozen_model(const truth::Case& c);

/// All base parameters are fitted to the recording within the tolerance of the cell file; the hold-out is predicted
/// with them. No cause is named.
Outcome base_refit(const truth::Case& c);

/// The same with ten times the tolerance.
Outcome free_refit(const truth::Case& c);

/// Mechanisms are added as long as AICc falls, at most five. AICc assumes white noise of unknown variance.
Outcome aicc_forward(const truth::Case& c);

/// The mechanism whose signature has the largest cosine with the residual of the frozen model, without whitening.
Outcome nearest_signature(const truth::Case& c);

struct Method {
  const char* name;
  Outcome (*run)(const truth::Case& c);
};
/// This project's diagnosis first.
inline constexpr std::array<Method, 6> methods = {Method{"greybox-bms", run_case_with_experiments},
                                                  Method{"frozen", frozen_model},
                                                  Method{"base refit", base_refit},
                                                  Method{"free refit", free_refit},
                                                  Method{"AICc forward", aicc_forward},
                                                  Method{"nearest signature", nearest_signature}};

}  // namespace bms::benchmark
