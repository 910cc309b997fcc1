// Ids of causes, as the outcomes of the benchmark hold them.
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "model/catalogue.hpp"

namespace bms::benchmark {

inline std::string id_of(std::size_t mechanism) { return std::string(model::catalogue[mechanism].id); }

inline bool contains(const std::vector<std::string>& ids, const std::string& id) {
  return std::find(ids.begin(), ids.end(), id) != ids.end();
}

}  // namespace bms::benchmark
