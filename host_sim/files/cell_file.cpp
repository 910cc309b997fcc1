#include "files/cell_file.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "files/healthy_table.hpp"
#include "files/text_file.hpp"
#include "files/toml_table.hpp"
#include "files/toml_text.hpp"
#include "model/cell_fields.hpp"
#include "model/possible_cell.hpp"

namespace bms::files {

namespace {

template <class Column>
void read_column(TomlTable& table, const std::string& key, Column& into) {
  const std::vector<double> values = table.numbers(key);
  if (values.size() > into.value.size()) table.reject(key, fmt::format("at most {} numbers", into.value.size()));
  for (const double value : values) into.push_back(value);
}

/// The table [mechanism.ID] or [instrument.ID]: its keys are the parameters of the mechanism.
model::MechanismSetting read_mechanism(TomlTable& table, std::size_t index, CellFile& file) {
  const model::MechanismInfo& info = model::catalogue[index];
  const std::string name = table_of(info);
  const double capacity_ah = file.parameters.capacity_ah;
  if (table.has("source")) file.sources[name] = table.text("source");
  model::MechanismSetting setting = model::default_setting(index, file.parameters);
  for (std::size_t k = 0; k < info.parameters; ++k) {
    const std::string key(info.parameter[k].name), deviation = key + "_std";
    if (table.has(key)) setting.value[k] = table.number(key);
    if (table.has(deviation)) setting.deviation[k] = table.number(deviation);
  }
  table.finish();
  const std::size_t k = model::first_fault(setting, capacity_ah);
  if (k == info.parameters) return setting;
  const model::Parameter& bad = info.parameter[k];
  const bool value_in_range = setting.value[k] >= bad.lower(capacity_ah) && setting.value[k] <= bad.upper(capacity_ah);
  const std::string key = std::string(bad.name) + (value_in_range ? "_std" : "");
  throw BadInput(file.path, table.line(key),
                 fmt::format("'{}.{}' is out of range, expected {}", name, key,
                             value_in_range ? "0 or more" : range_of(bad, capacity_ah)));
}

void read_mechanisms(TomlTable& top, CellFile& file) {
  for (const char* kind : {"mechanism", "instrument"}) {
    if (!top.has(kind)) continue;
    TomlTable group = top.table(kind);
    for (std::size_t index = 0; index < model::mechanism_count; ++index) {
      const model::MechanismInfo& info = model::catalogue[index];
      const std::string id(info.id);
      if (!table_of(info).starts_with(kind) || !group.has(id)) continue;
      TomlTable table = group.table(id);
      put_mechanism(file, read_mechanism(table, index, file));
    }
    group.finish();
  }
}

/// Visitor of cell_fields.hpp that reads.
class Reader {
 public:
  /// For the keys of one table.
  explicit Reader(TomlTable& table) : top_(table) {}
  /// For a whole cell file: each table has a source.
  Reader(TomlTable& top, std::map<std::string, std::string>& sources) : top_(top), sources_(&sources) {}

  void table(const std::string& key) {
    finish();
    inner_.emplace(top_.table(key));
    (*sources_)[key] = inner_->text("source");
  }
  bool optional_table(const std::string& key, bool /*known*/) {
    if (!top_.has(key)) return false;
    table(key);
    return true;
  }
  void number(const std::string& key, double& into) { into = current().number(key); }
  void optional_number(const std::string& key, double& into, double /*omitted*/ = 0) {
    if (current().has(key)) number(key, into);
  }
  void optional_flag(const std::string& key, bool& into) {
    if (current().has(key)) into = current().flag(key);
  }
  template <class Column>
  void column(const std::string& key, Column& into) {
    read_column(current(), key, into);
  }
  template <class Column>
  void optional_column(const std::string& key, Column& into) {
    if (current().has(key)) column(key, into);
  }
  void finish() const {
    if (inner_) inner_->finish();
  }

 private:
  TomlTable& current() { return inner_ ? *inner_ : top_; }

  TomlTable& top_;
  std::optional<TomlTable> inner_;
  std::map<std::string, std::string>* sources_ = nullptr;
};

/// Visitor of cell_fields.hpp that writes.
class Writer {
 public:
  Writer(std::string& text, const std::map<std::string, std::string>& sources) : text_(text), sources_(sources) {}

  void table(const std::string& key) {
    const auto source = sources_.find(key);
    text_ += fmt::format("\n[{}]\nsource = {}\n", key, quoted(source == sources_.end() ? "" : source->second));
  }
  bool optional_table(const std::string& key, bool known) {
    if (known) table(key);
    return known;
  }
  void number(const std::string& key, double value) { text_ += key + " = " + literal(value) + "\n"; }
  void optional_number(const std::string& key, double value, double omitted = 0) {
    if (value != omitted) number(key, value);
  }
  void optional_flag(const std::string& key, bool value) {
    if (value) text_ += key + " = true\n";
  }
  template <class Column>
  void column(const std::string& key, const Column& column) {
    text_ += key + " = [";
    for (std::size_t k = 0; k < column.size; ++k) {
      if (k % 10 == 0 && column.size > 10)
        text_ += k == 0 ? "\n  " : ",\n  ";
      else if (k > 0)
        text_ += ", ";
      text_ += literal(column[k]);
    }
    text_ += column.size > 10 ? ",\n]\n" : "]\n";
  }
  template <class Column>
  void optional_column(const std::string& key, const Column& values) {
    if (values.size > 0) column(key, values);
  }

 private:
  std::string& text_;
  const std::map<std::string, std::string>& sources_;
};

}  // namespace

std::string cell_text(const CellFile& file) {
  std::string text = fmt::format("name = {}\nchemistry = {}\nsource = {}\n", quoted(file.name), quoted(file.chemistry),
                                 quoted(file.source));
  Writer writer(text, file.sources);
  visit_cell(writer, file.parameters);
  visit_pulses(writer, file.pulses);
  for (const TemperatureTable& at : file.at_temperature) {
    text += "\n[[at_temperature]]\n";
    writer.number("temperature_c", at.temperature_c);
    visit_rc(writer, at.rc);
  }
  for (const model::MechanismSetting& setting : file.mechanisms) {
    const model::MechanismInfo& info = model::catalogue[setting.index];
    const std::string name = table_of(info);
    text += fmt::format("\n[{}]\n", name);
    if (const auto source = file.sources.find(name); source != file.sources.end())
      text += fmt::format("source = {}\n", quoted(source->second));
    for (std::size_t k = 0; k < info.parameters; ++k) {
      const std::string key(info.parameter[k].name);
      writer.number(key, setting.value[k]);
      writer.optional_number(key + "_std", setting.deviation[k]);
    }
  }
  const auto source = file.sources.find("healthy");
  return text + healthy_text(file.healthy, source == file.sources.end() ? "" : source->second);
}

std::string table_of(const model::MechanismInfo& mechanism) {
  return (mechanism.domain == model::Domain::instrument ? "instrument." : "mechanism.") + std::string(mechanism.id);
}

std::string range_of(const model::Parameter& parameter, double capacity_ah) {
  return fmt::format("{:g} to {:g}{}", parameter.lower(capacity_ah), parameter.upper(capacity_ah),
                     parameter.unit == "1" ? "" : " " + std::string(parameter.unit));
}

void put_mechanism(CellFile& file, const model::MechanismSetting& setting) {
  const auto at = std::find_if(file.mechanisms.begin(), file.mechanisms.end(),
                               [&](const auto& m) { return m.index >= setting.index; });
  if (at != file.mechanisms.end() && at->index == setting.index)
    *at = setting;
  else
    file.mechanisms.insert(at, setting);
}

namespace {

/// Returns true if all strengths are neutral.
bool has_no_effect(const model::MechanismSetting& setting) {
  const model::MechanismInfo& info = model::catalogue[setting.index];
  bool neutral = true;
  for (std::size_t k = 0; k < info.parameters; ++k) {
    const model::Parameter& p = info.parameter[k];
    if (p.role == model::Role::strength && setting.value[k] != p.neutral) neutral = false;
  }
  return neutral;
}

}  // namespace

std::vector<model::MechanismSetting> on_board(const std::vector<model::MechanismSetting>& mechanisms) {
  std::vector<model::MechanismSetting> acting;
  for (const model::MechanismSetting& m : mechanisms) {
    if (model::catalogue[m.index].on_board && !(model::catalogue[m.index].states > 0 && has_no_effect(m)))
      acting.push_back(m);
  }
  return acting;
}

void reject_if_fpu_needed(const CellFile& file) {
  const std::vector<model::MechanismSetting> acting = on_board(file.mechanisms);
  for (const model::MechanismSetting& m : acting) {
    const model::MechanismInfo& info = model::catalogue[m.index];
    if (info.needs_fpu)
      throw BadInput(
          file.path, 1,
          fmt::format("'{}' cannot be computed in fixed point, expected a cell without it or arithmetic in float",
                      table_of(info)));
  }
  if (!model::fits_fixed_point(file.parameters, acting))
    throw BadInput(
        file.path, 1,
        "rc.c1_f is above 100000 F, or the mechanisms make a resistance or an activation energy too large or "
        "too small for fixed point, expected arithmetic in float");
}

namespace {

/// Name, chemistry, source.
void read_identity(TomlTable& top, CellFile& file) {
  file.name = top.text("name");
  constexpr const char* allowed = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-.";
  if (file.name.empty() || file.name.find_first_not_of(allowed) != std::string::npos)
    top.reject("name", "letters, digits, '_', '-' and '.'");
  file.chemistry = top.text("chemistry");
  file.source = top.text("source");
}

/// One [[at_temperature]].
TemperatureTable read_temperature_table(TomlTable& table, const CellFile& file) {
  constexpr double lowest_c = -60, highest_c = 100;
  TemperatureTable at;
  at.temperature_c = table.number("temperature_c");
  Reader rc(table);
  visit_rc(rc, at.rc);
  table.finish();
  model::CellParameters<> parameters = file.parameters;
  parameters.rc = at.rc;
  const model::CellFault fault = model::first_fault(parameters);
  if (fault.what != nullptr && std::string_view(fault.key).starts_with("rc.")) {
    throw BadInput(file.path, table.line(),
                   fmt::format("'at_temperature.{}' at {:g} degrees C is out of range, expected {}",
                               std::string_view(fault.key).substr(3), at.temperature_c, fault.what));
  }
  const bool ascends = file.at_temperature.empty() || at.temperature_c > file.at_temperature.back().temperature_c;
  if (!(at.temperature_c > lowest_c && at.temperature_c < highest_c) || !ascends) {
    throw BadInput(
        file.path, table.line(),
        fmt::format(
            "'at_temperature.temperature_c' is out of range, expected temperatures that ascend, {} to {} degrees C",
            lowest_c, highest_c));
  }
  return at;
}

/// 0 stands for a missing rating, so a file that states 0 would be read as one that rates nothing.
void reject_pulses_that_rate_nothing(TomlTable& top, const CellFile& file) {
  if (!top.has("pulses")) return;
  TomlTable table = top.table("pulses");
  for (const char* key : {"charge_10s_a", "charge_30s_a", "discharge_10s_a", "discharge_30s_a"}) {
    if (table.has(key) && table.number(key) == 0)
      throw BadInput(file.path, table.line(key),
                     fmt::format("'pulses.{}' is 0, expected a current, or no such key", key));
  }
  if (!file.pulses.stated())
    throw BadInput(
        file.path, table.line(),
        "'pulses' rates no current, expected charge_10s_a, charge_30s_a, discharge_10s_a or discharge_30s_a");
}

/// Each parameter of a mechanism is within its bounds here.
void reject_impossible_ocv(const TomlTable& top, const CellFile& file) {
  const std::optional<model::ImpossibleOcv> bad = model::first_impossible_ocv(file.parameters, file.mechanisms);
  if (!bad) return;
  const bool too_far = !(std::abs(bad->shift_v) <= model::most_ocv_shift_v);
  throw BadInput(
      file.path, top.line("mechanism"),
      fmt::format("at {:.0f} % and {:g} degrees C the mechanisms together {}", 100 * bad->soc, bad->temperature_c,
                  too_far ? fmt::format("move the voltage at rest by {:.2f} V, expected at most {:g} V", bad->shift_v,
                                        model::most_ocv_shift_v)
                          : fmt::format("put the charge branch {:.1f} mV below the discharge branch, expected above it",
                                        -1'000 * bad->gap_v)));
}

}  // namespace

CellFile parse_cell(const std::string& text, const std::string& path) {
  CellFile file;
  file.path = path;
  file.text = text;
  file.hash = static_cast<std::uint32_t>(std::stoul(sha256(text).substr(0, 8), nullptr, 16));

  TomlTable top = TomlTable::parse(text, path, "a cell file");
  read_identity(top, file);
  Reader reader(top, file.sources);
  visit_cell(reader, file.parameters);
  visit_pulses(reader, file.pulses);
  reader.finish();
  for (TomlTable& table : top.tables("at_temperature"))
    file.at_temperature.push_back(read_temperature_table(table, file));
  if (top.has("healthy")) {
    TomlTable healthy = top.table("healthy");
    file.sources["healthy"] = healthy.text("source");
    file.healthy = read_healthy(healthy);
  }
  for (const char* kind : {"mechanism", "instrument"}) top.has(kind);  // known; read once the capacity is checked
  top.finish();

  reject_pulses_that_rate_nothing(top, file);
  for (const model::CellFault& fault :
       {model::first_fault(file.parameters), model::first_fault(file.pulses, file.parameters.limits)}) {
    if (fault.what == nullptr) continue;
    throw BadInput(path, top.line(fault.key, fault.index),
                   std::string("'") + fault.key + "' is out of range, expected " + fault.what);
  }
  read_mechanisms(top, file);
  reject_impossible_ocv(top, file);
  return file;
}

std::string cell_names() {
  std::string names;
  for (const BuiltInCell& cell : built_in_cells()) names += (names.empty() ? "" : ", ") + cell.name;
  return names;
}

CellFile read_cell(const std::string& name_or_path) {
  for (const BuiltInCell& cell : built_in_cells()) {
    if (cell.name == name_or_path) return parse_cell(cell.text, cell.name);
  }
  if (name_or_path.find('/') == std::string::npos && !std::filesystem::exists(name_or_path)) {
    throw BadInput(name_or_path, 1, "no such cell, expected a cell file or one of: " + cell_names());
  }
  return parse_cell(read_file(name_or_path), name_or_path);
}

}  // namespace bms::files
