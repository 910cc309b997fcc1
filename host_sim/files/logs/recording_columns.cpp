#include "files/logs/recording_columns.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "files/bad_input.hpp"

namespace bms::files {

using measurement::Recording;

namespace {

/// Mean of the readings in each row that are there.
measurement::Column mean_of(const std::vector<measurement::Column>& columns) {
  std::vector<double> mean(columns.front().size());
  for (std::size_t k = 0; k < mean.size(); ++k) {
    double sum = 0;
    int count = 0;
    for (const measurement::Column& column : columns) {
      if (std::isnan(column[k])) continue;
      sum += column[k];
      ++count;
    }
    mean[k] = count > 0 ? sum / count : missing_value;
  }
  return mean;
}

bool has_no_reading(const measurement::Column& c) {
  return std::all_of(c.begin(), c.end(), [](double v) { return std::isnan(v); });
}

/// Removes the last columns that have no reading: a log may have columns for more cells than the pack.
void drop_absent(std::vector<measurement::Column>& columns) {
  while (!columns.empty() && has_no_reading(columns.back())) columns.pop_back();
}

/// A voltage next to those of the cells that is their sum is the pack's.
void move_pack_voltage(Recording& r) {
  if (r.cell_voltage_v.size() < 2 || r.voltage_v.empty()) return;
  const measurement::Column mean = mean_of(r.cell_voltage_v);
  std::vector<double> ratio;
  for (std::size_t k = 0; k < mean.size(); ++k) {
    if (mean[k] > 0 && !std::isnan(r.voltage_v[k])) ratio.push_back(r.voltage_v[k] / mean[k]);
  }
  if (ratio.empty()) return;
  std::nth_element(ratio.begin(), ratio.begin() + static_cast<std::ptrdiff_t>(ratio.size() / 2), ratio.end());
  const double cells = ratio[ratio.size() / 2];
  if (std::abs(cells - static_cast<double>(r.cell_voltage_v.size())) > 0.5) return;
  if (r.pack_voltage_v.empty()) r.pack_voltage_v = r.voltage_v;
  r.voltage_v = measurement::Column{};
  r.warnings.push_back({"pack_voltage",
                        "voltage_v is the sum of the cells: it is used as pack_voltage_v, and voltage_v "
                        "is the mean of the cells"});
}

}  // namespace

measurement::Column& column_of(Recording& r, const Target& target) {
  const auto numbered = [&](std::vector<measurement::Column>& columns) -> measurement::Column& {
    if (columns.size() < target.number) columns.resize(target.number);
    return columns[target.number - 1];
  };
  switch (target.quantity) {
    case Quantity::time:
      return r.time_s;
    case Quantity::current:
      return r.current_a;
    case Quantity::voltage:
      return r.voltage_v;
    case Quantity::temperature:
      return r.temperature_c;
    case Quantity::soc_ref:
      return r.soc_ref;
    case Quantity::current_ref:
      return r.current_ref_a;
    case Quantity::voltage_ref:
      return r.voltage_ref_v;
    case Quantity::cell_voltage:
      return numbered(r.cell_voltage_v);
    case Quantity::cell_temperature:
      return numbered(r.cell_temperature_c);
    default:
      return r.pack_voltage_v;
  }
}

void put_column(Recording& r, const Target& target, std::vector<double> values) {
  column_of(r, target) = std::move(values);
  for (auto* list : {&r.cell_voltage_v, &r.cell_temperature_c}) {
    for (measurement::Column& column : *list) {
      if (column.size() < r.rows()) column = std::vector<double>(r.rows(), missing_value);
    }
  }
}

void complete_pack(Recording& r, const ReadOptions& options) {
  drop_absent(r.cell_voltage_v);
  drop_absent(r.cell_temperature_c);
  if (!r.pack_voltage_v.empty() && has_no_reading(r.pack_voltage_v)) r.pack_voltage_v = measurement::Column{};
  if (!r.cell_temperature_c.empty() && r.temperature_c.empty()) r.temperature_c = mean_of(r.cell_temperature_c);
  move_pack_voltage(r);
  if (!r.voltage_v.empty()) return;
  if (!r.cell_voltage_v.empty()) {
    r.voltage_v = mean_of(r.cell_voltage_v);
  } else if (!r.pack_voltage_v.empty()) {
    if (options.cells_in_series == 0)
      throw BadInput(r.path, 1, "a pack voltage, but no voltage of a cell, expected --series with the number of cells");
    r.voltage_v = r.pack_voltage_v;
    for (double& v : r.voltage_v.edit()) v /= static_cast<double>(options.cells_in_series);
  }
}

}  // namespace bms::files
