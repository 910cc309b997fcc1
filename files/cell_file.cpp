#include "files/cell_file.hpp"

#include <algorithm>
#include <charconv>
#include <optional>
#include <set>
#include <sstream>

#include <fmt/format.h>
namespace bms::files {
/// toml++ asserts on some files that it then refuses, and with NDEBUG lets the compiler rely on it: what it did not
/// expect is a refusal here.
struct ParserGaveUp {};
[[noreturn]] inline void parser_gave_up() { throw ParserGaveUp{}; }
}  // namespace bms::files
#undef NDEBUG
#define TOML_ASSERT(expr) (static_cast<bool>(expr) ? static_cast<void>(0) : ::bms::files::parser_gave_up())
#include <toml++/toml.h>

#include "files/bad_input.hpp"
#include "files/cell_fields.hpp"
#include "files/text_file.hpp"

namespace bms::files {

namespace {

/// Bytes beyond ASCII, and ~, as ~ and two hexadecimal digits: what toml++ 3.3 does with some of them outside of texts
/// and comments is anything.
std::string in_ascii(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '~' || static_cast<unsigned char>(c) >= 0x80)
      out += fmt::format("~{:02X}", static_cast<unsigned char>(c));
    else
      out += c;
  }
  return out;
}
/// As it was, of a text that in_ascii() has written.
std::string from_ascii(const std::string& ascii) {
  std::string out;
  for (std::size_t k = 0; k < ascii.size(); ++k) {
    unsigned byte = 0;
    const bool coded = ascii[k] == '~' && k + 2 < ascii.size() &&
                       std::from_chars(&ascii[k + 1], &ascii[k + 1] + 2, byte, 16).ptr == &ascii[k + 1] + 2;
    out += coded ? static_cast<char>(byte) : ascii[k];
    if (coded) k += 2;
  }
  return out;
}

/// One table of the file, read key by key; at the end every key must have been read.
class Table {
 public:
  Table(const toml::table& table, std::string file, std::string name)
      : table_(table), file_(std::move(file)), name_(std::move(name)) {}

  std::string text(const std::string& key) {
    const toml::node& node = required(key, "a text");
    const auto value = node.value<std::string>();
    if (!node.is_string() || !value) refuse(node, key, "a text");
    return from_ascii(*value);
  }

  double number(const std::string& key) {
    const toml::node& node = required(key, "a number");
    return number_of(node, key);
  }

  bool flag(const std::string& key) {
    const toml::node& node = required(key, "true or false");
    if (!node.is_boolean()) refuse(node, key, "true or false");
    return *node.value<bool>();
  }

  template <class Column>
  void column(const std::string& key, Column& into) {
    const toml::node& node = required(key, "a list of numbers");
    const toml::array* list = node.as_array();
    if (list == nullptr) refuse(node, key, "a list of numbers");
    if (list->size() > into.value.size())
      refuse(node, key, "at most " + std::to_string(into.value.size()) + " numbers");
    for (const toml::node& entry : *list) into.push_back(number_of(entry, key));
  }

  const toml::node& node(const std::string& key) const { return *table_.get(key); }

  bool has(const std::string& key) {
    read_.insert(key);
    return table_.contains(key);
  }

  /// [[key]], as often as it stands there; none is none.
  std::vector<Table> tables(const std::string& key) {
    std::vector<Table> all;
    if (!has(key)) return all;
    const toml::node& node = *table_.get(key);
    const toml::array* list = node.as_array();
    if (list == nullptr || !list->is_array_of_tables()) refuse(node, key, "tables, [[" + key + "]]");
    for (const toml::node& entry : *list) all.emplace_back(*entry.as_table(), file_, full(key));
    return all;
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
        throw BadInput(file_, node.source().begin.line,
                       "unknown key '" + full(std::string(key.str())) + "', expected one of: " + expected());
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
    if (node == nullptr)
      throw BadInput(file_, std::max<std::size_t>(table_.source().begin.line, 1),
                     "'" + full(key) + "' is missing, expected " + expected);
    return *node;
  }

  double number_of(const toml::node& node, const std::string& key) const {
    const auto value = node.value<double>();  // none for an integer that no double holds
    if (!node.is_number() || !value) refuse(node, key, "a number");
    return *value;
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

/// [mechanism.*] and [instrument.*]. A mechanism's parameters are its table's keys.
void read_mechanisms(Table& top, CellFile& file) {
  const double capacity_ah = file.parameters.capacity_ah;
  for (const char* kind : {"mechanism", "instrument"}) {
    if (!top.has(kind)) continue;
    Table group = top.table(kind);
    for (std::size_t index = 0; index < model::mechanism_count; ++index) {
      const model::MechanismInfo& info = model::catalogue[index];
      const std::string id(info.id), name = table_of(info);
      if (!name.starts_with(kind) || !group.has(id)) continue;
      Table table = group.table(id);
      if (table.has("source")) file.sources[name] = table.text("source");
      model::MechanismSetting setting = model::default_setting(index, capacity_ah);
      for (std::size_t k = 0; k < info.parameters; ++k) {
        const std::string key(info.parameter[k].name), deviation = key + "_std";
        if (table.has(key)) setting.value[k] = table.number(key);
        if (table.has(deviation)) setting.deviation[k] = table.number(deviation);
      }
      table.finish();
      if (const std::size_t k = model::first_fault(setting, capacity_ah); k < info.parameters) {
        const std::string key(info.parameter[k].name);
        const bool deviates = setting.value[k] >= info.parameter[k].lower(capacity_ah) &&
                              setting.value[k] <= info.parameter[k].upper(capacity_ah);
        const std::string at = deviates ? key + "_std" : key;
        throw BadInput(file.path, table.node(at).source().begin.line,
                       fmt::format("'{}.{}' is out of range, expected {}", name, at,
                                   deviates ? "0 or more" : range_of(info.parameter[k], capacity_ah)));
      }
      put_mechanism(file, setting);
    }
    group.finish();
  }
}

/// Line of the entry that a fault is about.
std::size_t line_of(const toml::table& root, const model::CellFault& fault) {
  const auto node = root.at_path(fault.key);
  if (!node) return 1;
  if (const toml::array* list = node.as_array(); list != nullptr && fault.index < list->size())
    return (*list)[fault.index].source().begin.line;
  return node.node()->source().begin.line;
}

class Reader {
 public:
  /// Of one table alone.
  explicit Reader(Table& table) : top_(table) {}
  Reader(Table& top, std::map<std::string, std::string>& sources) : top_(top), sources_(&sources) {}

  void table(const std::string& key) {
    finish();
    inner_.emplace(top_.table(key));
    (*sources_)[key] = inner_->text("source");
  }
  void number(const std::string& key, double& into) { into = here().number(key); }
  void optional_number(const std::string& key, double& into) {
    if (here().has(key)) number(key, into);
  }
  void optional_flag(const std::string& key, bool& into) {
    if (here().has(key)) into = here().flag(key);
  }
  template <class Column>
  void column(const std::string& key, Column& into) {
    here().column(key, into);
  }
  template <class Column>
  void optional_column(const std::string& key, Column& into) {
    if (here().has(key)) column(key, into);
  }
  void finish() const {
    if (inner_) inner_->finish();
  }

 private:
  Table& here() { return inner_ ? *inner_ : top_; }

  Table& top_;
  std::optional<Table> inner_;
  std::map<std::string, std::string>* sources_ = nullptr;
};

class Writer {
 public:
  Writer(std::string& text, const std::map<std::string, std::string>& sources) : text_(text), sources_(sources) {}

  void table(const std::string& key) {
    const auto source = sources_.find(key);
    text_ += fmt::format("\n[{}]\nsource = {}\n", key, quoted(source == sources_.end() ? "" : source->second));
  }
  void number(const std::string& key, double value) { text_ += key + " = " + literal(value) + "\n"; }
  void optional_number(const std::string& key, double value) {
    if (value != 0) number(key, value);
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

  static std::string quoted(const std::string& text) {
    std::string out = "\"";
    for (const char c : text) {
      if (c == '"' || c == '\\') out += '\\';
      out += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
    }
    return out + "\"";
  }

 private:
  /// The shortest digits that give back the same double; a float in TOML needs a point or an exponent.
  static std::string literal(double value) {
    std::string text = fmt::format("{}", value);
    if (text.find_first_of(".en") == std::string::npos) text += ".0";
    return text;
  }

  std::string& text_;
  const std::map<std::string, std::string>& sources_;
};

}  // namespace

std::string cell_text(const CellFile& file) {
  std::string text = fmt::format("name = {}\nchemistry = {}\nsource = {}\n", Writer::quoted(file.name),
                                 Writer::quoted(file.chemistry), Writer::quoted(file.source));
  Writer writer(text, file.sources);
  visit_cell(writer, file.parameters);
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
      text += fmt::format("source = {}\n", Writer::quoted(source->second));
    for (std::size_t k = 0; k < info.parameters; ++k) {
      const std::string key(info.parameter[k].name);
      writer.number(key, setting.value[k]);
      writer.optional_number(key + "_std", setting.deviation[k]);
    }
  }
  return text;
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

std::vector<model::MechanismSetting> on_board(const std::vector<model::MechanismSetting>& mechanisms) {
  std::vector<model::MechanismSetting> acting;
  for (const model::MechanismSetting& m : mechanisms) {
    if (model::catalogue[m.index].on_board) acting.push_back(m);
  }
  return acting;
}

void reject_if_fpu_needed(const CellFile& file) {
  for (const model::MechanismSetting& m : on_board(file.mechanisms)) {
    const model::MechanismInfo& info = model::catalogue[m.index];
    if (info.needs_fpu)
      throw BadInput(
          file.path, 1,
          fmt::format("'{}' does not compute in fixed point, expected a cell without it or arithmetic in float",
                      table_of(info)));
  }
}

namespace {

/// The first line with which the parser gives up.
std::size_t line_given_up(const std::string& text) {
  std::size_t line = 1;
  for (std::size_t end = text.find('\n'); end != text.npos; end = text.find('\n', end + 1), ++line) {
    try {
      static_cast<void>(toml::parse(std::string_view(text).substr(0, end + 1)));
    } catch (const toml::parse_error&) {  // a value of several lines
    } catch (const ParserGaveUp&) {
      return line;
    }
  }
  return line;
}

}  // namespace

CellFile parse_cell(const std::string& text, const std::string& path) {
  CellFile file;
  file.path = path;
  file.text = text;
  file.hash = static_cast<std::uint32_t>(std::stoul(sha256(text).substr(0, 8), nullptr, 16));

  const auto binary = std::find_if(text.begin(), text.end(), [](char c) {
    return static_cast<unsigned char>(c) < ' ' && c != '\n' && c != '\r' && c != '\t';
  });
  if (binary != text.end())
    throw BadInput(path, static_cast<std::size_t>(1 + std::count(text.begin(), binary, '\n')),
                   "a character that no text has, expected a cell file in TOML");
  const std::string ascii = in_ascii(text.substr(text.starts_with("\xEF\xBB\xBF") ? 3 : 0));

  toml::table root;
  try {
    root = toml::parse(ascii);
  } catch (const toml::parse_error& error) {
    std::string what = from_ascii(std::string(error.description()));
    std::replace(what.begin(), what.end(), '\n', ' ');
    throw BadInput(path, std::max<std::size_t>(error.source().begin.line, 1), what + ", expected a cell file in TOML");
  } catch (const ParserGaveUp&) {
    throw BadInput(path, line_given_up(ascii), "the parser gives up on it, expected a cell file in TOML");
  }

  Table top(root, path, "");
  file.name = top.text("name");
  if (file.name.empty() ||
      file.name.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-.") !=
          std::string::npos) {
    top.refuse(*root.get("name"), "name", "letters, digits, '_', '-' and '.'");
  }
  file.chemistry = top.text("chemistry");
  file.source = top.text("source");
  model::CellParameters<>& p = file.parameters;
  Reader reader(top, file.sources);
  visit_cell(reader, p);
  reader.finish();
  for (Table& table : top.tables("at_temperature")) {
    TemperatureTable& at = file.at_temperature.emplace_back();
    at.temperature_c = table.number("temperature_c");
    Reader rc(table);
    visit_rc(rc, at.rc);
    table.finish();
    model::CellParameters<> there = p;
    there.rc = at.rc;
    const model::CellFault fault = model::first_fault(there);
    if (fault.what != nullptr && std::string_view(fault.key).starts_with("rc.")) {
      throw BadInput(path, line_of(root, {"at_temperature", file.at_temperature.size() - 1, ""}),
                     fmt::format("'at_temperature.{}' at {:g} degrees C is out of range, expected {}",
                                 std::string_view(fault.key).substr(3), at.temperature_c, fault.what));
    }
    if (!(at.temperature_c > -60 && at.temperature_c < 100) ||
        (file.at_temperature.size() > 1 && !(at.temperature_c > file.at_temperature.end()[-2].temperature_c))) {
      throw BadInput(
          path, line_of(root, {"at_temperature", file.at_temperature.size() - 1, ""}),
          "'at_temperature.temperature_c' is out of range, expected temperatures that ascend, -60 to 100 degrees C");
    }
  }
  for (const char* kind : {"mechanism", "instrument"})
    top.has(kind);  // known, and read when the capacity is known to be good
  top.finish();

  if (const model::CellFault fault = model::first_fault(p); fault.what != nullptr) {
    throw BadInput(path, line_of(root, fault),
                   std::string("'") + fault.key + "' is out of range, expected " + fault.what);
  }
  read_mechanisms(top, file);
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
