// One signal of a CAN log as a column with the rows of another signal, the current: frames that belong together are
// sent one after the other, not at one time.
//
// A value belongs to the row that is nearest to it in time, and is held in later rows until the next value. Of several
// values of one row the nearest counts.
#pragma once

#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

namespace bms::files {

class PairedColumn {
 public:
  static constexpr double stale_s = 10;  ///< an older value is missing

  /// A value that was sent at this time, which is not before that of the last row or value. NaN: not available.
  void receive(double time_s, double value) {
    last_ = {time_s, value};
    if (!received_) first_ = last_;
    received_ = true;
    ++count_;
  }

  /// A row at this time, which is not before that of the last one. Without `nearest` it has the last value before it.
  void add_row(double time_s, bool nearest) {
    if (received_ && nearest) end_row(time_s);
    const bool own = received_ && (!nearest || values_.empty() || time_s - last_.time_s <= last_.time_s - row_s_);
    const bool fresh = count_ > 0 && time_s - last_.time_s <= stale_s;
    values_.push_back(fresh ? last_.value : std::numeric_limits<double>::quiet_NaN());
    distance_s_ = stale_s;
    noted_ = false;
    if (own && fresh) note(last_.time_s - time_s);
    received_ = false;
    previous_s_ = values_.size() > 1 ? row_s_ : time_s;
    row_s_ = time_s;
  }

  /// After the last row: a value soon behind it belongs to it.
  void end() {
    if (received_ && !values_.empty()) end_row(row_s_ + (row_s_ - previous_s_));
    received_ = false;
  }

  std::size_t count() const { return count_; }          ///< values
  std::size_t paired() const { return paired_; }        ///< rows with a value of their own
  std::size_t first_row() const { return first_row_; }  ///< that has a value of its own
  /// Mean time of the values after their rows [s].
  double mean_delay_s() const { return paired_ == 0 ? 0 : delay_s_ / static_cast<double>(paired_); }
  std::vector<double>& values() { return values_; }

 private:
  struct Value {
    double time_s = 0, value = 0;
  };

  /// The first value behind the last row, if it is nearer to it than to the next one and than another value.
  void end_row(double next_s) {
    if (values_.empty()) return;
    const double behind_s = first_.time_s - row_s_;
    if (behind_s >= next_s - first_.time_s || behind_s >= distance_s_) return;
    values_.back() = first_.value;
    note(behind_s);
  }
  /// The last row has a value that was sent so long after it.
  void note(double delay_s) {
    if (noted_) {
      delay_s_ -= last_delay_s_;
      --paired_;
    }
    if (paired_++ == 0) first_row_ = values_.size() - 1;
    noted_ = true;
    last_delay_s_ = delay_s;
    delay_s_ += delay_s;
    distance_s_ = std::abs(delay_s);
  }

  std::vector<double> values_;
  Value first_, last_;     ///< since the last row
  bool received_ = false;  ///< since the last row
  bool noted_ = false;     ///< the last row has a value of its own
  double row_s_ = 0, previous_s_ = 0;
  double distance_s_ = stale_s;  ///< of the last row from its value
  double delay_s_ = 0, last_delay_s_ = 0;
  std::size_t count_ = 0, paired_ = 0, first_row_ = 0;
};

}  // namespace bms::files
