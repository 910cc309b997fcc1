// Runs the whole fault matrix in the HIL image of the forklift board: ./bms faults [TEXT]
//
//   --write        writes the table to firmware/protection/README.md
//   --only TEXT    runs the cases whose names contain TEXT, and prints every sample
//
// Exit code 1 if a fault is missed, false or late.
#include <cstdio>
#include <cstring>
#include <exception>

#include <fmt/format.h>

#include "files/committed_figures.hpp"
#include "tests/firmware/board_fault_matrix.hpp"

int main(int count, char** words) {
  using namespace bms;
  try {
    const bool some = count > 1 && std::strcmp(words[1], "--some") == 0;
    const std::string only = count > 2 && std::strcmp(words[1], "--only") == 0 ? words[2] : "";
    const auto result = protection::run_fault_matrix(!some, 1, 2, only);
    fmt::print("{}", result.trace);
    for (const std::string& line : result.wrong) fmt::print("{}\n", line);
    const std::string table = protection::markdown(result);
    fmt::print("{}{} deviations\n", table, result.wrong.size());
    if (count > 1 && std::strcmp(words[1], "--write") == 0) {
      files::replace_figures(BMS_SOURCE_DIR "/firmware/protection/README.md", "fault matrix", table);
    }
    return result.wrong.empty() ? 0 : 1;
  } catch (const std::exception& e) {
    fmt::print(stderr, "fault matrix: {}\n", e.what());
    return 3;
  }
}
