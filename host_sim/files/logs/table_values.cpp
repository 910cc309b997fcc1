// What the first line of values shows, and the sentence about all that was detected.
#include <algorithm>
#include <cctype>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "files/logs/column_options.hpp"
#include "files/logs/number.hpp"
#include "files/logs/table_layout.hpp"
#include "files/logs/time_text.hpp"

namespace bms::files {

namespace {

constexpr std::size_t longest_quote = 40;  ///< characters

bool has_letter_only(std::string_view text) {
  return !text.empty() && std::none_of(text.begin(), text.end(), [](unsigned char c) { return std::isdigit(c) != 0; });
}

/// "3,3" but not "1,234.5".
bool has_decimal_comma(std::string_view text) {
  const auto commas = std::count(text.begin(), text.end(), ',');
  return commas == 1 && text.find('.') == std::string_view::npos && text.find(':') == std::string_view::npos;
}

/// Unit of a number that can only be a time since 1970, between 2001 and 2096; nullptr for others.
const char* epoch_unit(std::string_view text) {
  const auto value = number(text);
  const auto within = [&](double unit) { return *value >= 1e9 * unit && *value < 4e9 * unit; };
  if (!value) return nullptr;
  if (within(1)) return "s";
  if (within(1e3)) return "ms";
  return within(1e6) ? "us" : nullptr;
}

/// The column with the date of times of day: it is called so, and its first value is a date.
std::optional<std::size_t> day_column(const TableLayout& layout, const std::vector<std::string_view>& fields,
                                      bool day_first) {
  constexpr std::string_view names = "|date|datum|day|";
  for (const std::size_t k : layout.unused) {
    const bool named = names.find("|" + normalised(layout.headings[k]) + "|") != std::string_view::npos;
    if (named && k < fields.size() && day_of_text_s(fields[k], day_first)) return k;
  }
  return std::nullopt;
}

std::string separator_name(char separator) {
  if (separator == '\t') return "tab";
  return fmt::format("'{}'", separator);
}

std::string column_text(const SourceColumn& column, bool base_units) {
  std::string text = name_of(column.target) + " from " + in_quotes(column.heading);
  if (column.target.quantity == Quantity::state) return text + " (D discharges)";
  if (column.clock) return text + " as h:mm:ss or a date";
  if (!column.unit.empty()) return text + " in " + unit_name(column.target.quantity, column.unit);
  return base_units ? text + " without a unit, taken as " + std::string(units_of(column.target.quantity)).substr(0, 1)
                    : text;
}

}  // namespace

std::string in_quotes(std::string_view text) {
  std::string out;
  for (const char c : text.substr(0, longest_quote)) out += c >= ' ' && c <= '~' ? c : '?';
  return "'" + out + (text.size() > longest_quote ? "..." : "") + "'";
}

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
  while (!text.empty() && (text.back() == ' ' || text.back() == '\t' || text.back() == '\r')) text.remove_suffix(1);
  if (text.size() >= 2 && text.front() == '"' && text.back() == '"') text = text.substr(1, text.size() - 2);
  return text;
}

std::vector<std::string_view> split(std::string_view line, char separator) {
  std::vector<std::string_view> parts;
  const bool quotes = line.find('"') != std::string_view::npos;
  std::size_t begin = 0;
  bool quoted = false;
  for (std::size_t k = 0; k <= line.size(); ++k) {
    if (k < line.size() && quotes && line[k] == '"') quoted = !quoted;
    if (k < line.size() && (quoted || line[k] != separator)) continue;
    parts.push_back(trimmed(line.substr(begin, k - begin)));
    begin = k + 1;
  }
  return parts;
}

bool settle(TableLayout& layout, std::string_view line, const std::string& path, std::size_t number,
            const ReadOptions& options) {
  const std::vector<std::string_view> fields = split(line, layout.separator);
  const auto field = [&](const SourceColumn& c) { return c.index < fields.size() ? fields[c.index] : ""; };
  const bool units = std::all_of(layout.columns.begin(), layout.columns.end(), [&](const SourceColumn& c) {
    const Heading heading = heading_of("x (" + std::string(field(c)) + ")");
    return field(c).empty() || scale_of(c.target.quantity, field(c)) || scale_of(c.target.quantity, heading.unit) ||
           (c.target.quantity == Quantity::state && has_letter_only(field(c)));
  });
  const SourceColumn* time = layout.find(Quantity::time);
  if (units && scale_of(Quantity::time, field(*time))) {
    for (SourceColumn& column : layout.columns) {
      const bool stated = stated_unit(options.unit, column.target).has_value();
      if (stated || field(column).empty() || column.target.quantity == Quantity::state) continue;
      column.unit = field(column);
      column.scale = *scale_of(column.target.quantity, column.unit);
    }
    layout.own = false;
    return true;
  }
  for (SourceColumn& column : layout.columns) {
    const std::string_view value = field(column);
    if (column.target.quantity == Quantity::time && (clock_s(value) || date_s(value, options.day_first)))
      column.clock = true;
    else if (layout.separator != ',' && has_decimal_comma(value))
      layout.decimal_comma = true;
  }
  time = layout.find(Quantity::time);
  if (clock_s(field(*time)) && !layout.step) layout.day = day_column(layout, fields, options.day_first);
  const bool in_seconds = layout.format->name == "arbin";  // Test_Time without a unit, in every version of its export
  const bool has_unit = !time->unit.empty() || target_of(time->heading).has_value() || in_seconds;
  if (!has_unit && !time->clock && epoch_unit(field(*time))) {
    SourceColumn& column = *std::find_if(layout.columns.begin(), layout.columns.end(),
                                         [&](const SourceColumn& c) { return c.target == time->target; });
    const char* const unit = epoch_unit(field(*time));
    column.scale = *scale_of(Quantity::time, unit);
    column.unit = std::string(unit) + " of the epoch";
    return false;
  }
  const bool named = std::any_of(options.map.begin(), options.map.end(),
                                 [](const std::string& text) { return text.starts_with("time_s="); });
  if (!has_unit && !time->clock && !named) {
    throw BadInput(path, number,
                   fmt::format("the times {} in column {} have no unit, expected --unit time_s=s or another of: {}",
                               in_quotes(field(*time)), in_quotes(time->heading), units_of(Quantity::time)));
  }
  return false;
}

std::string with_units(std::string_view above, std::string_view headings, std::string_view units, char separator) {
  std::vector<std::string_view> names = split(headings, separator);
  const std::vector<std::string_view> below = split(units, separator), first = split(above, separator);
  if (names.size() != below.size()) return {};
  const bool dated = rank_of(Quantity::time, heading_of(first[0]).base) >= 0 && first.size() == names.size();
  if (dated) names[0] = first[0];
  std::string line;
  bool time = dated;
  for (std::size_t k = 0; k < names.size(); ++k) {
    const bool number = std::any_of(below[k].begin(), below[k].end(), [](char c) { return c >= '0' && c <= '9'; });
    if (number) return {};
    time = time || scale_of(Quantity::time, below[k]);
    if (k > 0) line += separator;
    line += std::string(names[k]) + (below[k].empty() ? "" : " (" + std::string(below[k]) + ")");
  }
  return time ? line : std::string{};
}

std::optional<LongColumns> long_columns(const std::vector<std::string>& headings) {
  const auto named = [&](std::string_view names) -> std::optional<std::size_t> {
    for (std::size_t k = 0; k < headings.size(); ++k) {
      const std::string name = normalised(headings[k]);
      if (!name.empty() && names.find("|" + name + "|") != std::string_view::npos) return k;
    }
    return std::nullopt;
  };
  const auto entity = named("|entity id|entity|"), state = named("|state|value|"),
             time = named("|last changed|last updated|time|timestamp|");
  if (!entity || !state || !time) return std::nullopt;
  return LongColumns{*entity, *state, *time};
}

std::string text_of(const TableLayout& layout, const ReadOptions& options, const std::string& encoding) {
  std::string text(layout.format->title);
  if (!encoding.empty()) text += ", " + encoding;
  text += ", " + separator_name(layout.separator) + " separated";
  if (layout.day) text += "; date from " + in_quotes(layout.headings[*layout.day]);
  if (layout.step) text += "; steps by " + in_quotes(layout.headings[*layout.step]) + ", one after the other";
  if (layout.decimal_comma) text += ", decimal comma";
  constexpr std::size_t most_named = 12;
  for (std::size_t k = 0; k < std::min(most_named, layout.columns.size()); ++k)
    text += "; " + column_text(layout.columns[k], layout.format->base_units);
  if (layout.columns.size() > most_named) text += fmt::format("; and {} more", layout.columns.size() - most_named);
  if (options.sign == CurrentSign::discharge_positive) return text + "; a discharge is positive, inverted";
  if (layout.find(Quantity::state) != nullptr) return text + "; the sign is that of the state";
  return text + "; > 0 charges";
}

}  // namespace bms::files
