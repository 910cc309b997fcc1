#include "files/logs/long_table.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <vector>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "files/logs/column_options.hpp"
#include "files/logs/log_formats.hpp"
#include "files/logs/missing_reading.hpp"
#include "files/logs/number.hpp"
#include "files/logs/recording_columns.hpp"
#include "files/logs/table_reader.hpp"
#include "files/logs/time_text.hpp"
#include "measurement/recording_checks.hpp"

namespace bms::files {

namespace {

constexpr double one_row_s = 1;  ///< readings that are not further apart are one row
constexpr std::size_t most_named = 12;

struct Reading {
  double time_s = 0, value = 0;
};

struct Series {
  std::string entity;
  Target target;
  Scale scale;
  std::vector<Reading> readings;
  std::size_t next = 0;  ///< the first that is not in a row yet
};

/// What the end of the name says: "sensor.bms_cell_voltage_1" is v_1.
std::optional<Target> target_of_entity(const std::string& entity) {
  std::string name = normalised(entity.substr(entity.find('.') + 1));
  for (;;) {
    for (const Quantity q : {Quantity::cell_voltage, Quantity::cell_temperature}) {
      const std::size_t number = cell_number(q, name);
      if (number > 0 && name.find(q == Quantity::cell_voltage ? "cell" : "temp") != std::string::npos)
        return Target{q, number};
    }
    for (const Quantity q : {Quantity::current, Quantity::pack_voltage, Quantity::voltage, Quantity::temperature}) {
      if (rank_of(q, name) >= 0) return Target{q, 0};
    }
    const std::size_t space = name.find(' ');
    if (space == std::string::npos) return std::nullopt;
    name.erase(0, space + 1);
  }
}

/// One line of the console of ESPHome with a reading.
struct ConsoleReading {
  std::string_view time, entity, state, unit;
};
std::optional<ConsoleReading> console_reading(std::string_view line) {
  const std::size_t open = line.find('['), close = line.find(']', open == std::string_view::npos ? 0 : open);
  constexpr std::string_view between = "': Sending state ", before = "]: '";
  const std::size_t name = line.find(before), state = line.find(between);
  if (open == std::string_view::npos || close == std::string_view::npos || name == std::string_view::npos ||
      state == std::string_view::npos || state < name + before.size())
    return std::nullopt;
  ConsoleReading reading{.time = line.substr(open + 1, close - open - 1),
                         .entity = line.substr(name + before.size(), state - name - before.size()),
                         .state = {},
                         .unit = {}};
  if (!clock_s(reading.time)) return std::nullopt;
  std::string_view rest = line.substr(state + between.size());
  rest = rest.substr(0, rest.find(" with "));
  reading.state = rest.substr(0, rest.find(' '));
  if (reading.state.size() < rest.size()) reading.unit = trimmed(rest.substr(reading.state.size()));
  return reading;
}

constexpr double one_day_s = 86'400;

class LongTable {
 public:
  LongTable(TextLines& lines, const TableLayout& layout, const std::string& path, const ReadOptions& options)
      : lines_(lines), layout_(layout), at_(*layout.long_table), path_(path), options_(options) {
    if (!options.steps.empty() || !options.cycles.empty())
      throw BadInput(path, 1, "a table of readings has no steps and cycles, expected neither --steps nor --cycles");
  }

  measurement::Recording read() {
    std::string_view line;
    const std::size_t needed = std::max({at_.entity, at_.state, at_.time}) + 1;
    while (lines_.next(line)) {
      if (trimmed(line).empty() || line.front() == '#') continue;
      const std::vector<std::string_view> fields = split(line, layout_.separator);
      if (fields.size() < needed && lines_.cut()) break;
      if (fields.size() < needed)
        refuse(fmt::format("{} fields", fields.size()), fmt::format("{} as in the header", layout_.headings.size()));
      receive(fields);
    }
    return finish();
  }

  measurement::Recording read_lines_of_console() {
    console_ = true;
    std::string_view line;
    while (lines_.next(line)) {
      const auto reading = console_reading(line);
      if (!reading) continue;
      receive({reading->entity, reading->state, reading->time}, reading->unit);
    }
    return finish();
  }

 private:
  [[noreturn]] void refuse(const std::string& what, const std::string& expected) const {
    throw BadInput(path_, std::max<std::size_t>(1, lines_.number()), what + ", expected " + expected);
  }

  /// unit: that the line states, or empty
  void receive(const std::vector<std::string_view>& fields, std::string_view unit = {}) {
    const std::string entity(fields[at_.entity]);
    auto known = index_.find(entity);
    if (known == index_.end()) known = index_.emplace(entity, series_of(entity, unit)).first;
    if (!known->second) return;
    Series& series = series_[*known->second];
    const std::string_view state = fields[at_.state];
    const auto number_there = number(state, options_.decimal_comma ? ',' : '.');
    const bool missing = state.empty() || is_missing_word(state);
    if (!number_there && !missing)
      refuse(in_quotes(state) + " of " + in_quotes(entity) + " is not a number", "a number");
    const double value = missing ? missing_value : *number_there;
    if (std::abs(value) > largest_reading)
      refuse(in_quotes(state) + " of " + in_quotes(entity) + " is impossible", "a reading of a battery");
    missing_ += missing ? 1 : 0;
    series.readings.push_back({time_of(fields[at_.time]), series.scale(value)});
  }

  double time_of(std::string_view field) {
    if (const auto date = date_s(field, options_.day_first)) return *date;
    if (const auto clock = clock_s(field)) {
      if (*clock + day_s_ < last_clock_s_ - one_day_s / 2) day_s_ += one_day_s;
      last_clock_s_ = *clock + day_s_;
      return last_clock_s_;
    }
    const auto s = number(field);
    if (!s || std::isnan(*s)) refuse(in_quotes(field) + " is not a time", "a date or seconds");
    return *s;
  }

  /// What the user says about the unit, or the line.
  std::optional<Scale> scale_of_series(const Target& target, std::string_view unit) const {
    if (const auto stated = stated_scale(options_.unit, target)) return stated;
    return console_ ? scale_of(target.quantity, unit) : Scale{};
  }

  /// The series that this entity fills; nothing if it is not used.
  std::optional<std::size_t> series_of(const std::string& entity, std::string_view unit) {
    std::optional<Target> target;
    for (const std::string& text : options_.map) {
      const std::size_t equals = std::min(text.find('='), text.size());
      if (text.substr(std::min(equals + 1, text.size())) == entity) target = target_of(text.substr(0, equals));
    }
    if (options_.map.empty()) target = target_of_entity(entity);
    if (!target || target->quantity == Quantity::time || target->quantity == Quantity::state) return std::nullopt;
    for (const Series& s : series_) {
      if (s.target != *target) continue;
      refuse(fmt::format("{} and {} are both {}", in_quotes(s.entity), in_quotes(entity), name_of(*target)),
             fmt::format("--map {}=ENTITY with one of them, and so on", name_of(*target)));
    }
    const auto scale = scale_of_series(*target, unit);
    if (!scale) return std::nullopt;  // "max voltage cell" without a unit is a number of a cell
    series_.push_back({.entity = entity, .target = *target, .scale = *scale, .readings = {}});
    return series_.size() - 1;
  }

  bool has(Quantity quantity) const {
    return std::any_of(series_.begin(), series_.end(), [&](const Series& s) { return s.target.quantity == quantity; });
  }

  void refuse_missing() const {
    const bool voltage = has(Quantity::voltage) || has(Quantity::cell_voltage) || has(Quantity::pack_voltage);
    if (has(Quantity::current) && voltage) return;
    std::string names;
    std::size_t named = 0;
    for (const auto& [entity, unused] : index_) {
      if (named++ < most_named) names += (names.empty() ? "" : ", ") + entity;
    }
    throw BadInput(
        path_, 1,
        fmt::format("a long table with one reading a row and no entity for {}, expected --map {}=ENTITY with "
                    "one of: {}{}",
                    has(Quantity::current) ? "a voltage" : "current_a",
                    has(Quantity::current) ? "voltage_v" : "current_a", names, named > most_named ? ", ..." : ""));
  }

  /// The times of the rows: that of the last reading of each.
  std::vector<double> row_times() {
    std::vector<double> all, rows;
    double begin_s = 0;
    for (Series& s : series_) {
      std::stable_sort(s.readings.begin(), s.readings.end(),
                       [](const Reading& a, const Reading& b) { return a.time_s < b.time_s; });
      for (const Reading& r : s.readings) all.push_back(r.time_s);
      if (s.target.quantity == Quantity::current) begin_s = s.readings.front().time_s;
    }
    std::sort(all.begin(), all.end());
    double first_s = missing_value;
    for (const double t : all) {
      const bool same = t - first_s <= one_row_s;
      if (!same) first_s = t;
      if (same)
        rows.back() = t;
      else
        rows.push_back(t);
    }
    std::erase_if(rows, [&](double t) { return t < begin_s; });
    return rows;
  }

  measurement::Recording finish() {
    refuse_missing();
    measurement::Recording r;
    r.path = path_;
    const std::vector<double> rows = row_times();
    if (rows.size() < fewest_rows) refuse(fmt::format("{} rows", rows.size()), fmt::format("{} or more", fewest_rows));
    if (rows.size() > measurement::most_rows) refuse("more rows", "fewer: split the recording");
    if (rows.back() - rows.front() > longest_s) refuse("times over ten years", "a recording of less");
    std::vector<double> time_s = rows;
    for (double& t : time_s) t -= rows.front();
    r.time_s = std::move(time_s);
    r.read_as = console_ ? std::string("console of ESPHome")
                         : "long table, a reading a row; time_s from " + in_quotes(layout_.headings[at_.time]);
    std::size_t named = 0;
    for (Series& s : series_) {
      put_column(r, s.target, column_of(s, rows));
      if (named++ < most_named) r.read_as += fmt::format("; {} from {}", name_of(s.target), in_quotes(s.entity));
    }
    if (named > most_named) r.read_as += fmt::format("; and {} more", named - most_named);
    r.read_as += console_ ? "; in the units of its lines" : "; in A, V and degrees C unless --unit states another";
    r.read_as += "; readings within 1 s are one row, and are held until the next";
    const bool inverted = options_.sign == CurrentSign::discharge_positive;
    for (double& a : r.current_a.edit()) a = inverted ? -a : a;
    r.read_as += inverted ? "; a discharge is positive, inverted" : "; > 0 charges";
    if (missing_ > 0) {
      r.warnings.push_back(
          {"missing_reading", fmt::format("readings that are empty or a word such as 'unavailable': {}; "
                                          "they are treated as missing",
                                          missing_)});
    }
    complete_pack(r, options_);
    return r;
  }

  static std::vector<double> column_of(Series& s, const std::vector<double>& rows) {
    std::vector<double> column;
    double value = missing_value;
    for (const double t : rows) {
      for (; s.next < s.readings.size() && s.readings[s.next].time_s <= t; ++s.next) value = s.readings[s.next].value;
      column.push_back(value);
    }
    return column;
  }

  TextLines& lines_;
  const TableLayout& layout_;
  const LongColumns at_;
  const std::string& path_;
  const ReadOptions& options_;
  std::map<std::string, std::optional<std::size_t>> index_;
  std::vector<Series> series_;
  std::size_t missing_ = 0;
  bool console_ = false;  ///< its lines state their units
  double day_s_ = 0, last_clock_s_ = 0;
};

constexpr std::size_t lines_to_a_reading = 200;  ///< a device says much before its first reading

TableLayout console_layout() {
  TableLayout layout;
  layout.headings = {"entity", "state", "the console"};
  layout.long_table = LongColumns{0, 1, 2};
  return layout;
}

}  // namespace

bool is_console(const std::string& path) {
  TextLines lines(path);
  std::string_view line;
  for (std::size_t k = 0; k < lines_to_a_reading && lines.next(line); ++k) {
    if (console_reading(line)) return true;
  }
  return false;
}

measurement::Recording read_console(const std::string& path, const ReadOptions& options, std::size_t& bytes) {
  TextLines lines(path);
  const TableLayout layout = console_layout();
  measurement::Recording recording = LongTable(lines, layout, path, options).read_lines_of_console();
  bytes = lines.bytes();
  return recording;
}

measurement::Recording read_long_table(TextLines& lines, const TableLayout& layout, const std::string& path,
                                       const ReadOptions& options) {
  return LongTable(lines, layout, path, options).read();
}

}  // namespace bms::files
