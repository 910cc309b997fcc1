// Runs the diagnosis on a simulated pack, and says what came of it.
#pragma once

#include "benchmark/pack_score.hpp"
#include "benchmark/truth/packs.hpp"
#include "workflow/pack_diagnosis.hpp"

namespace bms::benchmark {

/// shared: the mean of the cells is diagnosed as one cell as well.
workflow::PackResult diagnose(const truth::PackCase& c, bool shared);

/// The same, scored.
PackOutcome run_pack(const truth::PackCase& c, bool shared);

/// To stdout: a line for the pack, and one for each planted fault and each wrong answer.
void print(const PackOutcome& o);

}  // namespace bms::benchmark
