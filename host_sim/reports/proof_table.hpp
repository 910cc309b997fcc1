// The claims of bms proof as one table in Markdown.
#pragma once

#include <string>

#include "proof/proof.hpp"

namespace bms::reports {

/// A page with the claims that hold by experiment, and every claim with what it requires, what the diagnosis reported
/// and what was measured. The same result gives the same text.
std::string proof_table(const proof::ProofResult& result);

}  // namespace bms::reports
