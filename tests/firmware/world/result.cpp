#include <algorithm>
#include <functional>
#include <sstream>

#include <fmt/format.h>

#include "tests/firmware/elf_image.hpp"
#include "tests/firmware/world/scenarios.hpp"

namespace bms::world {

unsigned Result::failed() const {
  return static_cast<unsigned>(
      std::count_if(outcomes.begin(), outcomes.end(), [](const Outcome& o) { return !o.good; }));
}

std::string Extent::named(const std::string& scenario) const {
  return cells == Extent{}.cells ? scenario : fmt::format("{} of {} cells", scenario, cells);
}

bool Extent::has(const std::string& name) const {
  std::istringstream texts(only);
  for (std::string text; std::getline(texts, text, '|');) {
    if (name.find(text) != std::string::npos) return true;
  }
  return only.empty();
}

void Extent::set(Cases& cases, const std::string& scenario, const Pack& pack) const {
  cases.only_kept = only_kept;
  cases.first = from;
  cases.largest = most;
  cases.most_minutes = within_minutes;
  if (!continues && !only_kept) return;
  std::string program;
  for (const firmware::ProgramPart& part : firmware::program_of(pack.image)) program += part.bytes;
  cases.kept = std::filesystem::path(BMS_SOURCE_DIR "/build/world") /
               fmt::format("{}_{:016x}_{}", scenario, std::hash<std::string>{}(program), seed);
}

}  // namespace bms::world
