// The times of the rows of a table: clocks, dates in a column of their own, and times that a tester or logger has
// written wrongly. Repairs that lose nothing are made and counted.
//
//   midnight          a time of day without a date goes on on the next day
//   daylight saving   local time goes back by an hour, once
//   step time         begins again with each step of a test: the steps follow each other
//   time 0, less than 2 s back, a row repeated: the row is left out
#pragma once

#include <cstddef>
#include <limits>
#include <optional>
#include <string>
#include <string_view>

#include "files/logs/table_layout.hpp"
#include "files/read_options.hpp"
#include "measurement/recording.hpp"

namespace bms::files {

class RowTimes {
 public:
  /// clock: fields are times of day or dates. dated: the day is in another column. by_step: time within a step.
  struct Kind {
    bool clock = false, dated = false, by_step = false, day_first = false;
  };
  void begin(const Kind& kind) { kind_ = kind; }

  /// The day of this row. Returns false for another text.
  bool set_day(std::string_view field);
  /// The step of this row.
  void set_step(std::string_view field);
  /// Seconds of a field of a clock, on the day of a date since the first one. Nothing for another text.
  std::optional<double> clock(std::string_view field);

  enum class Place { kept, left_out, back };
  /// Sets the time of the row in the recording from that of its field. left_out: the row is not to be used.
  Place place(double& time_s, std::size_t line);
  /// The row repeats the row above and is not used.
  void note_repeated(std::size_t line) { repeated_.note(line); }
  std::size_t repeated() const { return repeated_.count; }
  /// Of the last row that was kept.
  double last_s() const { return last_s_; }
  /// More rows are left out than single ones: the clock is not to be trusted. rows: that were kept.
  bool are_many_left_out(std::size_t rows) const;
  void warn(measurement::Recording& recording) const;

 private:
  /// How often, and where first.
  struct Count {
    std::size_t count = 0, line = 0;
    void note(std::size_t at) {
      if (count++ == 0) line = at;
    }
  };
  bool goes_on(double field_s, std::size_t line);

  Kind kind_;
  bool zoned_ = false, step_changed_ = false;
  std::string step_;
  std::optional<double> first_day_s_;
  double day_s_ = 0;
  double shift_s_ = 0;       ///< that repairs have added
  double last_field_s_ = 0;  ///< as in the file
  double last_s_ = -std::numeric_limits<double>::infinity();
  Count midnights_, autumn_, spring_, back_, repeated_;
};

}  // namespace bms::files
