// Writes the table of docs/log_formats.md: ./bms figures.
#include <cstdio>
#include <exception>

#include "files/committed_figures.hpp"
#include "tests/end_to_end/log_table.hpp"

int main() {
  try {
    bms::files::replace_figures(BMS_SOURCE_DIR "/docs/log_formats.md", "logs", bms::log_samples::markdown_table());
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
