// One column of a recording: a list of numbers that copies share. Replay, identification and diagnosis view the column
// that was read from the file; a step that changes values calls edit() or assigns a new column, and only that column is
// then stored twice.
//
// Reading from several threads is safe, also from different copies. Writing needs a Column that no other thread uses.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <initializer_list>
#include <limits>
#include <memory>
#include <utility>
#include <vector>

namespace bms::measurement {

class Column {
 public:
  Column() = default;
  Column(std::vector<double> values)  // NOLINT(google-explicit-constructor): a list is a column
      : values_(std::make_shared<std::vector<double>>(std::move(values))) {}
  Column(std::initializer_list<double> values) : Column(std::vector<double>(values)) {}

  std::size_t size() const { return std::min(count_, values_->size() - first_); }
  bool empty() const { return size() == 0; }
  const double* data() const { return values_->data() + first_; }
  const double* begin() const { return data(); }
  const double* end() const { return data() + size(); }
  double operator[](std::size_t row) const { return (*values_)[first_ + row]; }
  double front() const { return *begin(); }
  double back() const { return *(end() - 1); }
  bool operator==(const Column& other) const { return std::equal(begin(), end(), other.begin(), other.end()); }

  /// `count` rows from row `first` on, or fewer at the end. A view: no value is copied.
  Column part(std::size_t first, std::size_t count) const {
    Column viewed = *this;
    viewed.first_ += std::min(first, size());
    viewed.count_ = std::min(count, size() - std::min(first, size()));
    return viewed;
  }

  /// For functions that need a list of their own.
  std::vector<double> copy() const { return {begin(), end()}; }

  /// The values, to be changed. If another column shares them, or if this is a part, they are copied first. The
  /// reference is valid until this column is copied or assigned.
  std::vector<double>& edit() {
    if (values_.use_count() != 1 || first_ != 0 || count_ != whole) *this = copy();
    std::atomic_thread_fence(std::memory_order_acquire);  // after the last read through a copy that has gone
    return *values_;
  }

 private:
  static constexpr std::size_t whole = std::numeric_limits<std::size_t>::max();

  static const std::shared_ptr<std::vector<double>>& no_values() {
    static const auto none = std::make_shared<std::vector<double>>();
    return none;
  }

  std::shared_ptr<std::vector<double>> values_ = no_values();
  std::size_t first_ = 0, count_ = whole;  ///< the rows that are viewed
};

}  // namespace bms::measurement
