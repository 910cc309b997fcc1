// The points of the live page: the last 7,200, at least half a second apart. That is one hour, or two hours with one
// sample per second. Memory use is constant.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include "monitor/bus_state.hpp"

namespace bms::monitor {

struct HistoryPoint {
  static constexpr std::size_t max_cells = 32;
  double time_s = 0;  ///< since the first frame
  float soc_percent = not_available, soc_sigma_percent = not_available, current_a = not_available,
        voltage_v = not_available, temperature_c = not_available;
  std::uint8_t cell_count = 0;
  std::array<float, max_cells> cells_v{};

  static constexpr float not_available = std::numeric_limits<float>::quiet_NaN();
};

HistoryPoint point_of(const BusState& bus);

class History {
 public:
  static constexpr std::size_t capacity = 7'200;
  static constexpr std::int64_t min_interval_us = 500'000;

  History() { points_.reserve(capacity); }
  /// Returns true if `time_us` is later than the last point by the minimum interval, or earlier (a clock was set).
  bool is_due(std::int64_t time_us) const {
    return count_ == 0 || time_us - last_us_ >= min_interval_us || time_us < last_us_;
  }
  void add(const HistoryPoint& point, std::int64_t time_us) {
    if (points_.size() < capacity)
      points_.push_back(point);
    else
      points_[count_ % capacity] = point;
    ++count_;
    last_us_ = time_us;
  }
  /// Points added since the start. Points first() to count() - 1 are available.
  std::uint64_t count() const { return count_; }
  std::uint64_t first() const { return count_ - points_.size(); }
  const HistoryPoint& at(std::uint64_t k) const { return points_[k % capacity]; }

 private:
  std::vector<HistoryPoint> points_;
  std::uint64_t count_ = 0;
  std::int64_t last_us_ = 0;
};

}  // namespace bms::monitor
