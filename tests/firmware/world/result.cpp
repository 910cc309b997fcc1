#include <algorithm>

#include "tests/firmware/world/scenarios.hpp"

namespace bms::world {

unsigned Result::failed() const {
  return static_cast<unsigned>(
      std::count_if(outcomes.begin(), outcomes.end(), [](const Outcome& o) { return !o.good; }));
}

bool Extent::has(const std::string& name) const { return only.empty() || name.find(only) != std::string::npos; }

}  // namespace bms::world
