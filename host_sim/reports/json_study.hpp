// Results of study and proof as JSON objects. Their names are relied on from outside.
#pragma once

#include <string>

#include "proof/proof.hpp"
#include "study/diagnose_paper.hpp"
#include "study/study.hpp"

namespace bms::reports {

std::string json_of(const study::PaperDiagnosis& diagnosis);
std::string json_of(const study::StudyResult& result);
std::string json_of(const proof::ProofResult& result);

}  // namespace bms::reports
