#include "files/logs/row_selection.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "files/logs/number.hpp"
#include "files/logs/table_layout.hpp"

namespace bms::files {

namespace {

struct Kind {
  const char* what;  ///< name of the option
  std::string_view names;
};
constexpr Kind step_kind{"steps",
                         "|step|step index|step id|step number|step no|step no.|step count|stepid|step / 1|ns|"
                         "step index / 1|step count / 1|"};
constexpr Kind cycle_kind{"cycles",
                          "|cycle|cycle index|cycle id|cycle number|cycle no|cycle no.|cyc#|cycle count|cycleid|"
                          "cycle c|cycle count / 1|"};

long bound(std::string_view text, const std::string& option) {
  const auto value = number(text);
  constexpr double most = 1e9;
  if (!value || std::isnan(*value) || *value != std::floor(*value) || std::abs(*value) > most)
    throw BadInput("--" + option, 1, in_quotes(text) + " is not a whole number, expected FROM:TO, for example 3:7");
  return static_cast<long>(*value);
}

}  // namespace

RowSelection::RowSelection(const ReadOptions& options, const std::vector<std::string>& headings,
                           const std::string& path, std::size_t line) {
  for (const auto& [kind, text] : {std::pair{step_kind, options.steps}, std::pair{cycle_kind, options.cycles}}) {
    if (text.empty()) continue;
    Range range{.what = kind.what, .heading = {}};
    const std::size_t colon = text.find(':');
    range.low = bound(text.substr(0, colon), kind.what);
    range.high = colon == std::string::npos ? range.low : bound(text.substr(colon + 1), kind.what);
    if (range.low > range.high)
      throw BadInput("--" + range.what, 1, in_quotes(text) + " ends before it begins, expected FROM:TO");
    const auto at = std::find_if(headings.begin(), headings.end(), [&, names = kind.names](const std::string& heading) {
      const std::string name = normalised(heading);
      return !name.empty() && names.find("|" + name + "|") != std::string_view::npos;
    });
    if (at == headings.end()) {
      throw BadInput(path, line,
                     fmt::format("no column with the number of the {}, expected one for --{}, as testers write it",
                                 range.what.substr(0, range.what.size() - 1), range.what));
    }
    range.column = static_cast<std::size_t>(at - headings.begin());
    range.heading = *at;
    ranges_.push_back(range);
  }
}

bool RowSelection::take(std::size_t column, std::string_view field) {
  for (Range& range : ranges_) {
    if (range.column != column) continue;
    const auto value = number(trimmed(field));
    if (!value || std::isnan(*value)) return false;
    range.now = std::lround(*value);
  }
  return true;
}

bool RowSelection::keeps() const {
  return std::all_of(ranges_.begin(), ranges_.end(),
                     [](const Range& range) { return range.low <= range.now && range.now <= range.high; });
}

std::optional<std::size_t> RowSelection::last_column() const {
  std::optional<std::size_t> last;
  for (const Range& range : ranges_) last = std::max(last.value_or(0), range.column);
  return last;
}

std::string RowSelection::text() const {
  std::string text;
  for (const Range& range : ranges_)
    text += fmt::format("; only {} {} to {} of {}", range.what, range.low, range.high, in_quotes(range.heading));
  return text;
}

}  // namespace bms::files
