#include "files/logs/table_layout.hpp"

#include <algorithm>
#include <optional>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "files/logs/column_options.hpp"
#include "files/logs/time_text.hpp"
#include "files/text_file.hpp"

namespace bms::files {

namespace {

constexpr std::size_t most_preamble_lines = 300;  ///< before the header: an EC-Lab file has about 60

char separator_of(std::string_view line, const ReadOptions& options) {
  if (options.separator == "tab" || options.separator == "\\t") return '\t';
  if (!options.separator.empty()) return options.separator.front();
  if (line.find('\t') != std::string_view::npos) return '\t';
  return line.find(';') != std::string_view::npos ? ';' : ',';
}

/// Finds the header and assigns columns to quantities.
class HeaderFinder {
 public:
  HeaderFinder(std::string path, bool voltage, const ReadOptions& options)
      : path_(std::move(path)), voltage_(voltage), options_(options) {
    for (const std::string& text : options.map) maps_.push_back(assignment(text, "--map"));
    for (const std::string& text : options.unit) {
      const auto& [target, unit] = units_.emplace_back(assignment(text, "--unit"));
      if (scale_of(target.quantity, unit) || (target.quantity == Quantity::time && is_clock_unit(unit))) continue;
      throw BadInput("--unit", 1,
                     fmt::format("{} is not a unit of {}, expected one of: {}", in_quotes(unit), name_of(target),
                                 units_of(target.quantity)));
    }
    if (!options.format.empty() && log_format(options.format) == nullptr) {
      throw BadInput("--format", 1,
                     in_quotes(options.format) + " is not a format, expected one of: " + log_format_names());
    }
  }

  std::optional<TableLayout> header(std::string_view line, std::size_t number) const {
    TableLayout layout = headings_of(line);
    layout.long_table = long_columns(layout.headings);
    if (layout.long_table) {
      layout.format = log_format("csv");
      layout.decimal_comma = options_.decimal_comma;
      return layout;
    }
    if (!take_maps(layout)) return std::nullopt;
    if (own_names(layout)) return finished(std::move(layout), number);
    for (const LogFormat& format : log_formats()) {
      if (!options_.format.empty() && format.name != options_.format) continue;
      if (options_.format.empty() && !format.marks.empty() && !marked(format, layout)) continue;
      TableLayout tried = layout;
      tried.format = &format;
      tried.own = false;
      detect(tried);
      if (complete(tried)) return finished(std::move(tried), number);
    }
    return std::nullopt;
  }

  /// How many of time, current and voltage the line seems to name, whatever their units.
  int likeness(std::string_view line) const {
    TableLayout layout = headings_of(line);
    int named = 0;
    for (const Quantity quantity : {Quantity::time, Quantity::current, Quantity::voltage})
      named += column_of(layout, quantity).first.empty() ? 0 : 1;
    return named;
  }

  /// Says what the line lacks as a header.
  [[noreturn]] void refuse(std::string_view line, std::size_t number) const {
    TableLayout layout = headings_of(line);
    for (const auto& [target, column] : maps_) {
      if (heading_named(layout, column) || !group_of(column, layout.headings).empty()) continue;
      throw BadInput(path_, number,
                     fmt::format("no column {} in {}, expected the column that --map {} names", in_quotes(column),
                                 in_quotes(line), name_of(target)));
    }
    take_maps(layout);
    layout.format = format_of(layout);
    std::optional<Quantity> missing;
    for (const Quantity quantity : {Quantity::time, Quantity::current, Quantity::voltage}) {
      const auto [heading, target] = column_of(layout, quantity);
      if (heading.empty())
        missing = missing.value_or(quantity);
      else if (!missing && !has(layout, target) && !target_of(heading))
        refuse_unit(layout, heading, target, number);
    }
    const std::string name = name_of({missing.value_or(Quantity::voltage), 0});
    throw BadInput(path_, number,
                   fmt::format("no column '{}' in {}, expected a header with time_s, current_a, voltage_v, or with "
                               "names and units that are known; --map {}=COLUMN names it",
                               name, in_quotes(line), name));
  }

 private:
  /// The headings of a line. Separators at its end are no columns.
  TableLayout headings_of(std::string_view line) const {
    TableLayout layout;
    layout.separator = separator_of(line, options_);
    for (const std::string_view part : split(line, layout.separator)) layout.headings.emplace_back(part);
    while (layout.headings.size() > 1 && layout.headings.back().empty()) layout.headings.pop_back();
    return layout;
  }

  /// Throws if the unit of this heading is not known.
  void refuse_unit(const TableLayout& layout, const std::string& text, const Target& target, std::size_t number) const {
    const Heading heading = heading_of(text);
    const Quantity quantity = target.quantity;
    const bool cell = quantity == Quantity::cell_voltage;
    if (cell ? scale_of(quantity, heading.unit).has_value() : unit_known(layout, quantity, heading)) return;
    const std::string states = heading.unit.empty()
                                   ? "states no unit"
                                   : fmt::format("has the unit {}, which is not known", in_quotes(heading.unit));
    const std::string expected =
        cell ? "--unit v_*=UNIT for all cells with one of: " + std::string(units_of(quantity))
             : fmt::format("--unit {}=UNIT with one of: {}", name_of(target), units_of(quantity));
    throw BadInput(path_, number, fmt::format("column {} {}, expected {}", in_quotes(text), states, expected));
  }

  /// The heading that names this quantity, with or without a unit, and what it is: a pack's or a cell's voltage is a
  /// voltage, too. Without a heading its text is empty.
  static std::pair<std::string, Target> column_of(const TableLayout& layout, Quantity quantity) {
    for (const SourceColumn& c : layout.columns) {
      const bool voltage = c.target.quantity == Quantity::pack_voltage || c.target.quantity == Quantity::cell_voltage;
      if (c.target.quantity == quantity || (quantity == Quantity::voltage && voltage)) return {c.heading, c.target};
    }
    for (const std::string& heading : layout.headings) {
      const std::string base = heading_of(heading).base;
      const auto is = [&](Quantity q) { return rank_of(q, base) >= 0 || target_of(heading) == Target{q, 0}; };
      if (is(quantity)) return {heading, {quantity, 0}};
      if (quantity != Quantity::voltage) continue;
      if (is(Quantity::pack_voltage)) return {heading, {Quantity::pack_voltage, 0}};
      if (const std::size_t k = cell_number(Quantity::cell_voltage, base))
        return {heading, {Quantity::cell_voltage, k}};
    }
    return {};
  }

  /// The format whose marks the headings have; any table otherwise.
  static const LogFormat* format_of(const TableLayout& layout) {
    for (const LogFormat& format : log_formats()) {
      if (marked(format, layout)) return &format;
    }
    return log_format("csv");
  }

  /// Index of the heading with this text, or else with this name without its unit.
  static std::optional<std::size_t> heading_named(const TableLayout& layout, const std::string& column) {
    const auto& all = layout.headings;
    auto at = std::find(all.begin(), all.end(), column);
    if (at == all.end())
      at = std::find_if(all.begin(), all.end(), [name = normalised(column)](const std::string& heading) {
        return heading_of(heading).base == name;
      });
    if (at == all.end()) return std::nullopt;
    return static_cast<std::size_t>(at - all.begin());
  }

  /// Returns false if the line lacks a column that the user named.
  bool take_maps(TableLayout& layout) const {
    for (const auto& [target, column] : maps_) {
      const bool cells = target.quantity == Quantity::cell_voltage || target.quantity == Quantity::cell_temperature;
      if (cells && target.number == every_number) {
        const auto group = group_of(column, layout.headings);
        for (const auto& [number, index] : group) add(layout, index, {target.quantity, number});
        if (group.empty()) return false;
        continue;
      }
      const auto at = heading_named(layout, column);
      if (!at) return false;
      add(layout, *at, target);
    }
    return true;
  }

  /// Throws if another column has the name of one that is used: which of them is meant is not known.
  void refuse_same_names(const TableLayout& layout, std::size_t number) const {
    for (const SourceColumn& column : layout.columns) {
      for (std::size_t k = 0; k < layout.headings.size(); ++k) {
        if (k == column.index || normalised(layout.headings[k]) != normalised(column.heading)) continue;
        throw BadInput(
            path_, number,
            fmt::format("columns {} ({} and {}) have the same name, expected one of them", in_quotes(column.heading),
                        std::min(k, column.index) + 1, std::max(k, column.index) + 1));
      }
    }
  }

  void add(TableLayout& layout, std::size_t index, const Target& target) const {
    const Heading heading = heading_of(layout.headings[index]);
    SourceColumn column{index, target, layout.headings[index], heading.unit, {}, is_clock_unit(heading.unit)};
    if (target_of(layout.headings[index]) == target)
      column.unit.clear();
    else if (const auto scale = scale_of(target.quantity, heading.unit))
      column.scale = *scale;
    layout.columns.push_back(column);
  }

  static bool has(const TableLayout& layout, const Target& target) {
    return std::any_of(layout.columns.begin(), layout.columns.end(),
                       [&](const SourceColumn& c) { return c.target == target; });
  }

  static bool uses(const TableLayout& layout, std::size_t index) {
    return std::any_of(layout.columns.begin(), layout.columns.end(),
                       [&](const SourceColumn& c) { return c.index == index; });
  }

  /// Columns with the project's own names. Returns true if no other is needed.
  bool own_names(TableLayout& layout) const {
    const bool nothing_mapped = layout.columns.empty();
    for (std::size_t k = 0; k < layout.headings.size(); ++k) {
      const auto target = target_of(layout.headings[k]);
      if (!target || target->quantity == Quantity::state || (uses(layout, k) && !nothing_mapped)) continue;
      if (!has(layout, *target)) {
        add(layout, k, *target);
      } else if (nothing_mapped) {
        throw BadInput(path_, 1, "column " + in_quotes(layout.headings[k]) + " twice, expected each column once");
      }
    }
    const bool one_cell = std::any_of(maps_.begin(), maps_.end(),
                                      [](const auto& map) { return map.first.quantity == Quantity::voltage; });
    if (one_cell) {  // --map voltage_v=v_7: that cell of a pack, not the pack
      std::erase_if(layout.columns, [](const SourceColumn& c) {
        return c.target.quantity == Quantity::cell_voltage || c.target.quantity == Quantity::cell_temperature;
      });
    }
    layout.own = nothing_mapped;
    layout.format = log_format("csv");
    const bool app = format_of(layout)->cell_unit.size() > 0;  // its cells need no name from the user
    return complete(layout) && !app && (options_.format.empty() || options_.format == "csv");
  }

  static bool marked(const LogFormat& format, const TableLayout& layout) {
    return std::any_of(layout.headings.begin(), layout.headings.end(), [&](const std::string& heading) {
      const std::string name = normalised(heading);
      return !name.empty() && format.marks.find("|" + name + "|") != std::string_view::npos;
    });
  }

  /// True if values of this column have a known unit: in its heading, by the format, or by the user.
  bool unit_known(const TableLayout& layout, Quantity quantity, const Heading& heading) const {
    for (const auto& [target, unit] : units_) {
      if (target.quantity == quantity) return true;
    }
    if (scale_of(quantity, heading.unit)) return true;
    if (quantity == Quantity::time && !layout.format->time_unit.empty()) return true;
    if (quantity == Quantity::time) return heading.unit.empty() || is_clock_unit(heading.unit);
    if (quantity == Quantity::state) return true;
    return heading.unit.empty() &&
           (layout.format->base_units || scale_of(quantity, heading.base) || quantity == Quantity::temperature);
  }

  void detect(TableLayout& layout) const {
    std::vector<Quantity> wanted = {Quantity::time, Quantity::current, Quantity::voltage, Quantity::temperature,
                                    Quantity::pack_voltage};
    if (layout.format->state_column) wanted.push_back(Quantity::state);
    for (const Quantity quantity : wanted) {
      if (has(layout, {quantity, 0})) continue;
      int best = -1;
      std::size_t at = 0;
      for (std::size_t k = 0; k < layout.headings.size(); ++k) {
        const Heading heading = heading_of(layout.headings[k]);
        const int rank = uses(layout, k) ? -1 : rank_of(quantity, heading.base);
        if (rank < 0 || (best >= 0 && rank >= best) || !unit_known(layout, quantity, heading)) continue;
        best = rank;
        at = k;
      }
      if (best >= 0) add(layout, at, {quantity, 0});
    }
    if (!has(layout, {Quantity::time, 0})) detect_step_time(layout);
    for (const Quantity quantity : {Quantity::cell_voltage, Quantity::cell_temperature}) {
      for (std::size_t k = 0; k < layout.headings.size(); ++k) {
        const Heading heading = heading_of(layout.headings[k]);
        const Target target{quantity, cell_number(quantity, heading.base)};
        const bool unit = scale_of(quantity, heading.unit) || unit_without_heading(layout, target);
        if (target.number > 0 && !uses(layout, k) && !has(layout, target) && unit) add(layout, k, target);
      }
    }
    if (layout.count(Quantity::cell_voltage) == 0)
      std::erase_if(layout.columns, [](const auto& c) { return c.target.quantity == Quantity::cell_temperature; });
  }

  /// True if the user or the format says in which unit the readings of a cell are whose heading does not.
  bool unit_without_heading(const TableLayout& layout, const Target& target) const {
    const bool format = target.quantity == Quantity::cell_voltage && !layout.format->cell_unit.empty();
    return format || stated_unit(options_.unit, target).has_value();
  }

  /// The time within a step, of a table that also has the number of the step.
  void detect_step_time(TableLayout& layout) const {
    const auto named = [&](std::string_view names) -> std::optional<std::size_t> {
      for (std::size_t k = 0; k < layout.headings.size(); ++k) {
        const std::string base = heading_of(layout.headings[k]).base;
        if (!base.empty() && names.find("|" + base + "|") != std::string_view::npos && !uses(layout, k)) return k;
      }
      return std::nullopt;
    };
    const auto time = named("|step time|steptime|"), step = named("|step|step index|step id|step number|step no|");
    if (!time || !step || !unit_known(layout, Quantity::time, heading_of(layout.headings[*time]))) return;
    add(layout, *time, {Quantity::time, 0});
    layout.step = step;
  }

  bool complete(const TableLayout& layout) const {
    if (layout.find(Quantity::time) == nullptr || layout.find(Quantity::current) == nullptr) return false;
    return !voltage_ || layout.find(Quantity::voltage) != nullptr || layout.count(Quantity::cell_voltage) > 0 ||
           layout.find(Quantity::pack_voltage) != nullptr;
  }

  std::optional<TableLayout> finished(TableLayout layout, std::size_t number) const {
    refuse_same_names(layout, number);
    for (SourceColumn& column : layout.columns) {
      const Quantity q = column.target.quantity;
      const std::string_view unit = q == Quantity::time ? layout.format->time_unit : layout.format->cell_unit;
      if (!column.unit.empty() || unit.empty() || (q != Quantity::time && q != Quantity::cell_voltage)) continue;
      column.unit = unit;
      column.scale = scale_of(q, unit).value_or(Scale{});
    }
    for (const auto& [target, unit] : units_) {
      const auto scale = scale_of(target.quantity, unit);
      for (SourceColumn& column : layout.columns) {
        if (!holds_for(target, column.target)) continue;
        column.unit = unit;
        column.scale = scale.value_or(Scale{});
        column.clock = !scale;
        layout.own = false;
      }
    }
    std::sort(layout.columns.begin(), layout.columns.end(),
              [](const SourceColumn& a, const SourceColumn& b) { return a.index < b.index; });
    for (std::size_t k = 0, c = 0; k < layout.headings.size(); ++k) {
      while (c < layout.columns.size() && layout.columns[c].index < k) ++c;
      if (c == layout.columns.size() || layout.columns[c].index != k) layout.unused.push_back(k);
    }
    layout.decimal_comma = options_.decimal_comma;
    return layout;
  }

  std::string path_;
  bool voltage_;
  const ReadOptions& options_;
  std::vector<std::pair<Target, std::string>> maps_, units_;
};

}  // namespace

const SourceColumn* TableLayout::find(Quantity quantity) const {
  const auto at = std::find_if(columns.begin(), columns.end(),
                               [&](const SourceColumn& c) { return c.target.quantity == quantity; });
  return at == columns.end() ? nullptr : &*at;
}

std::size_t TableLayout::count(Quantity quantity) const {
  return static_cast<std::size_t>(std::count_if(columns.begin(), columns.end(),
                                                [&](const SourceColumn& c) { return c.target.quantity == quantity; }));
}

TableLayout find_header(TextLines& lines, const std::string& path, bool voltage, const ReadOptions& options) {
  const HeaderFinder finder(path, voltage, options);
  std::string first, previous, before;
  int most_named = 0;
  std::size_t first_number = 0;
  std::string_view line;
  for (std::size_t k = 0; k < most_preamble_lines && lines.next(line);) {
    const std::string_view content = trimmed(line);
    if (content.empty()) continue;
    if (auto layout = finder.header(content.front() == '#' ? std::string_view{} : line, lines.number())) return *layout;
    if (content.front() == '~' || content.front() == '#') continue;
    const std::string both = with_units(before, previous, line, separator_of(line, options));
    if (!both.empty()) {
      if (auto layout = finder.header(both, lines.number() - 1)) return *layout;
    }
    before = previous;
    previous = line;
    const int named = finder.likeness(line);
    if (first.empty() || named > most_named) {  // the line that is most like a header is the one to complain about
      first = line;
      first_number = lines.number();
      most_named = named;
    }
    ++k;
  }
  if (first.empty()) {
    if (lines.number() == 0) throw BadInput(path, 1, "the file is empty, expected a header line and rows");
    throw BadInput(path, lines.number(), "only comments, expected a header line and rows");
  }
  finder.refuse(first, first_number);
}

}  // namespace bms::files
