#include "files/logs/table_reader.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "files/logs/number.hpp"
#include "files/logs/table_layout.hpp"
#include "files/logs/time_text.hpp"
#include "measurement/recording_checks.hpp"

namespace bms::files {

using measurement::Recording;

namespace {

constexpr std::size_t minimum_rows = 10;
constexpr double first_epoch_ms = 9e11;  ///< no log in seconds begins there
constexpr std::size_t most_ignored_named = 10;
const double missing_value = std::numeric_limits<double>::quiet_NaN();

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
    assign_columns();
    bool first = true;
    while (next_line()) {
      if (first) {
        first = false;
        if (settle(layout_, line_, recording_.path, lines_.number(), options_)) continue;
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

  measurement::Column& column_of(const Target& target) {
    Recording& r = recording_;
    const auto numbered = [&](std::vector<measurement::Column>& columns) -> measurement::Column& {
      if (columns.size() < target.number) columns.resize(target.number);
      return columns[target.number - 1];
    };
    switch (target.quantity) {
      case Quantity::time:
        return r.time_s;
      case Quantity::current:
        return r.current_a;
      case Quantity::voltage:
        return r.voltage_v;
      case Quantity::temperature:
        return r.temperature_c;
      case Quantity::soc_ref:
        return r.soc_ref;
      case Quantity::current_ref:
        return r.current_ref_a;
      case Quantity::voltage_ref:
        return r.voltage_ref_v;
      case Quantity::cell_voltage:
        return numbered(r.cell_voltage_v);
      case Quantity::cell_temperature:
        return numbered(r.cell_temperature_c);
      default:
        return r.pack_voltage_v;
    }
  }

  void assign_columns() {
    columns_.resize(layout_.headings.size());
    for (const SourceColumn& source : layout_.columns) {  // first all columns, because a list of them may move
      if (source.target.quantity != Quantity::state) column_of(source.target).edit();
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
        column.into = &column_of(source.target).edit();
      last_used_ = std::max(last_used_, source.index);
    }
    for (const auto* list : {&recording_.cell_voltage_v, &recording_.cell_temperature_c}) {
      const Quantity q = list == &recording_.cell_voltage_v ? Quantity::cell_voltage : Quantity::cell_temperature;
      if (layout_.count(q) < list->size()) {
        refuse(fmt::format("{} columns of cells, the last has number {}", layout_.count(q), list->size()),
               "numbers from 1 on without a gap");
      }
    }
    name_unused();
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
        last_used_ = std::max(last_used_, layout_.unused[k]);
      }
      return;
    }
    std::vector<std::string> unused;
    for (const std::size_t k : layout_.unused) {
      if (!is_known_copy(layout_.headings[k])) unused.push_back(layout_.headings[k]);
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
      truncated = truncated || (!fields.back().empty() && !number(fields.back(), point_));
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
    const std::size_t needed = layout_.own ? columns_.size() : last_used_ + 1;
    for (std::size_t k = 0; k < needed; ++k) {
      const char* const found = static_cast<const char*>(std::memchr(fields.data(), layout_.separator, fields.size()));
      const bool last = k + 1 == needed;
      if (found == nullptr && !last) too_few(k + 1);
      if (found != nullptr && last && layout_.own &&
          !trimmed({found + 1, fields.data() + fields.size()}).empty()) {  // a separator at the end is harmless
        refuse("more fields than the header has", fmt::format("{}", columns_.size()));
      }
      const std::size_t length = found == nullptr ? fields.size() : static_cast<std::size_t>(found - fields.data());
      take(k, fields.substr(0, length));
      if (!last) fields.remove_prefix(length + 1);
    }
    end_row();
  }

  void quoted_row() {
    const std::vector<std::string_view> fields = split(line_, layout_.separator);
    const std::size_t needed = layout_.own ? columns_.size() : last_used_ + 1;
    if (fields.size() < needed) too_few(fields.size());
    if (fields.size() > columns_.size() + 1 || (fields.size() > columns_.size() && !fields.back().empty()))
      refuse("more fields than the header has", fmt::format("{}", columns_.size()));
    for (std::size_t k = 0; k < needed; ++k) take(k, fields[k]);
    end_row();
  }

  [[noreturn]] void too_few(std::size_t fields) const {
    refuse(fmt::format("{} fields", fields), fmt::format("{} as in the header", columns_.size()));
  }

  void take(std::size_t k, std::string_view field) {
    FileColumn& column = columns_[k];
    if (column.into != nullptr)
      column.into->push_back(column.source->target.quantity == Quantity::time ? time(field, column)
                                                                              : value(field, column));
    else if (column.text != nullptr)
      column.text->emplace_back(trimmed(field));
    else if (k == state_index_)
      discharges_ = trimmed(field).starts_with('D');
  }

  void end_row() {
    const measurement::Column& t = recording_.time_s;
    if (std::isnan(t.back())) refuse("time_s is not a number", "a time in seconds");
    if (t.size() > 1 && t.back() < t[t.size() - 2])
      refuse(fmt::format("time goes back from {:g} s to {:g} s", t[t.size() - 2], t.back()),
             "times that do not decrease");
    if (std::abs(t.back() - t.front()) > longest_s)
      refuse(fmt::format("time_s = {:g}", t.back()), "a recording of less than ten years");
    if (state_index_ < columns_.size() && discharges_) {
      std::vector<double>& current = recording_.current_a.edit();
      current.back() = -std::abs(current.back());
    }
  }

  double time(std::string_view field, const FileColumn& column) {
    if (column.source->clock) {
      const std::string_view text = trimmed(field);
      auto s = clock_s(text);
      if (!s) {
        s = date_s(text, options_.day_first);
        if (s && !epoch_s_) epoch_s_ = *s;
        if (s) s = *s - *epoch_s_;
      }
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
    if (!v && trimmed(field).empty()) {
      ++column.empty;
      v = missing_value;
    }
    if (!v)
      refuse(fmt::format("{} in column '{}' is not a number", in_quotes(field), column.name), "a number or nothing");
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
    if (missing == 0) return;
    recording_.warnings.push_back(
        {"missing_reading", fmt::format("readings that are {}: {}, the first in line {}; they are treated as missing",
                                        empty == 0 ? "'nan'" : "empty or 'nan'", missing, first_line)});
  }
  static bool numbered(const FileColumn& c) {
    if (c.source == nullptr) return false;
    const Quantity q = c.source->target.quantity;
    return q == Quantity::cell_voltage || q == Quantity::cell_temperature || q == Quantity::pack_voltage;
  }

  void finish() {
    Recording& r = recording_;
    if (r.rows() < minimum_rows) refuse(fmt::format("{} rows", r.rows()), fmt::format("{} or more", minimum_rows));
    if (r.duration_s() <= 0) refuse("all rows have the same time", "times that increase");
    warn_of_missing();
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
  std::optional<double> epoch_s_;
  Recording recording_;
};

/// Mean of the readings in each row that are there.
measurement::Column mean_of(const std::vector<measurement::Column>& columns) {
  std::vector<double> mean(columns.front().size());
  for (std::size_t k = 0; k < mean.size(); ++k) {
    double sum = 0;
    int count = 0;
    for (const measurement::Column& column : columns) {
      if (std::isnan(column[k])) continue;
      sum += column[k];
      ++count;
    }
    mean[k] = count > 0 ? sum / count : missing_value;
  }
  return mean;
}

}  // namespace

Recording read_table(TextLines& lines, const std::string& path, VoltageColumn voltage, const ReadOptions& options) {
  return TableReader(lines, path, options).read(voltage);
}

namespace {

bool has_no_reading(const measurement::Column& c) {
  return std::all_of(c.begin(), c.end(), [](double v) { return std::isnan(v); });
}

/// Removes the last columns that have no reading: a log may have columns for more cells than the pack.
void drop_absent(std::vector<measurement::Column>& columns) {
  while (!columns.empty() && has_no_reading(columns.back())) columns.pop_back();
}

}  // namespace

void complete_pack(Recording& r, const ReadOptions& options) {
  drop_absent(r.cell_voltage_v);
  drop_absent(r.cell_temperature_c);
  if (!r.pack_voltage_v.empty() && has_no_reading(r.pack_voltage_v)) r.pack_voltage_v = measurement::Column{};
  if (!r.cell_temperature_c.empty() && r.temperature_c.empty()) r.temperature_c = mean_of(r.cell_temperature_c);
  if (!r.voltage_v.empty()) return;
  if (!r.cell_voltage_v.empty()) {
    r.voltage_v = mean_of(r.cell_voltage_v);
  } else if (!r.pack_voltage_v.empty()) {
    if (options.cells_in_series == 0)
      throw BadInput(r.path, 1, "a pack voltage, but no voltage of a cell, expected --series with the number of cells");
    r.voltage_v = r.pack_voltage_v;
    for (double& v : r.voltage_v.edit()) v /= static_cast<double>(options.cells_in_series);
  }
}

std::size_t expected_rows(std::size_t bytes, std::size_t line_length) {
  return std::min(measurement::most_rows, bytes / std::max<std::size_t>(line_length + 1, 8) + 1);
}

}  // namespace bms::files
