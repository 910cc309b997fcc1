// The page of bms proof: every claim with its picture, then the plots of each experiment.
#pragma once

#include <string>

#include "proof/proof.hpp"

namespace bms::reports {

std::string proof_report(const proof::ProofResult& result);

}  // namespace bms::reports
