// Any text as a recording: it is rejected with one line, or read. Then its columns have equal lengths, its times do not
// decrease, and it can be converted to samples.
#include <cmath>
#include <cstdint>
#include <string>

#include "files/bad_input.hpp"
#include "files/cell_file.hpp"
#include "files/recording.hpp"
#include "measurement/recording_checks.hpp"
#include "tests/fuzz/require.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace bms;
  if (size == 0) return 0;
  static const files::CellFile cell = files::read_cell("table9");
  try {
    measurement::Recording r =
        files::parse_recording(std::string(reinterpret_cast<const char*>(data) + 1, size - 1), "fuzz.csv",
                               (data[0] & 1) != 0 ? files::VoltageColumn::required : files::VoltageColumn::optional);
    require(r.rows() >= 10 && r.current_a.size() == r.rows());
    for (const auto* column : {&r.voltage_v, &r.temperature_c, &r.soc_ref, &r.current_ref_a, &r.voltage_ref_v})
      require(column->empty() || column->size() == r.rows());
    for (std::size_t k = 0; k < r.rows(); ++k)
      require(std::isfinite(r.time_s[k]) && (k == 0 || r.time_s[k] >= r.time_s[k - 1]));
    measurement::compare_with_cell(r, cell.parameters);
    if (!r.voltage_v.empty()) require(measurement::samples(r).size() <= r.rows());
    for (const measurement::Warning& w : r.warnings) require(!w.id.empty() && w.text.find('\n') == std::string::npos);
  } catch (const files::BadInput& e) {
    const std::string what = e.what();
    require(!what.empty() && what.find('\n') == std::string::npos);
  }
  return 0;
}
