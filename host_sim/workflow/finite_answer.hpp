// Whether an answer rests on numbers. A cost that is not a number loses every comparison, so that a verdict of "nothing
// is wrong" would follow from it.
#pragma once

#include "diagnosis/pack/pack_verdict.hpp"
#include "diagnosis/verdict.hpp"
#include "identification/identify.hpp"
#include "workflow/identify_cell.hpp"

namespace bms::workflow {

/// Each throws std::runtime_error (a fault of the program, exit code 3) if a number behind the answer is not finite.
void require_finite(const diagnosis::Diagnosis& answer);
void require_finite(const diagnosis::pack::PackDiagnosis& answer);
void require_finite(const identification::Identification& answer);
void require_finite(const IdentifyResult& answer);  ///< with its validations and the joint fit

}  // namespace bms::workflow
