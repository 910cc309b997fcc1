#include "measurement/cut.hpp"

#include <cstddef>

namespace bms::measurement {

void cut(Recording& r, double from_s, double until_s) {
  const double start_s = r.time_s.empty() ? 0 : r.time_s.front();
  std::size_t first = 0, end = r.rows();
  while (first < end && r.time_s[first] - start_s < from_s) ++first;
  while (end > first && r.time_s[end - 1] - start_s > until_s) --end;
  const std::size_t rows = r.rows(), count = end - first;
  const auto shorten = [&](Column& column) {
    if (column.size() == rows) column = column.part(first, count);
  };
  for (Column* column : {&r.current_a, &r.voltage_v, &r.temperature_c, &r.soc_ref, &r.current_ref_a, &r.voltage_ref_v,
                         &r.pack_voltage_v})
    shorten(*column);
  for (auto* columns : {&r.cell_voltage_v, &r.cell_temperature_c}) {
    for (Column& column : *columns) shorten(column);
  }
  for (OtherColumn& other : r.others) {
    if (other.text.size() != rows) continue;
    other.text.resize(end);
    other.text.erase(other.text.begin(), other.text.begin() + static_cast<std::ptrdiff_t>(first));
  }
  shorten(r.time_s);
}

}  // namespace bms::measurement
