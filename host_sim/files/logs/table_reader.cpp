#include "files/logs/table_reader.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "files/logs/long_table.hpp"
#include "files/logs/missing_reading.hpp"
#include "files/logs/number.hpp"
#include "files/logs/recording_columns.hpp"
#include "files/logs/row_groups.hpp"
#include "files/logs/row_selection.hpp"
#include "files/logs/row_times.hpp"
#include "files/logs/table_layout.hpp"
#include "measurement/recording_checks.hpp"

namespace bms::files {

using measurement::Recording;

namespace {

constexpr double first_epoch_ms = 9e11;  ///< no log in seconds begins there
constexpr std::size_t most_ignored_named = 10;

/// One column, in the order of the file.
struct FileColumn {
  std::vector<double>* into = nullptr;       ///< nullptr: not a number that is used
  std::vector<std::string>* text = nullptr;  ///< a column that is only kept
  const SourceColumn* source = nullptr;
  std::string name;
  bool sparse = false;  ///< a field may be empty without a warning
  bool read = false;    ///< a field was not empty
  std::size_t missing = 0, empty = 0, first_missing_line = 0;
};

class TableReader {
 public:
  TableReader(TextLines& lines, const std::string& path, const ReadOptions& options)
      : lines_(lines), options_(options) {
    recording_.path = path;
  }

  Recording read(VoltageColumn voltage) {
    layout_ = find_header(lines_, recording_.path, voltage == VoltageColumn::required, options_);
    if (layout_.long_table) return read_long_table(lines_, layout_, recording_.path, options_);
    selection_ = RowSelection(options_, layout_.headings, recording_.path, std::max<std::size_t>(lines_.number(), 1));
    assign_columns();
    bool first = true;
    while (next_line()) {
      if (first) {
        first = false;
        const bool units = settle(layout_, line_, recording_.path, lines_.number(), options_);
        name_unused();
        begin_times();
        if (units) continue;
        point_ = layout_.decimal_comma ? ',' : '.';
        reserve();
      }
      if (recording_.rows() == measurement::most_rows)
        refuse("more rows", fmt::format("at most {}: split the recording", measurement::most_rows));
      if (lines_.cut() && is_truncated()) break;
      row();
    }
    finish();
    return std::move(recording_);
  }

 private:
  [[noreturn]] void refuse(const std::string& what, const std::string& expected) const {
    throw BadInput(recording_.path, std::max<std::size_t>(lines_.number(), 1), what + ", expected " + expected);
  }

  /// The next line that is neither empty nor a comment.
  bool next_line() {
    while (lines_.next(line_)) {
      std::string_view content = line_;
      while (!content.empty() && (content.front() == ' ' || content.front() == '\t')) content.remove_prefix(1);
      if (!content.empty() && content.front() != '#') return true;
    }
    return false;
  }

  void assign_columns() {
    columns_.resize(layout_.headings.size());
    for (const SourceColumn& source : layout_.columns) {  // first all columns, because a list of them may move
      if (source.target.quantity != Quantity::state) column_of(recording_, source.target).edit();
    }
    for (const SourceColumn& source : layout_.columns) {
      FileColumn& column = columns_[source.index];
      column.source = &source;
      column.name = layout_.own ? name_of(source.target) : source.heading;
      column.sparse =
          source.target.quantity == Quantity::current_ref || source.target.quantity == Quantity::voltage_ref;
      if (source.target.quantity == Quantity::state)
        state_index_ = source.index;
      else
        column.into = &column_of(recording_, source.target).edit();
      last_used_ = std::max(last_used_, source.index);
    }
    for (const auto* list : {&recording_.cell_voltage_v, &recording_.cell_temperature_c}) {
      const Quantity q = list == &recording_.cell_voltage_v ? Quantity::cell_voltage : Quantity::cell_temperature;
      if (layout_.count(q) < list->size()) {
        refuse(fmt::format("{} columns of cells, the last has number {}", layout_.count(q), list->size()),
               "numbers from 1 on without a gap");
      }
    }
  }

  void begin_times() {
    const SourceColumn& time = *layout_.find(Quantity::time);
    times_.begin({.clock = time.clock,
                  .dated = layout_.day.has_value(),
                  .by_step = layout_.step.has_value(),
                  .day_first = options_.day_first});
    for (const auto& index : {layout_.day, layout_.step, selection_.last_column()})
      last_used_ = std::max(last_used_, index.value_or(0));
  }

  /// What bms simulate writes in addition to soc_ref, and no command needs.
  bool is_known_copy(const std::string& heading) const {
    return layout_.own && layout_.count(Quantity::soc_ref) > 0 && (heading == "soc" || heading == "voltage_std_v");
  }

  void name_unused() {
    if (options_.keep_all) {
      recording_.others.resize(layout_.unused.size());
      for (std::size_t k = 0; k < layout_.unused.size(); ++k) {
        recording_.others[k].name = layout_.headings[layout_.unused[k]];
        columns_[layout_.unused[k]].text = &recording_.others[k].text;
        last_kept_ = std::max(last_kept_, layout_.unused[k]);
      }
      return;
    }
    std::vector<std::string> unused;
    for (const std::size_t k : layout_.unused) {
      if (!is_known_copy(layout_.headings[k]) && k != layout_.day && k != layout_.step)
        unused.push_back(layout_.headings[k]);
    }
    std::string ignored;
    for (std::size_t k = 0; k < std::min(most_ignored_named, unused.size()); ++k)
      ignored += (ignored.empty() ? "" : ", ") + in_quotes(unused[k]);
    if (unused.size() > most_ignored_named) ignored += fmt::format(" and {} more", unused.size() - most_ignored_named);
    if (!ignored.empty()) recording_.warnings.push_back({"ignored_column", "columns not used: " + ignored});
  }

  void reserve() {
    const std::size_t rows = expected_rows(lines_.expected_bytes(), line_.size());
    for (const FileColumn& c : columns_) {
      if (c.into != nullptr) c.into->reserve(rows);
    }
  }

  /// The last line of a logger that lost its power: too few fields, or a number that breaks off.
  bool is_truncated() {
    const std::vector<std::string_view> fields = split(line_, layout_.separator);
    bool truncated = fields.size() < columns_.size() && fields.size() <= last_used_;
    for (const SourceColumn& source : layout_.columns) {
      if (source.index + 1 != fields.size() || columns_[source.index].into == nullptr || source.clock) continue;
      truncated =
          truncated || (!fields.back().empty() && !number(fields.back(), point_) && !is_missing_word(fields.back()));
    }
    if (truncated) {
      recording_.warnings.push_back(
          {"truncated_line", fmt::format("line {} is the last one and breaks off: it is not used", lines_.number())});
    }
    return truncated;
  }

  void row() {
    if (line_.find('"') != std::string_view::npos) return quoted_row();
    std::string_view fields = line_;
    const std::size_t needed = layout_.own ? columns_.size() : last_used_ + 1, taken = std::max(needed, last_kept_ + 1);
    for (std::size_t k = 0; k < taken; ++k) {
      const char* const found = static_cast<const char*>(std::memchr(fields.data(), layout_.separator, fields.size()));
      const bool last = k + 1 == taken;
      if (found == nullptr && k + 1 < needed) too_few(k + 1);
      if (found != nullptr && last && layout_.own && !is_empty_end({found + 1, fields.data() + fields.size()}))
        refuse("more fields than the header has", fmt::format("{}", columns_.size()));
      const std::size_t length = found == nullptr ? fields.size() : static_cast<std::size_t>(found - fields.data());
      take(k, fields.substr(0, length));
      if (!last) fields.remove_prefix(std::min(length + 1, fields.size()));
    }
    end_row();
  }

  /// Separators at the end of a line are harmless.
  bool is_empty_end(std::string_view rest) const {
    return std::all_of(rest.begin(), rest.end(),
                       [&](char c) { return c == layout_.separator || c == ' ' || c == '\t' || c == '\r'; });
  }

  void quoted_row() {
    const std::vector<std::string_view> fields = split(line_, layout_.separator);
    const std::size_t needed = layout_.own ? columns_.size() : last_used_ + 1, taken = std::max(needed, last_kept_ + 1);
    if (fields.size() < needed) too_few(fields.size());
    const bool longer =
        std::any_of(fields.begin() + static_cast<std::ptrdiff_t>(std::min(fields.size(), columns_.size())),
                    fields.end(), [](std::string_view field) { return !field.empty(); });
    if (longer) refuse("more fields than the header has", fmt::format("{}", columns_.size()));
    for (std::size_t k = 0; k < taken; ++k) take(k, k < fields.size() ? fields[k] : std::string_view{});
    end_row();
  }

  [[noreturn]] void too_few(std::size_t fields) const {
    refuse(fmt::format("{} fields", fields), fmt::format("{} as in the header", columns_.size()));
  }

  void take(std::size_t k, std::string_view field) {
    FileColumn& column = columns_[k];
    if (k == layout_.day && !times_.set_day(field))
      refuse(fmt::format("{} in column '{}' is not a date", in_quotes(field), layout_.headings[k]), "a date");
    if (k == layout_.step) times_.set_step(field);
    if (!selection_.take(k, field))
      refuse(fmt::format("{} in column '{}' is not a number", in_quotes(field), layout_.headings[k]), "a number");
    if (column.into != nullptr)
      column.into->push_back(column.source->target.quantity == Quantity::time ? time(field, column)
                                                                              : value(field, column));
    else if (column.text != nullptr)
      column.text->emplace_back(trimmed(field));
    else if (k == state_index_)
      discharges_ = trimmed(field).starts_with('D');
  }

  void end_row() {
    std::vector<double>& t = recording_.time_s.edit();
    if (!std::isfinite(t.back())) refuse("time_s is not a number", "a time in seconds");
    if (state_index_ < columns_.size() && discharges_) {
      std::vector<double>& current = recording_.current_a.edit();
      current.back() = -std::abs(current.back());
    }
    switch (times_.place(t.back(), lines_.number())) {
      case RowTimes::Place::left_out:
        return drop_row();
      case RowTimes::Place::back:
        refuse_back(times_.last_s(), t.back());
      default:
        break;
    }
    if (std::abs(t.back() - t.front()) > longest_s)
      refuse(fmt::format("time_s = {:g}", t.back()), "a recording of less than ten years");
    if (!selection_.keeps()) return drop_row();
    if (t.size() < 2 || t.back() != t[t.size() - 2] || !repeats_the_row_above()) return;
    times_.note_repeated(lines_.number());
    drop_row();
  }

  [[noreturn]] void refuse_back(double from_s, double to_s) const {
    refuse(fmt::format("time goes back from {:g} s to {:g} s", from_s, to_s), "times that do not decrease");
  }
  void drop_row() {
    for (FileColumn& c : columns_) {
      if (c.into != nullptr) c.into->pop_back();
      if (c.text != nullptr) c.text->pop_back();
    }
  }
  bool repeats_the_row_above() const {
    return std::all_of(columns_.begin(), columns_.end(), [](const FileColumn& c) {
      const auto same = [](const auto& list) { return list.back() == list[list.size() - 2]; };
      if (c.text != nullptr) return same(*c.text);
      if (c.into == nullptr) return true;
      return same(*c.into) || (std::isnan(c.into->back()) && std::isnan((*c.into)[c.into->size() - 2]));
    });
  }

  double time(std::string_view field, const FileColumn& column) {
    if (column.source->clock) {
      const auto s = times_.clock(field);
      if (!s)
        refuse(fmt::format("{} in column '{}' is not a time", in_quotes(field), column.name), "h:mm:ss or a date");
      return *s;
    }
    const auto v = number(field, point_);
    if (!v) refuse(fmt::format("{} in column '{}' is not a number", in_quotes(field), column.name), "a number");
    return column.source->scale(*v);
  }

  double value(std::string_view field, FileColumn& column) {
    auto v = number(field, point_);
    if (!v && (trimmed(field).empty() || is_missing_word(trimmed(field)))) {
      ++(trimmed(field).empty() ? column.empty : words_);
      v = missing_value;
    }
    if (!v)
      refuse(fmt::format("{} in column '{}' is not a number", in_quotes(field), column.name), "a number or nothing");
    if (is_overflow(*v)) {
      if (overflows_++ == 0) first_overflow_line_ = lines_.number();
      v = missing_value;
    }
    if (std::abs(*v) > largest_reading) {
      refuse(fmt::format("{} in column '{}' is impossible", in_quotes(field), column.name),
             fmt::format("a value from -{:g} to {:g}, or nan", largest_reading, largest_reading));
    }
    if (std::isnan(*v)) {
      if (column.missing++ == 0) column.first_missing_line = lines_.number();
    } else {
      column.read = true;
    }
    return column.source->scale.neutral() ? *v : column.source->scale(*v);
  }

  /// A column of which every field is empty is not there: a table has columns for more cells than the pack.
  void warn_of_missing() {
    std::size_t missing = 0, empty = 0, first_line = 0;
    for (const FileColumn& c : columns_) {
      if (c.sparse || c.missing == 0 || (!c.read && numbered(c))) continue;
      missing += c.missing;
      empty += c.empty;
      if (first_line == 0 || c.first_missing_line < first_line) first_line = c.first_missing_line;
    }
    if (overflows_ > 0) {
      recording_.warnings.push_back(
          {"repair_overflow", fmt::format("readings of 3.4e38, the overflow of a tester: {}, the first in line "
                                          "{}; they are treated as missing",
                                          overflows_, first_overflow_line_)});
    }
    if (missing <= overflows_) return;
    std::string what = empty == 0 ? "'nan'" : "empty or 'nan'";
    if (words_ > 0) what = "empty or a word such as 'unavailable'";
    recording_.warnings.push_back(
        {"missing_reading", fmt::format("readings that are {}: {}, the first in line {}; they are treated as missing",
                                        what, missing - overflows_, first_line)});
  }
  static bool numbered(const FileColumn& c) {
    if (c.source == nullptr) return false;
    const Quantity q = c.source->target.quantity;
    return q == Quantity::cell_voltage || q == Quantity::cell_temperature || q == Quantity::pack_voltage;
  }

  void finish() {
    Recording& r = recording_;
    const bool still = r.rows() > 0 && r.duration_s() <= 0;
    if (still && r.rows() + times_.repeated() >= fewest_rows)
      refuse("all rows have the same time", "times that increase");
    if (r.rows() < fewest_rows) refuse(fmt::format("{} rows", r.rows()), fmt::format("{} or more", fewest_rows));
    if (times_.are_many_left_out(r.rows())) refuse("time goes back in many rows", "times that do not decrease");
    warn_of_missing();
    times_.warn(r);
    if (r.time_s.front() > first_epoch_ms && options_.refuse_doubtful) {
      throw BadInput(r.path, 1, "the times look like milliseconds since 1970, expected seconds: --unit time_s=ms");
    }
    if (options_.sign == CurrentSign::discharge_positive) {
      for (double& a : r.current_a.edit()) a = -a;
      if (!r.current_ref_a.empty())
        for (double& a : r.current_ref_a.edit()) a = -a;
      layout_.own = false;
    }
    if (!layout_.own || layout_.decimal_comma || layout_.separator == '\t' || !lines_.encoding().empty())
      r.read_as = text_of(layout_, options_, lines_.encoding());
    if (r.read_as.empty() && selection_.last_column()) r.read_as = "recording";
    r.read_as += selection_.text();
    join_row_groups(r);
    complete_pack(r, options_);
  }

  TextLines& lines_;
  const ReadOptions& options_;
  TableLayout layout_;
  std::string_view line_;
  char point_ = '.';
  std::vector<FileColumn> columns_;
  std::size_t last_used_ = 0, state_index_ = std::numeric_limits<std::size_t>::max();
  bool discharges_ = false;
  std::size_t last_kept_ = 0;  ///< column that is only kept
  std::size_t words_ = 0, overflows_ = 0, first_overflow_line_ = 0;
  RowTimes times_;
  RowSelection selection_;
  Recording recording_;
};

}  // namespace

Recording read_table(TextLines& lines, const std::string& path, VoltageColumn voltage, const ReadOptions& options) {
  return TableReader(lines, path, options).read(voltage);
}

std::size_t expected_rows(std::size_t bytes, std::size_t line_length) {
  return std::min(measurement::most_rows, bytes / std::max<std::size_t>(line_length + 1, 8) + 1);
}

}  // namespace bms::files
