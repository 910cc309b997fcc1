// Tables and charts of a report, independent of HTML.
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace bms::files {

/// One cell of a table: a text, or a number and the number of the paper.
struct PageCell {
  std::string text;  ///< as shown; a number with its digits
  std::optional<double> value, paper;
};
inline PageCell text_cell(const std::string& text) { return {text, {}, {}}; }

struct PageTable {
  std::string id;  ///< "table4"
  std::string title;
  std::vector<std::string> head;
  std::vector<std::vector<PageCell>> rows;  ///< the first cell names the row
  std::string note;                         ///< differences from the paper, and why
};

struct PageChart {
  std::string title;
  std::vector<std::string> labels;  ///< one for each column
  std::vector<double> time_s;
  std::vector<std::vector<double>> columns;         ///< NaN: no value
  std::vector<std::vector<double>> half_band = {};  ///< empty, or for each column half the width of a band; empty: none
  std::string x_title = {};                         ///< what time_s has instead of the time; empty: the time
  std::vector<std::string> right = {};              ///< labels that belong to an axis of their own, on the right
};

struct PageContent {
  std::string title, statement;
  std::vector<std::string> warnings;
  std::vector<PageTable> tables;
  std::vector<PageChart> charts;
};

}  // namespace bms::files
