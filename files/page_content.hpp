// Tables and charts of a report, before they are a page.
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace bms::files {

/// One number of a table, and the paper's in its place.
struct PageCell {
  std::string text;  ///< what stands there; a number with its digits
  std::optional<double> value, paper;
};

struct PageTable {
  std::string id;  ///< "table4"
  std::string title;
  std::vector<std::string> head;
  std::vector<std::vector<PageCell>> rows;  ///< the first cell names the row
  std::string note;                         ///< where it differs from the paper, and why
};

struct PageChart {
  std::string title;
  std::vector<std::string> labels;  ///< of the columns after time
  std::vector<double> time_s;
  std::vector<std::vector<double>> columns;  ///< NaN: nothing there
};

struct PageContent {
  std::string title, statement;
  std::vector<std::string> warnings;
  std::vector<PageTable> tables;
  std::vector<PageChart> charts;
};

}  // namespace bms::files
