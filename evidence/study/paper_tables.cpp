#include "study/paper_tables.hpp"

#include <charconv>
#include <map>
#include <sstream>

#include <fmt/format.h>

#include "files/bad_input.hpp"

namespace bms::study {

namespace {

/// Fields of a line. Empty if a quote does not end.
std::vector<std::string> fields_of(const std::string& line) {
  std::vector<std::string> fields(1);
  bool quoted = false;
  for (const char c : line) {
    if (c == '"')
      quoted = !quoted;
    else if (c == ',' && !quoted)
      fields.emplace_back();
    else
      fields.back() += c;
  }
  return quoted ? std::vector<std::string>() : fields;
}

bool is_text_table(const std::string& name) { return !name.starts_with("table"); }

}  // namespace

PaperTable::PaperTable(const std::string& text, const std::string& path) {
  std::istringstream lines(text);
  std::size_t number = 0;
  for (std::string line; std::getline(lines, line);) {
    ++number;
    if (line.empty() || line.starts_with('#')) continue;
    const std::vector<std::string> fields = fields_of(line);
    if (columns_ == 0) {
      if (fields.size() < 2) throw files::BadInput(path, number, "one column, expected a header with two or more");
      columns_ = fields.size() - 1;
      continue;
    }
    if (fields.size() != columns_ + 1)
      throw files::BadInput(path, number,
                            fmt::format("{} fields, expected {} as in the header", fields.size(), columns_ + 1));
    std::vector<double>& row = rows_.emplace_back();
    for (std::size_t k = 1; k < fields.size(); ++k) {
      const char* const end = fields[k].data() + fields[k].size();
      double value = 0;
      if (const auto [stop, error] = std::from_chars(fields[k].data(), end, value); error != std::errc() || stop != end)
        throw files::BadInput(path, number, fmt::format("'{}' is not a number, expected a number", fields[k]));
      row.push_back(value);
    }
  }
  if (rows_.empty())
    throw files::BadInput(path, std::max<std::size_t>(number, 1), "no rows, expected a header and rows");
}

TextTable::TextTable(const std::string& text, const std::string& path) {
  std::istringstream lines(text);
  std::size_t number = 0;
  for (std::string line; std::getline(lines, line);) {
    ++number;
    if (line.empty() || line.starts_with('#')) continue;
    std::vector<std::string> fields = fields_of(line);
    if (fields.empty()) throw files::BadInput(path, number, "a quote without end, expected one more quote");
    if (head_.empty()) {
      head_ = std::move(fields);
      continue;
    }
    if (fields.size() != head_.size())
      throw files::BadInput(path, number,
                            fmt::format("{} fields, expected {} as in the header", fields.size(), head_.size()));
    rows_.push_back(std::move(fields));
  }
}

const TextTable& text_table(const char* name) {
  static const std::map<std::string, TextTable> tables = [] {
    std::map<std::string, TextTable> all;
    for (const PaperTableText& file : paper_table_texts()) {
      if (is_text_table(file.name))
        all.emplace(file.name, TextTable(file.text, "evidence/study/paper/" + file.name + ".csv"));
    }
    return all;
  }();
  return tables.at(name);
}

const PaperTable& paper_table(int number) {
  static const std::map<std::string, PaperTable> tables = [] {
    std::map<std::string, PaperTable> all;
    for (const PaperTableText& file : paper_table_texts()) {
      if (!is_text_table(file.name))
        all.emplace(file.name, PaperTable(file.text, "evidence/study/paper/" + file.name + ".csv"));
    }
    return all;
  }();
  return tables.at(fmt::format("table{}", number));
}

}  // namespace bms::study
