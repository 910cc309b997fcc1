// bms proof: the diagnosis on real recordings, each of its claims set beside a measurement that it did not see.
#pragma once

#include <string>

#include "tool/output.hpp"

namespace bms::tool {

struct ProofOptions {
  std::string data;  ///< folder with a123_26650 and a123_esctoolbox
  std::string only;  ///< one experiment; empty: all
  Output output;
};

int run(const ProofOptions& options);

/// The experiments' names, for help.
std::string proof_list_text();

}  // namespace bms::tool
