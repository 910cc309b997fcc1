// A table of a TOML file, read key by key. What is missing, of the wrong type or unknown is rejected with one line
// `FILE:LINE: what is wrong, what was expected`.
#pragma once

#include <cstddef>
#include <memory>
#include <set>
#include <string>
#include <vector>

namespace bms::files {

class TomlTable {
 public:
  /// The top table of a file. path: for messages; expected: what the file should be, "a cell file". Throws BadInput.
  static TomlTable parse(const std::string& text, const std::string& path, const std::string& expected);

  // Values of a required key. Throw BadInput if the key is missing or has another type.
  std::string text(const std::string& key);
  double number(const std::string& key);
  bool flag(const std::string& key);
  std::vector<double> numbers(const std::string& key);
  std::vector<std::string> texts(const std::string& key);
  TomlTable table(const std::string& key);
  /// [[key]]: one element per table of that name; empty if the key is missing.
  std::vector<TomlTable> tables(const std::string& key);

  /// Returns true if the key is there, and marks it as known.
  bool has(const std::string& key);

  /// All keys, in alphabetical order.
  std::vector<std::string> keys() const;

  /// Rejects keys that were never asked for: a misspelt key would otherwise be ignored.
  void finish() const;

  /// Line of the table itself, 1 ...
  std::size_t line() const;
  /// Line of a value: "soc", "ocv.soc"; of its element `index` if it is a list that long. 1 if there is no such key.
  std::size_t line(const std::string& path, std::size_t index = 0) const;

  /// Throws BadInput at the line of the key: "'table.key' is not acceptable, expected ...".
  [[noreturn]] void reject(const std::string& key, const std::string& expected) const;

  const std::string& file() const;

 private:
  struct Node;
  explicit TomlTable(std::shared_ptr<const Node> node) : node_(std::move(node)) {}

  std::string full_name(const std::string& key) const;
  std::string known_keys() const;

  std::shared_ptr<const Node> node_;
  std::set<std::string> known_;
};

}  // namespace bms::files
