#include "files/committed_figures.hpp"

#include <cstdlib>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "files/text_file.hpp"

namespace bms::files {

namespace {

/// First and last position of the table between its comments.
std::pair<std::size_t, std::size_t> find_table(const std::string& text, const std::filesystem::path& readme,
                                               const std::string& name) {
  const std::string opening = "<!-- figures: " + name + " -->\n";
  const std::size_t begin = text.find(opening), end = text.find("<!-- end of figures -->", begin);
  if (begin == std::string::npos || end == std::string::npos)
    throw std::runtime_error("no figures '" + name + "' in " + readme.string());
  return {begin + opening.size(), end};
}

std::string without_spaces(const std::string& cell) {
  const std::size_t begin = cell.find_first_not_of(' '), end = cell.find_last_not_of(' ');
  return begin == std::string::npos ? "" : cell.substr(begin, end - begin + 1);
}

}  // namespace

CommittedFigures::CommittedFigures(const std::filesystem::path& readme, const std::string& name) {
  const std::string text = read_file(readme);
  const auto [begin, end] = find_table(text, readme, name);
  std::istringstream lines(text.substr(begin, end - begin));
  for (std::string line; std::getline(lines, line);) {
    std::istringstream cells(line);
    std::string before, what, figure;
    if (!std::getline(cells, before, '|') || !std::getline(cells, what, '|') || !std::getline(cells, figure, '|'))
      continue;
    char* rest = nullptr;
    const double value = std::strtod(figure.c_str(), &rest);
    if (rest != figure.c_str()) figures_[without_spaces(what)] = value;
  }
}

void replace_figures(const std::filesystem::path& readme, const std::string& name, const std::string& table) {
  std::string text = read_file(readme);
  const auto [begin, end] = find_table(text, readme, name);
  write_file(readme, text.replace(begin, end - begin, table));
}

}  // namespace bms::files
