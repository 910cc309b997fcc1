// Runs the estimators of several cells over their samples: ordinary steps together, all others one by one.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>

#include "replay/lane_filter.hpp"

namespace bms::replay {

/// The estimators, one by one.
template <template <class> class ModelOf>
class SingleSteps {
 public:
  virtual ~SingleSteps() = default;

  /// One step of one estimator. changed: what ordinary steps have changed since its last step, or nullptr.
  /// present: set to the values after it.
  virtual estimator::EstimateWords step(std::size_t lane, const measurement::Sample& sample,
                                        const LaneValues<ModelOf>* changed, LaneValues<ModelOf>& present) = 0;
  /// What a step does first if the temperature is in another bin.
  virtual void set_temperature(std::size_t lane, std::int16_t cdegc, LaneValues<ModelOf>& present) = 0;
};

/// Samples of one lane, and where its estimates are written. Lanes may have different numbers of samples.
struct LaneBlock {
  std::span<const measurement::Sample> samples;
  estimator::EstimateWords* words = nullptr;
};

template <std::size_t Registers, template <class> class ModelOf>
class LaneRun {
  using S = arithmetic::Lanes<Registers>;
  using Int = arithmetic::IntLanes<Registers>;
  using Mask = typename S::Mask;
  using Values = LaneValues<ModelOf>;

 public:
  static constexpr std::size_t lanes = S::size;

  LaneRun(std::span<const LaneCell* const> cells, SingleSteps<ModelOf>& single) : single_(single) {
    for (std::size_t lane = 0; lane < lanes; ++lane) cells_.set(lane, *cells[std::min(lane, cells.size() - 1)]);
  }

  void run(std::span<const LaneBlock> blocks) {
    std::size_t end = 0;
    for (const LaneBlock& b : blocks) end = std::max(end, b.samples.size());
    for (std::size_t row = 0; row < end;) row += run_chunk(blocks, row);
  }
  /// Number of steps that single estimators made.
  std::uint64_t single_steps() const { return single_steps_; }

 private:
  static constexpr std::size_t chunk_rows = 32;
  static constexpr std::size_t before = std::numeric_limits<std::size_t>::max();  ///< not a row of the chunk

  /// One row of all lanes. Numbers that were stored one by one are loaded together some rows later: a processor waits
  /// if that happens at once.
  struct Row {
    typename Int::Array current_ua{}, voltage_uv{}, flags{};
    typename S::Array wanted{};      ///< 1: may be an ordinary step
    bool other_temperature = false;  ///< than at the start of the chunk, in a lane
    typename S::Array soc{}, soc_sigma{}, v_rc_v{}, voltage_predicted_v{};
  };

  /// Runs from one row on, as many rows as all lanes have that have samples there. Returns their number.
  std::size_t run_chunk(std::span<const LaneBlock> blocks, std::size_t first) {
    std::size_t rows = chunk_rows;
    typename S::Array absent;
    absent.fill(1);
    for (std::size_t lane = 0; lane < blocks.size(); ++lane) {
      present_[lane] = {};
      if (first >= blocks[lane].samples.size()) continue;
      present_[lane] = blocks[lane].samples.subspan(first);
      rows = std::min(rows, present_[lane].size());
      absent[lane] = 0;
    }
    const Mask is_absent = S(absent) > S(0.0F);
    last_alone_.fill(before);
    for (Row& row : chunk_) row.other_temperature = false;
    for (std::size_t lane = 0; lane < blocks.size(); ++lane) fill(lane, 0, rows);
    for (std::size_t row = 0; row < rows; ++row) step(row, rows, is_absent);
    for (std::size_t lane = 0; lane < blocks.size(); ++lane) {
      if (present_[lane].empty()) continue;
      write(lane, rows, blocks[lane].words + first);
      remember(lane, rows);
    }
    return rows;
  }

  /// Fills the rows of one lane from `row` on.
  void fill(std::size_t lane, std::size_t row, std::size_t rows) {
    const Values& v = values_[lane];
    if (present_[lane].empty()) {
      for (; row < rows; ++row) chunk_[row].wanted[lane] = 0;
      return;
    }
    std::uint64_t last_us = v.time_us;
    const float if_ordinary = v.step_us != 0 ? 1 : 0;
    for (; row < rows; ++row) {
      const measurement::Sample& sample = present_[lane][row];
      chunk_[row].current_ua[lane] = sample.current_ua;
      chunk_[row].voltage_uv[lane] = sample.voltage_uv;
      const bool ordinary =
          (sample.time_us - last_us == v.step_us) & !estimator::Consistency<float>::turn_ends(last_us, sample.time_us);
      chunk_[row].wanted[lane] = ordinary ? if_ordinary : 0.0F;
      const std::int32_t bin = estimator::LaneAccess::temperature_bin(sample.temperature_cdegc);
      if (bin != v.temperature_bin) [[unlikely]]
        chunk_[row].other_temperature = true;
      last_us = sample.time_us;
    }
  }

  void step(std::size_t row, std::size_t rows, const Mask& is_absent) {
    Mask done = S(chunk_[row].wanted) > S(0.0F);
    if (chunk_[row].other_temperature) {
      for (std::size_t lane = 0; lane < lanes; ++lane) set_temperature(lane, row);
    }
    if (any(done)) {
      estimator::Estimate<S> e;
      done = filter_.step(cells_, {chunk_[row].current_ua, chunk_[row].voltage_uv}, done, e);
      chunk_[row].soc = e.soc.array();
      chunk_[row].soc_sigma = e.soc_sigma.array();
      chunk_[row].v_rc_v = e.v_rc_v.array();
      chunk_[row].voltage_predicted_v = e.voltage_predicted_v.array();
      chunk_[row].flags.fill(0);
    }
    done = done | is_absent;
    if (all(done)) [[likely]]
      return;
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      if (!done[lane]) step_one(lane, row, rows);
    }
  }

  /// Constants depend on the temperature.
  void set_temperature(std::size_t lane, std::size_t row) {
    if (!in_filter_[lane] || chunk_[row].wanted[lane] == 0) return;
    Values& v = values_[lane];
    const std::int16_t cdegc = present_[lane][row].temperature_cdegc;
    if (estimator::LaneAccess::temperature_bin(cdegc) == v.temperature_bin) return;
    single_.set_temperature(lane, cdegc, v);
    filter_.set_constants(lane, v);
    check_temperatures(row);
  }

  /// In later rows of the chunk, too, the temperature may be in another bin than in the row before.
  void check_temperatures(std::size_t row) {
    for (; row < chunk_rows; ++row) chunk_[row].other_temperature = true;
  }

  void step_one(std::size_t lane, std::size_t row, std::size_t rows) {
    Values& v = values_[lane];
    if (in_filter_[lane]) remember(lane, row);
    const bool was_in_filter = in_filter_[lane];
    const Values old = v;
    const measurement::Sample& sample = present_[lane][row];
    const estimator::EstimateWords words = single_.step(lane, sample, was_in_filter ? &old : nullptr, v);
    chunk_[row].soc[lane] = std::bit_cast<float>(words[0]);
    chunk_[row].soc_sigma[lane] = std::bit_cast<float>(words[1]);
    chunk_[row].v_rc_v[lane] = std::bit_cast<float>(words[2]);
    chunk_[row].voltage_predicted_v[lane] = std::bit_cast<float>(words[3]);
    chunk_[row].flags[lane] = static_cast<std::int32_t>(words[4]);
    last_alone_[lane] = row;
    ++single_steps_;
    // while every sample is checked, the estimator steps alone
    in_filter_[lane] = v.step_us != 0 && v.unchecked_below_v > 0 && v.file_us <= longest_us(*cells_.cell[lane]);
    if (!in_filter_[lane]) v.step_us = 0;
    if (in_filter_[lane]) filter_.set(lane, v);
    if (v.temperature_bin != old.temperature_bin) check_temperatures(row);
    if (v.time_us != sample.time_us || v.step_us != old.step_us) fill(lane, row + 1, rows);
  }

  /// Values of one lane after the rows before `row`.
  void remember(std::size_t lane, std::size_t row) {
    if (!in_filter_[lane]) return;
    Values& v = values_[lane];
    filter_.get(lane, v);
    if (row == 0 || last_alone_[lane] == row - 1) return;
    v.time_us = present_[lane][row - 1].time_us;
    v.current_ua = present_[lane][row - 1].current_ua;
  }

  /// Longest step in which a plausible current changes the charge by no more than lanes can count.
  static std::int64_t longest_us(const LaneCell& cell) {
    return estimator::Charge<S>::most_counted * cell.charge.capacity_uaus / cell.plausible.current_max_ua;
  }

  void write(std::size_t lane, std::size_t rows, estimator::EstimateWords* words) {
    using estimator::word;
    for (std::size_t row = 0; row < rows; ++row) {
      words[row] = {word(chunk_[row].soc[lane]), word(chunk_[row].soc_sigma[lane]), word(chunk_[row].v_rc_v[lane]),
                    word(chunk_[row].voltage_predicted_v[lane]), static_cast<std::uint32_t>(chunk_[row].flags[lane])};
    }
  }

  SingleSteps<ModelOf>& single_;
  LaneCells<Registers> cells_;
  LaneFilter<Registers, ModelOf> filter_;
  std::array<Row, chunk_rows> chunk_{};
  std::array<Values, lanes> values_{};
  std::array<bool, lanes> in_filter_{};
  std::array<std::size_t, lanes> last_alone_{};  ///< last row of the chunk in which the lane had a step of its own
  std::array<std::span<const measurement::Sample>, lanes> present_{};
  std::uint64_t single_steps_ = 0;
};

}  // namespace bms::replay
