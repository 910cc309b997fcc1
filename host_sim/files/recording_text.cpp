#include "files/recording_text.hpp"

#include <cmath>
#include <iterator>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "files/logs/log_formats.hpp"
#include "files/text_file.hpp"

namespace bms::files {

namespace {

constexpr std::size_t piece_bytes = 1U << 20;

struct Written {
  std::string name;
  const measurement::Column* values = nullptr;
  const std::vector<std::string>* text = nullptr;
};

std::vector<Written> columns_of(const measurement::Recording& r, bool bdf) {
  std::vector<Written> columns;
  const auto add = [&](const Target& target, const measurement::Column& column) {
    if (column.empty()) return;
    const std::string name = name_of(target), label = bdf_label(name);
    columns.push_back({bdf && !label.empty() ? label : name, &column, nullptr});
  };
  add({Quantity::time}, r.time_s);
  add({Quantity::current}, r.current_a);
  add({Quantity::voltage}, r.voltage_v);
  add({Quantity::temperature}, r.temperature_c);
  add({Quantity::soc_ref}, r.soc_ref);
  add({Quantity::current_ref}, r.current_ref_a);
  add({Quantity::voltage_ref}, r.voltage_ref_v);
  for (std::size_t k = 0; k < r.cell_voltage_v.size(); ++k) add({Quantity::cell_voltage, k + 1}, r.cell_voltage_v[k]);
  for (std::size_t k = 0; k < r.cell_temperature_c.size(); ++k)
    add({Quantity::cell_temperature, k + 1}, r.cell_temperature_c[k]);
  add({Quantity::pack_voltage}, r.pack_voltage_v);
  for (const measurement::OtherColumn& other : r.others)
    columns.push_back({bdf ? label_of_machine_name(other.name) : machine_name(other.name), nullptr, &other.text});
  return columns;
}

/// A field that has the separator or a quote stands in quotes.
std::string field_of(const std::string& text) {
  return text.find(',') == std::string::npos ? text : "\"" + text + "\"";
}

/// A comment line for each repair that was made while reading.
std::string repairs_of(const measurement::Recording& r) {
  std::string lines;
  for (const measurement::Warning& w : r.warnings) {
    if (is_repair(w)) lines += "# repaired: " + printable(w.text) + "\n";
  }
  return lines;
}

}  // namespace

bool is_repair(const measurement::Warning& warning) { return warning.id.starts_with("repair_"); }

bool is_bdf_name(const std::string& path) { return path.ends_with(".bdf") || path.ends_with(".bdf.csv"); }

void write_recording(const measurement::Recording& r, const std::string& path, bool bdf) {
  const std::vector<Written> columns = columns_of(r, bdf);
  write_file(path, [&](const Sink& sink) {
    std::string text = bdf ? std::string{} : repairs_of(r);
    for (std::size_t c = 0; c < columns.size(); ++c) text += (c == 0 ? "" : ",") + field_of(columns[c].name);
    text += '\n';
    for (std::size_t k = 0; k < r.rows(); ++k) {
      for (std::size_t c = 0; c < columns.size(); ++c) {
        if (c > 0) text += ',';
        if (columns[c].text != nullptr)
          text += field_of((*columns[c].text)[k]);
        else if (const double value = (*columns[c].values)[k]; !std::isnan(value))
          fmt::format_to(std::back_inserter(text), "{}", value);
      }
      text += '\n';
      if (text.size() < piece_bytes) continue;
      sink(text);
      text.clear();
    }
    sink(text);
  });
}

}  // namespace bms::files
