// The tables of the paper (Energies 14 (2021) 6221), from evidence/study/paper/*.csv, compiled into the program.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace bms::study {

/// Numbers of a table. In the file the first line names the columns and the first column names the rows.
class PaperTable {
 public:
  /// Parses CSV with `,`; a line that starts with `#` is a comment. Throws BadInput; path: for messages.
  PaperTable(const std::string& text, const std::string& path);

  std::size_t rows() const { return rows_.size(); }
  std::size_t columns() const { return columns_; }
  /// Throws std::out_of_range.
  double at(std::size_t row, std::size_t column) const { return rows_.at(row).at(column); }

 private:
  std::size_t columns_ = 0;
  std::vector<std::vector<double>> rows_;
};

/// Rows of text. In the file the first line names the columns; a field with a comma is quoted.
class TextTable {
 public:
  /// Throws BadInput where a row has another number of fields than the header, or a quote does not end.
  TextTable(const std::string& text, const std::string& path);
  const std::vector<std::string>& head() const { return head_; }
  const std::vector<std::vector<std::string>>& rows() const { return rows_; }

 private:
  std::vector<std::string> head_;
  std::vector<std::vector<std::string>> rows_;
};

/// "statements", "errata" or "audit". Throws std::out_of_range for other names.
const TextTable& text_table(const char* name);

/// Table 1 and 4 to 9. Throws std::out_of_range for other numbers.
const PaperTable& paper_table(int number);

struct PaperTableText {
  std::string name;  ///< "table4"
  std::string text;
};
/// All files of evidence/study/paper.
const std::vector<PaperTableText>& paper_table_texts();

}  // namespace bms::study
