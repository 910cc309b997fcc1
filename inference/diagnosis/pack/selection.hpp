// Which accusations of which cells are most probable together.
#pragma once

#include <vector>

#include "diagnosis/pack/pack_likelihood.hpp"

namespace bms::diagnosis::pack {

/// The most probable accusations: added one by one, exchanged for a better one, removed if they are not needed.
/// certain: faults of the data that were recognised before; they stay.
std::vector<Accusation> select(const PackLikelihood& likelihood, const std::vector<Accusation>& certain);

}  // namespace bms::diagnosis::pack
