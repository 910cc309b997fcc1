#include "files/logs/row_times.hpp"

#include <cmath>

#include <fmt/format.h>

#include "files/logs/table_reader.hpp"
#include "files/logs/time_text.hpp"

namespace bms::files {

namespace {

constexpr double day_s = 86'400, hour_s = 3'600;
constexpr double longest_over_s = 60;      ///< between two rows over a change of daylight saving time
constexpr std::size_t most_left_out = 10;  ///< one row in so many

/// Returns true if a time zone stands behind the time of day.
bool has_zone(std::string_view text) {
  const std::size_t time = text.find(':');
  return time != std::string_view::npos && text.find_first_of("Zz+-", time) != std::string_view::npos;
}

}  // namespace

bool RowTimes::set_day(std::string_view field) {
  const auto day = day_of_text_s(trimmed(field), kind_.day_first);
  if (!day) return false;
  if (!first_day_s_) first_day_s_ = *day;
  day_s_ = *day - *first_day_s_;
  return true;
}

void RowTimes::set_step(std::string_view field) {
  step_changed_ = trimmed(field) != step_;
  if (step_changed_) step_ = trimmed(field);
}

std::optional<double> RowTimes::clock(std::string_view field) {
  const std::string_view text = trimmed(field);
  if (const auto s = clock_s(text)) return *s;
  const auto s = date_s(text, kind_.day_first);
  if (!s) return std::nullopt;
  kind_.dated = true;
  zoned_ = zoned_ || has_zone(text);
  if (!first_day_s_) first_day_s_ = *s;
  return *s - *first_day_s_;
}

/// Returns true if a time that is before the last one is the next one of a clock that began again.
bool RowTimes::goes_on(double field_s, std::size_t line) {
  const double back_s = last_field_s_ - field_s;
  if (kind_.by_step && step_changed_) {
    shift_s_ += last_field_s_;
    return true;
  }
  if (kind_.clock && !kind_.dated && last_field_s_ < day_s && back_s <= day_s && back_s > day_s - hour_s) {
    shift_s_ += day_s;
    midnights_.note(line);
    return true;
  }
  const bool an_hour = back_s <= hour_s && back_s > hour_s - longest_over_s;
  if (!kind_.clock || !kind_.dated || zoned_ || !an_hour || autumn_.count > 0) return false;
  shift_s_ += hour_s;
  autumn_.note(line);
  return true;
}

RowTimes::Place RowTimes::place(double& time_s, std::size_t line) {
  const double field_s = time_s + day_s_;
  if (kind_.dated && !std::isfinite(last_s_)) shift_s_ = -field_s;  // dates begin at 0
  if (field_s < last_field_s_ && std::isfinite(last_s_) && !goes_on(field_s, line)) {
    const bool single = field_s == 0 || last_field_s_ - field_s < largest_step_back_s;
    if (single) back_.note(line);
    time_s = field_s + shift_s_;
    return single ? Place::left_out : Place::back;
  }
  const double step_s = field_s - last_field_s_;
  const bool local = kind_.clock && kind_.dated && !zoned_ && std::isfinite(last_s_);
  const double into_hour_s = std::fmod(first_day_s_.value_or(0) + last_field_s_, hour_s);
  if (local && step_s >= hour_s && step_s < hour_s + longest_over_s && into_hour_s > hour_s - longest_over_s)
    spring_.note(line);
  last_field_s_ = field_s;
  time_s = field_s + shift_s_;
  last_s_ = time_s;
  return Place::kept;
}

bool RowTimes::are_many_left_out(std::size_t rows) const { return back_.count * most_left_out > rows + back_.count; }

void RowTimes::warn(measurement::Recording& r) const {
  const auto say = [&](const Count& of, const char* id, const std::string& text) {
    if (of.count > 0) r.warnings.push_back({id, fmt::format(fmt::runtime(text), of.count, of.line)});
  };
  say(midnights_, "repair_midnight",
      "midnights that the clock passes without a date: {}, the first in line {}; the next day goes on");
  say(autumn_, "repair_daylight_saving",
      "hours by which the clock goes back, as at the end of daylight saving time: {}, in line {}; they are added");
  say(back_, "repair_time_back",
      "rows whose time is 0 or a little before that of the row above: {}, the first in line {}; they are left out");
  say(repeated_, "repair_repeated_row", "rows that repeat the row above: {}, the first in line {}; they are left out");
  if (spring_.count > 0) {
    r.warnings.push_back(
        {"daylight_saving", fmt::format("the clock leaps by an hour in line {}: if daylight saving time begins there, "
                                        "there is no gap",
                                        spring_.line)});
  }
}

}  // namespace bms::files
