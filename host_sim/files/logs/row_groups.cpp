#include "files/logs/row_groups.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "files/logs/paired_column.hpp"

namespace bms::files {

using measurement::Column;
using measurement::Recording;

namespace {

/// True if most of the readings stand in rows without a current, and most rows with a current have none: they were not
/// taken together. Rows that only lack the current, as after a sensor has failed, are ordinary ones.
bool is_apart(const Column& column, const Column& current) {
  std::size_t readings = 0, alone = 0, currents = 0;
  for (std::size_t k = 0; k < column.size(); ++k) {
    currents += std::isnan(current[k]) ? 0 : 1;
    if (std::isnan(column[k])) continue;
    ++readings;
    alone += std::isnan(current[k]) ? 1 : 0;
  }
  return 2 * alone > readings && 2 * (readings - alone) < currents;
}

std::vector<Column*> columns_of(Recording& r) {
  std::vector<Column*> all = {&r.voltage_v,     &r.temperature_c, &r.soc_ref,
                              &r.current_ref_a, &r.voltage_ref_v, &r.pack_voltage_v};
  for (Column& c : r.cell_voltage_v) all.push_back(&c);
  for (Column& c : r.cell_temperature_c) all.push_back(&c);
  std::erase_if(all, [&](const Column* c) { return c->size() != r.rows(); });
  return all;
}

/// The column in the rows with a current, and the mean time of its readings after those rows [s].
std::pair<std::vector<double>, double> joined(const Column& column, const Recording& r) {
  PairedColumn paired;
  for (std::size_t k = 0; k < r.rows(); ++k) {
    if (!std::isnan(column[k])) paired.receive(r.time_s[k], column[k]);
    if (!std::isnan(r.current_a[k])) paired.add_row(r.time_s[k], true);
  }
  paired.end();
  return {std::move(paired.values()), paired.mean_delay_s()};
}

}  // namespace

void join_row_groups(Recording& r) {
  if (r.current_a.size() != r.rows() || std::ranges::all_of(r.current_a, [](double a) { return std::isnan(a); }))
    return;
  const std::vector<Column*> all = columns_of(r);
  const auto apart = [&](const Column& c) { return c.size() == r.rows() && is_apart(c, r.current_a); };
  const bool any = apart(r.voltage_v) || apart(r.pack_voltage_v) ||
                   std::any_of(r.cell_voltage_v.begin(), r.cell_voltage_v.end(), apart);
  if (!any) return;
  double farthest_s = 0;
  std::vector<std::vector<double>> values;
  for (const Column* c : all) {
    auto [column, delay_s] = joined(*c, r);
    farthest_s = std::abs(delay_s) > std::abs(farthest_s) ? delay_s : farthest_s;
    values.push_back(std::move(column));
  }
  const std::size_t before = r.rows();
  std::vector<double> time_s, current_a;
  std::vector<std::size_t> kept;
  for (std::size_t k = 0; k < before; ++k) {
    if (std::isnan(r.current_a[k])) continue;
    kept.push_back(k);
    time_s.push_back(r.time_s[k]);
    current_a.push_back(r.current_a[k]);
  }
  for (auto& other : r.others) {
    std::vector<std::string> text;
    for (const std::size_t k : kept) text.push_back(k < other.text.size() ? other.text[k] : "");
    other.text = std::move(text);
  }
  for (std::size_t k = 0; k < all.size(); ++k) *all[k] = std::move(values[k]);
  r.time_s = std::move(time_s);
  r.current_a = std::move(current_a);
  r.warnings.push_back(
      {"repair_row_groups",
       fmt::format("current and voltages are in different rows: {} of {} rows have a current and remain, each "
                   "with the readings nearest in time, up to {:.3g} s away on average and held until the next",
                   kept.size(), before, std::abs(farthest_s))});
}

}  // namespace bms::files
