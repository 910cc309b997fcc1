#include "host_sim/cell_file.hpp"

#include <algorithm>
#include <set>
#include <sstream>

#include <toml++/toml.h>

#include "host_sim/bad_input.hpp"
#include "host_sim/text_file.hpp"

namespace bms {

namespace {

/// One table of the file, read key by key; at the end every key must have been read.
class Table {
 public:
  Table(const toml::table& table, std::string file, std::string name) : table_(table), file_(std::move(file)), name_(std::move(name)) {}

  std::string text(const std::string& key) {
    const toml::node& node = required(key, "a text");
    const auto value = node.value<std::string>();
    if (!node.is_string() || !value) refuse(node, key, "a text");
    return *value;
  }

  double number(const std::string& key) {
    const toml::node& node = required(key, "a number");
    return number_of(node, key);
  }

  template <class Column>
  void column(const std::string& key, Column& into) {
    const toml::node& node = required(key, "a list of numbers");
    const toml::array* list = node.as_array();
    if (list == nullptr) refuse(node, key, "a list of numbers");
    if (list->size() > into.value.size()) refuse(node, key, "at most " + std::to_string(into.value.size()) + " numbers");
    for (const toml::node& entry : *list) into.push_back(number_of(entry, key));
  }

  Table table(const std::string& key) {
    const toml::node& node = required(key, "a table");
    if (!node.is_table()) refuse(node, key, "a table");
    return {*node.as_table(), file_, full(key)};
  }

  /// Refuses what nobody asked for.
  void finish() const {
    for (const auto& [key, node] : table_) {
      if (!read_.contains(std::string(key.str()))) {
        throw BadInput(file_, node.source().begin.line, "unknown key '" + full(std::string(key.str())) + "', expected one of: " + expected());
      }
    }
  }

  [[noreturn]] void refuse(const toml::node& node, const std::string& key, const std::string& expected) const {
    throw BadInput(file_, node.source().begin.line, "'" + full(key) + "' is not acceptable, expected " + expected);
  }

 private:
  std::string full(const std::string& key) const { return name_.empty() ? key : name_ + "." + key; }

  const toml::node& required(const std::string& key, const std::string& expected) {
    read_.insert(key);
    const toml::node* node = table_.get(key);
    if (node == nullptr) throw BadInput(file_, std::max<std::size_t>(table_.source().begin.line, 1), "'" + full(key) + "' is missing, expected " + expected);
    return *node;
  }

  double number_of(const toml::node& node, const std::string& key) const {
    if (!node.is_number()) refuse(node, key, "a number");
    return *node.value<double>();
  }

  std::string expected() const {
    std::string list;
    for (const std::string& key : read_) list += (list.empty() ? "" : ", ") + key;
    return list;
  }

  const toml::table& table_;
  std::string file_, name_;
  std::set<std::string> read_;
};

/// Line of the entry that a fault is about.
std::size_t line_of(const toml::table& root, const model::CellFault& fault) {
  const auto node = root.at_path(fault.key);
  if (!node) return 1;
  if (const toml::array* list = node.as_array(); list != nullptr && fault.index < list->size()) return (*list)[fault.index].source().begin.line;
  return node.node()->source().begin.line;
}

}  // namespace

CellFile parse_cell(const std::string& text, const std::string& path) {
  CellFile file;
  file.path = path;
  file.text = text;
  file.hash = static_cast<std::uint32_t>(std::stoul(sha256(text).substr(0, 8), nullptr, 16));

  toml::table root;
  try {
    root = toml::parse(text);
  } catch (const toml::parse_error& error) {
    std::string what(error.description());
    std::replace(what.begin(), what.end(), '\n', ' ');
    throw BadInput(path, std::max<std::size_t>(error.source().begin.line, 1), what + ", expected a cell file in TOML");
  }

  Table top(root, path, "");
  file.name = top.text("name");
  if (file.name.empty() || file.name.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-.") != std::string::npos) {
    top.refuse(*root.get("name"), "name", "letters, digits, '_', '-' and '.'");
  }
  file.chemistry = top.text("chemistry");
  file.source = top.text("source");
  model::CellParameters<>& p = file.parameters;
  p.capacity_ah = top.number("capacity_ah");

  Table limits = top.table("limits");
  limits.text("source");
  p.limits.voltage_min_v = limits.number("voltage_min_v");
  p.limits.voltage_max_v = limits.number("voltage_max_v");
  p.limits.charge_current_max_a = limits.number("charge_current_max_a");
  p.limits.discharge_current_max_a = limits.number("discharge_current_max_a");
  p.limits.temperature_min_c = limits.number("temperature_min_c");
  p.limits.temperature_max_c = limits.number("temperature_max_c");
  limits.finish();

  Table ocv = top.table("ocv");
  ocv.text("source");
  ocv.column("soc", p.ocv.soc);
  ocv.column("b0_v", p.ocv.b0_v);
  ocv.column("b1_v", p.ocv.b1_v);
  ocv.finish();

  Table rc = top.table("rc");
  rc.text("source");
  rc.column("soc", p.rc.soc);
  rc.column("r0_ohm", p.rc.r0_ohm);
  rc.column("r1_ohm", p.rc.r1_ohm);
  rc.column("c1_f", p.rc.c1_f);
  rc.finish();

  Table noise = top.table("noise");
  noise.text("source");
  p.noise.voltage_v = noise.number("voltage_v");
  p.noise.model_v = noise.number("model_v");
  p.noise.model_correlation_s = noise.number("model_correlation_s");
  p.noise.v_rc_v = noise.number("v_rc_v");
  p.noise.rest_v = noise.number("rest_v");
  p.noise.current_a = noise.number("current_a");
  p.noise.current_offset_a = noise.number("current_offset_a");
  p.noise.current_offset_correlation_s = noise.number("current_offset_correlation_s");
  p.noise.current_unknown_a = noise.number("current_unknown_a");
  noise.finish();

  Table tolerance = top.table("tolerance");
  tolerance.text("source");
  p.tolerance.ocv_v = tolerance.number("ocv_v");
  p.tolerance.resistance_fraction = tolerance.number("resistance_fraction");
  p.tolerance.initial_soc = tolerance.number("initial_soc");
  p.tolerance.drift_v = tolerance.number("drift_v");
  tolerance.finish();
  top.finish();

  if (const model::CellFault fault = model::first_fault(p); fault.what != nullptr) {
    throw BadInput(path, line_of(root, fault), std::string("'") + fault.key + "' is out of range, expected " + fault.what);
  }
  return file;
}

CellFile read_cell(const std::string& name_or_path) {
  for (const BuiltInCell& cell : built_in_cells()) {
    if (cell.name == name_or_path) return parse_cell(cell.text, cell.name);
  }
  if (name_or_path.find('/') == std::string::npos && !std::filesystem::exists(name_or_path)) {
    std::string names;
    for (const BuiltInCell& cell : built_in_cells()) names += (names.empty() ? "" : ", ") + cell.name;
    throw BadInput(name_or_path, 1, "no such cell, expected a cell file or one of: " + names);
  }
  return parse_cell(read_file(name_or_path), name_or_path);
}

}  // namespace bms
