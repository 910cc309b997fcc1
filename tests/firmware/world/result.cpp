#include <algorithm>
#include <functional>
#include <sstream>

#include <fmt/format.h>

#include "files/text_file.hpp"

#include "tests/firmware/world/scenarios.hpp"

namespace bms::world {

unsigned Result::failed() const {
  return static_cast<unsigned>(
      std::count_if(outcomes.begin(), outcomes.end(), [](const Outcome& o) { return !o.good; }));
}

bool Extent::has(const std::string& name) const {
  std::istringstream texts(only);
  for (std::string text; std::getline(texts, text, '|');) {
    if (name.find(text) != std::string::npos) return true;
  }
  return only.empty();
}

std::filesystem::path Extent::kept(const std::string& scenario, const Pack& pack) const {
  if (!continues) return {};
  const std::size_t image = std::hash<std::string>{}(files::read_file(pack.image));
  return std::filesystem::path(BMS_SOURCE_DIR "/build/world") / fmt::format("{}_{:016x}_{}", scenario, image, seed);
}

}  // namespace bms::world
