// Rows of a table by the numbers of steps and cycles that a tester writes.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "files/read_options.hpp"

namespace bms::files {

class RowSelection {
 public:
  /// Throws BadInput if the options are not "FROM:TO" or "NUMBER", or the headings have no such column.
  RowSelection(const ReadOptions& options, const std::vector<std::string>& headings, const std::string& path,
               std::size_t line);
  RowSelection() = default;

  /// A field of the row. Returns false if it should be a number and is not.
  bool take(std::size_t column, std::string_view field);
  /// Whether the row that was taken is wanted.
  bool keeps() const;
  /// The last column that is needed; nothing if all rows are wanted.
  std::optional<std::size_t> last_column() const;
  /// "steps 3 to 7", for the line about what was read.
  std::string text() const;

 private:
  struct Range {
    std::string what, heading;
    std::size_t column = 0;
    long low = 0, high = 0, now = 0;
  };
  std::vector<Range> ranges_;
};

}  // namespace bms::files
