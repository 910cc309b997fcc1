// The page of bms proof: every claim with its picture, then what each experiment shows.
#pragma once

#include <string>

#include "host_sim/proof.hpp"

namespace bms {

std::string proof_report(const ProofResult& result);

}  // namespace bms
