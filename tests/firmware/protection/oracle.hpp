// Faults that must be active, computed independently: quantities from their definitions, delays from the whole history,
// numbers from expected_rows.hpp. Integers of milliseconds and micro-units, so results can be compared exactly.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <deque>
#include <optional>
#include <vector>

#include "measurement/pack_sample.hpp"
#include "tests/firmware/protection/expected_rows.hpp"

namespace bms::protection {

using Value = std::optional<std::int64_t>;

/// Oracle of one row over the samples of its quantity. Score: milliseconds beyond minus milliseconds not beyond the
/// threshold since it was last 0, from the first sample beyond. The fault is raised when the score reaches the delay.
class RowOracle {
 public:
  explicit RowOracle(const ExpectedRow& row) : row_(&row) {}

  /// cleared: a clear command that may end the fault came with this sample. sensors_missing: of the temperatures; the
  /// missing one may be that of the cell that is too hot or too cold.
  bool check(Value value, int step_ms, bool cleared, bool sensors_missing = false) {
    if (!value) return active_;
    const auto row = row_ - expected_rows;
    if (active_ && sensors_missing && row >= 11 && row <= 15) {
      good_ms_ = -1;
      return true;
    }
    if (!active_) {
      const bool beyond = row_->beyond == '>' ? *value > row_->threshold : *value < row_->threshold;
      if (score_ < 0)
        score_ = beyond ? 0 : -1;
      else
        score_ += beyond ? step_ms : -step_ms;
      if (score_ <= 0 && !beyond) score_ = -1;
      if (score_ >= row_->delay_ms) {
        active_ = true;
        good_ms_ = -1;
      }
      return active_;
    }
    const bool good = row_->beyond == '>' ? *value <= row_->release : *value >= row_->release;
    if (!good)
      good_ms_ = -1;
    else
      good_ms_ = good_ms_ < 0 ? 0 : good_ms_ + step_ms;
    if (good_ms_ >= row_->recover_ms && (row_->recovery == 'a' || cleared)) {
      active_ = false;
      score_ = -1;
    }
    return active_;
  }

 private:
  const ExpectedRow* row_;
  int score_ = -1, good_ms_ = -1;
  bool active_ = false;
};

/// Quantity of every row, from samples of sixteen cells and four temperatures; nullopt for rows that samples alone do
/// not show.
class QuantityOracle {
 public:
  using Sample16 = measurement::PackSample<16>;

  std::array<Value, fault_count> check(const Sample16& s, bool voltage_rejected) {
    history_.push_back(s);
    if (history_.size() > 4'000) history_.pop_front();
    std::vector<std::int64_t> cells;
    for (const std::int32_t v : s.cell_uv) {
      if (readable(v)) cells.push_back(v);
    }
    std::vector<std::int64_t> warm;
    for (const std::int16_t t : s.temperature_cdegc) {
      if (read(t)) warm.push_back(t);
    }
    const bool pack = s.pack_uv != measurement::no_reading;
    const Value high = largest(cells), low = smallest(cells), hot = largest(warm), cold = smallest(warm);
    std::int64_t sum = 0;
    for (const std::int64_t v : cells) sum += v;
    const Value packed = pack ? Value(s.pack_uv) : std::nullopt,
                amps = s.current_ua != measurement::no_reading ? Value(std::abs(s.current_ua)) : std::nullopt;
    std::array<Value, fault_count> q;
    q[0] = q[1] = q[2] = high;
    q[3] = q[4] = q[5] = q[25] = low;
    q[6] = q[7] = packed;
    q[10] = amps;
    q[11] = q[12] = q[13] = hot;
    q[14] = q[15] = cold;
    q[16] = shift(s);
    q[17] = high ? Value(*high - *low) : std::nullopt;
    q[18] = voltage_rejected ? 1 : 0;
    q[19] = pack && cells.size() == 16 ? Value(std::abs(sum - s.pack_uv)) : std::nullopt;
    q[20] = static_cast<std::int64_t>(16 - cells.size()) + (pack ? 0 : 1);
    q[21] = stuck_cells();
    q[22] = amps ? 0 : 1;
    q[23] = static_cast<std::int64_t>(4 - warm.size());
    q[24] = warm.size() > 1 ? Value(stuck_temperatures()) : std::nullopt;
    q[35] = warm.empty() ? 1 : 0;
    q[42] = std::ranges::count(s.temperature_cdegc, std::int16_t{32'767});
    return q;
  }

 private:
  /// From -0.5 V (reversed) to 6 V.
  static bool readable(std::int32_t uv) { return uv >= -500'000 && uv <= 6'000'000; }

  static bool read(std::int16_t cdegc) { return std::abs(cdegc) < 20'000; }

  static Value largest(const std::vector<std::int64_t>& v) {
    return v.empty() ? Value() : Value(*std::max_element(v.begin(), v.end()));
  }
  static Value smallest(const std::vector<std::int64_t>& v) {
    return v.empty() ? Value() : Value(*std::min_element(v.begin(), v.end()));
  }

  static Value shift(const Sample16& s) {
    std::int64_t sum = 0, n = 0;
    for (const std::int32_t v : s.cell_uv) {
      if (!readable(v)) continue;
      sum += v;
      ++n;
    }
    if (n == 0) return {};
    const std::int64_t mean = sum / n;
    std::int64_t most = 0;
    for (int k = 0; k < 15; ++k) {
      if (!readable(s.cell_uv[static_cast<std::size_t>(k)]) || !readable(s.cell_uv[static_cast<std::size_t>(k) + 1]))
        continue;
      const std::int64_t a = s.cell_uv[static_cast<std::size_t>(k)] - mean,
                         b = s.cell_uv[static_cast<std::size_t>(k) + 1] - mean;
      const std::int64_t both = std::min(std::abs(a), std::abs(b));
      const bool opposite = (a < 0 && b >= 0) || (b < 0 && a >= 0);
      if (opposite && std::abs(a + b) <= both / 2) most = std::max(most, both);
    }
    return most;
  }

  /// Mean of the cells without the highest and the lowest.
  static std::int64_t middle(const Sample16& s) {
    std::vector<std::int64_t> v;
    for (const std::int32_t uv : s.cell_uv) {
      if (readable(uv)) v.push_back(uv);
    }
    std::sort(v.begin(), v.end());
    std::int64_t sum = 0;
    for (std::size_t k = 1; k + 1 < v.size(); ++k) sum += v[k];
    return v.size() > 2 ? sum / static_cast<std::int64_t>(v.size() - 2) : 0;
  }

  std::int64_t stuck_cells() const {
    std::int64_t count = 0;
    for (std::size_t k = 0; k < 16; ++k) {
      const auto reading = [&](std::size_t i) { return history_[i].cell_uv[k]; };
      count += stuck(
                   reading, readable, [&](std::size_t i) { return middle(history_[i]); }, 20'000)
                   ? 1
                   : 0;
    }
    return count;
  }
  /// Sorted readings of all sensors but the outermost ones; of two sensors that of the other one.
  std::vector<std::int64_t> inner_temperatures(std::size_t at, std::size_t sensor) const {
    std::vector<std::int64_t> known;
    for (const std::int16_t t : history_[at].temperature_cdegc) {
      if (read(t)) known.push_back(t);
    }
    std::sort(known.begin(), known.end());
    if (known.size() < 2) return {0};
    if (known.size() == 2) return {known[0] + known[1] - history_[at].temperature_cdegc[sensor]};
    return {known.begin() + 1, known.end() - 1};
  }
  /// A sensor is stuck if the lower and the upper of the inner ones have both moved by more than 5 K.
  std::int64_t stuck_temperatures() const {
    std::int64_t count = 0;
    for (std::size_t k = 0; k < 4; ++k) {
      const auto reading = [&](std::size_t i) { return history_[i].temperature_cdegc[k]; };
      const auto there = [](std::int16_t t) { return read(t); };
      const auto lower = [&](std::size_t i) { return inner_temperatures(i, k).front(); };
      const auto upper = [&](std::size_t i) { return inner_temperatures(i, k).back(); };
      count += stuck(reading, there, lower, 500) && stuck(reading, there, upper, 500) ? 1 : 0;
    }
    return count;
  }
  /// Returns true if the last six or more known readings are equal and the others have moved since the first of them.
  template <class Reading, class There, class Others>
  bool stuck(const Reading& reading, const There& there, const Others& others, std::int64_t move) const {
    const std::size_t last = history_.size() - 1;
    if (!there(reading(last))) return false;
    std::size_t first = last, n = 0;
    for (std::size_t i = last + 1; i-- > 0;) {
      if (!there(reading(i))) continue;
      if (reading(i) != reading(last)) break;
      first = i;
      ++n;
      if (n > 3'000) break;
    }
    return n >= 6 && std::abs(others(last) - others(first)) > move;
  }

  std::deque<Sample16> history_;
};

}  // namespace bms::protection
