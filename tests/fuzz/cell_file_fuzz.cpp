// Any text as a cell file: it is rejected with one line, or read. A cell that is written and read again must be equal.
#include <cstdint>
#include <string>

#include "files/bad_input.hpp"
#include "files/cell_file.hpp"
#include "tests/fuzz/require.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace bms;
  const std::string text(reinterpret_cast<const char*>(data), size);
  try {
    const files::CellFile cell = files::parse_cell(text, "fuzz.toml");
    const std::string written = files::cell_text(cell);
    require(files::cell_text(files::parse_cell(written, "again.toml")) == written);
  } catch (const files::BadInput& e) {
    const std::string what = e.what();
    require(!what.empty() && what.find('\n') == std::string::npos);
  }
  return 0;
}
