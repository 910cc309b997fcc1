#include "files/toml_table.hpp"

#include <algorithm>
#include <cctype>
#include <charconv>

#include <fmt/format.h>
namespace bms::files {
/// toml++ asserts on some malformed files before it rejects them; with NDEBUG it would let the compiler assume that the
/// assertion holds. Here a failed assertion rejects the file.
struct ParserAssertion {};
[[noreturn]] inline void parser_assertion() { throw ParserAssertion{}; }
}  // namespace bms::files
#undef NDEBUG
#define TOML_ASSERT(expr) (static_cast<bool>(expr) ? static_cast<void>(0) : ::bms::files::parser_assertion())
#include <toml++/toml.h>

#include "files/bad_input.hpp"

namespace bms::files {

struct TomlTable::Node {
  std::shared_ptr<const toml::table> document;  ///< owns `table`
  const toml::table* table;
  std::string file;
  std::string name;  ///< "" for the top table, "ocv", "claim.named"

  std::string full_name(const std::string& key) const { return name.empty() ? key : name + "." + key; }

  [[noreturn]] void reject(const toml::node& value, const std::string& key, const std::string& expected) const {
    throw BadInput(file, value.source().begin.line, "'" + full_name(key) + "' is not acceptable, expected " + expected);
  }

  /// A key of the table that differs from this one only in capital letters, '-' and '_'; empty if no key does.
  std::string alike_of(const std::string& key) const {
    const auto plain = [](std::string_view text) {
      std::string letters;
      for (const char c : text) {
        if (c != '_' && c != '-') letters += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
      }
      return letters;
    };
    for (const auto& [other, value] : *table) {
      if (plain(other.str()) == plain(key)) return std::string(other.str());
    }
    return "";
  }

  const toml::node& required(const std::string& key, const std::string& expected) const {
    const toml::node* value = table->get(key);
    if (value == nullptr) {
      const std::string alike = alike_of(key);
      throw BadInput(file, std::max<std::size_t>(table->source().begin.line, 1),
                     "'" + full_name(key) + "' is missing" + (alike.empty() ? "" : " ('" + alike + "' is there)") +
                         ", expected " + expected);
    }
    return *value;
  }

  double number(const toml::node& value, const std::string& key) const {
    const auto number = value.value<double>();  // nothing for an integer that a double cannot represent
    if (!value.is_number() || !number) reject(value, key, "a number");
    return *number;
  }

  std::string text(const toml::node& value, const std::string& key) const;

  const toml::array& list(const std::string& key, const std::string& expected) const {
    const toml::node& value = required(key, expected);
    if (!value.is_array()) reject(value, key, expected);
    return *value.as_array();
  }
};

namespace {

/// Writes ~ and bytes beyond ASCII as ~ and two hexadecimal digits: toml++ 3.3 has undefined behaviour for some of them
/// outside of strings and comments.
std::string to_ascii(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '~' || static_cast<unsigned char>(c) >= 0x80)
      out += fmt::format("~{:02X}", static_cast<unsigned char>(c));
    else
      out += c;
  }
  return out;
}

/// Inverse of to_ascii().
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

/// First line at which the parser's assertion fails.
std::size_t line_of_assertion(const std::string& text) {
  std::size_t line = 1;
  for (std::size_t end = text.find('\n'); end != text.npos; end = text.find('\n', end + 1), ++line) {
    try {
      static_cast<void>(toml::parse(std::string_view(text).substr(0, end + 1)));
    } catch (const toml::parse_error&) {  // the text ends within a value of several lines
    } catch (const ParserAssertion&) {
      return line;
    }
  }
  return line;
}

void reject_binary(const std::string& text, const std::string& path, const std::string& expected) {
  const auto binary = std::find_if(text.begin(), text.end(), [](char c) {
    return static_cast<unsigned char>(c) < ' ' && c != '\n' && c != '\r' && c != '\t';
  });
  if (binary != text.end()) {
    throw BadInput(path, static_cast<std::size_t>(1 + std::count(text.begin(), binary, '\n')),
                   "a control character, expected " + expected + " in TOML");
  }
}

}  // namespace

std::string TomlTable::Node::text(const toml::node& value, const std::string& key) const {
  const auto text = value.value<std::string>();
  if (!value.is_string() || !text) reject(value, key, "a text");
  return from_ascii(*text);
}

TomlTable TomlTable::parse(const std::string& text, const std::string& path, const std::string& expected) {
  reject_binary(text, path, expected);
  constexpr std::string_view byte_order_mark = "\xEF\xBB\xBF";
  const std::string ascii = to_ascii(text.substr(text.starts_with(byte_order_mark) ? byte_order_mark.size() : 0));
  try {
    const auto document = std::make_shared<const toml::table>(toml::parse(ascii));
    return TomlTable(std::make_shared<const Node>(Node{document, document.get(), path, ""}));
  } catch (const toml::parse_error& error) {
    std::string what = from_ascii(std::string(error.description()));
    std::replace(what.begin(), what.end(), '\n', ' ');
    throw BadInput(path, std::max<std::size_t>(error.source().begin.line, 1),
                   what + ", expected " + expected + " in TOML");
  } catch (const ParserAssertion&) {
    throw BadInput(path, line_of_assertion(ascii), "cannot be parsed, expected " + expected + " in TOML");
  }
}

std::string TomlTable::text(const std::string& key) {
  known_.insert(key);
  return node_->text(node_->required(key, "a text"), key);
}

double TomlTable::number(const std::string& key) {
  known_.insert(key);
  return node_->number(node_->required(key, "a number"), key);
}

bool TomlTable::flag(const std::string& key) {
  known_.insert(key);
  const toml::node& value = node_->required(key, "true or false");
  if (!value.is_boolean()) node_->reject(value, key, "true or false");
  return *value.value<bool>();
}

std::vector<double> TomlTable::numbers(const std::string& key) {
  known_.insert(key);
  std::vector<double> all;
  for (const toml::node& value : node_->list(key, "a list of numbers")) all.push_back(node_->number(value, key));
  return all;
}

std::vector<std::string> TomlTable::texts(const std::string& key) {
  known_.insert(key);
  std::vector<std::string> all;
  for (const toml::node& value : node_->list(key, "a list of texts")) all.push_back(node_->text(value, key));
  return all;
}

TomlTable TomlTable::table(const std::string& key) {
  known_.insert(key);
  const toml::node& value = node_->required(key, "a table");
  if (!value.is_table()) node_->reject(value, key, "a table");
  return TomlTable(
      std::make_shared<const Node>(Node{node_->document, value.as_table(), node_->file, node_->full_name(key)}));
}

std::vector<TomlTable> TomlTable::tables(const std::string& key) {
  std::vector<TomlTable> all;
  if (!has(key)) return all;
  const std::string expected = "tables, [[" + key + "]]";
  const toml::array& list = node_->list(key, expected);
  if (!list.is_array_of_tables()) node_->reject(list, key, expected);
  for (const toml::node& value : list) {
    all.push_back(TomlTable(
        std::make_shared<const Node>(Node{node_->document, value.as_table(), node_->file, node_->full_name(key)})));
  }
  return all;
}

bool TomlTable::has(const std::string& key) {
  known_.insert(key);
  return node_->table->contains(key);
}

std::vector<std::string> TomlTable::keys() const {
  std::vector<std::string> all;
  for (const auto& [key, value] : *node_->table) all.emplace_back(key.str());
  return all;
}

void TomlTable::finish() const {
  for (const auto& [key, value] : *node_->table) {
    const std::string name(key.str());
    if (known_.contains(name)) continue;
    throw BadInput(node_->file, value.source().begin.line,
                   "unknown key '" + full_name(name) + "', expected one of: " + known_keys());
  }
}

std::size_t TomlTable::line() const { return std::max<std::size_t>(node_->table->source().begin.line, 1); }

std::size_t TomlTable::line(const std::string& path, std::size_t index) const {
  const auto value = node_->table->at_path(path);
  if (!value) return 1;
  if (const toml::array* list = value.as_array(); list != nullptr && index < list->size())
    return (*list)[index].source().begin.line;
  return value.node()->source().begin.line;
}

void TomlTable::reject(const std::string& key, const std::string& expected) const {
  node_->reject(node_->required(key, expected), key, expected);
}

const std::string& TomlTable::file() const { return node_->file; }

std::string TomlTable::full_name(const std::string& key) const { return node_->full_name(key); }

std::string TomlTable::known_keys() const {
  std::string list;
  for (const std::string& key : known_) list += (list.empty() ? "" : ", ") + key;
  return list;
}

}  // namespace bms::files
