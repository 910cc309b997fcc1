// One draft of a case: a cell, a laboratory and two tests are drawn, the effects are scaled, and the result is
// recorded.
#pragma once

#include "benchmark/truth/cases.hpp"
#include "benchmark/truth/effects.hpp"

namespace bms::benchmark::truth {

struct Draft {
  Case made;
  bool good = true;  ///< false: a strength, the SOC range or the similarity of a pair is not as wanted
};

/// Strengths that are drawn for one effect, in detection limits.
struct Strengths {
  double least = 0.5, most = 8;
};

/// demanding: a null whose calibration, drift, currents and weather are near or beyond what the cell file knows.
Draft draw_draft(CaseKind kind, bool demanding, const std::vector<const EffectKind*>& effects, plant::Random& random,
                 Strengths strengths = {});

}  // namespace bms::benchmark::truth
