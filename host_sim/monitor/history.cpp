#include "monitor/history.hpp"

#include <algorithm>

#include "monitor/pack_view.hpp"

namespace bms::monitor {

HistoryPoint point_of(const BusState& bus) {
  const PackView view = pack_view(bus);
  const auto value = [](const Reading& r) {
    return r.stale ? HistoryPoint::not_available : static_cast<float>(r.value);
  };
  HistoryPoint p;
  p.time_s = bus.duration_s();
  p.soc_percent = value(view.soc_percent);
  p.soc_sigma_percent = value(view.soc_sigma_percent);
  p.current_a = value(view.current_a);
  p.voltage_v = value(view.voltage_v);
  p.temperature_c = value(view.temperature_c);
  p.cell_count = static_cast<std::uint8_t>(std::min(view.cells_v.size(), HistoryPoint::max_cells));
  for (std::size_t k = 0; k < p.cell_count; ++k) p.cells_v[k] = value(view.cells_v[k]);
  return p;
}

}  // namespace bms::monitor
