// What the hold-outs say of a diagnosis: in its statement, in its warnings and in the extended cell's source.
#pragma once

#include <span>

#include "workflow/diagnose_recordings.hpp"

namespace bms::workflow {

/// How often a prediction whose standard deviations are right has errors as large as these. errors: in standard
/// deviations, by row; NaN does not count. Their mean square is compared with chi square of as many degrees of freedom
/// as there are independent errors: those of a battery's model are correlated, and a long recording may hold few.
double probability_of(std::span<const double> errors);

/// Judges each hold-out by the interval of its prediction and the noise floor. One that is beyond both contradicts the
/// result, if such errors are as rare as a false alarm may be, or if nothing was found and the hold-out alone has a
/// cause: the statement then says so, and what to do about it. The same if the extended cell predicts the hold-outs
/// worse than the cell file does. It is written all the same, because a hold-out may be the one that is wrong (its
/// start, its temperature); its `source` then says how it predicted them. options, how: those of this diagnosis.
void judge_holdouts(const DiagnoseOptions& options, const diagnosis::Options& how, DiagnoseResult& result);

}  // namespace bms::workflow
