// Any text as a cell file: refused in a line, or read; what was read is written and read again as the same.
#include <cstdint>
#include <string>

#include "host_sim/bad_input.hpp"
#include "host_sim/cell_file.hpp"
#include "tests/fuzz/require.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace bms;
  const std::string text(reinterpret_cast<const char*>(data), size);
  try {
    const CellFile cell = parse_cell(text, "fuzz.toml");
    const std::string written = cell_text(cell);
    require(cell_text(parse_cell(written, "again.toml")) == written);
  } catch (const BadInput& e) {
    const std::string what = e.what();
    require(!what.empty() && what.find('\n') == std::string::npos);
  }
  return 0;
}
