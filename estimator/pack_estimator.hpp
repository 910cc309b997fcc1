// The cells of a pack: one full estimator follows the mean cell, and the difference of each cell from it is estimated
// separately (cell_differences.hpp).
//
//   const measurement::Sample mean = mean_cell(sample, cell.plausible);   input of the mean cell's estimator; integers,
//                                                                         equal on every core
//   cells.update(cell, sample, estimate);                                 after its step
//
// The mean leaves out implausible readings and readings far from the median (a broken wire, a stuck converter). A
// reading that is off counts as 0.1 V off at most, so that no cell alone moves the mean by much. If no cell can be
// read, the pack voltage over the number of cells is used.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "estimator/cell_differences.hpp"
#include "estimator/estimate.hpp"
#include "measurement/pack_sample.hpp"

namespace bms::estimator {

constexpr bool is_plausible(std::int32_t uv, const model::PlausibleRange& plausible) {
  return uv >= plausible.voltage_min_uv && uv <= plausible.voltage_max_uv;
}

inline constexpr std::int32_t outlier_uv = 300'000;        ///< from the median: not a reading of the same pack
inline constexpr std::int32_t max_deviation_uv = 100'000;  ///< of a reading from the median, as it counts in the mean

/// Median of the plausible readings; of an even number, the lower one. measurement::no_reading if no reading is
/// plausible.
template <std::size_t Cells>
constexpr std::int32_t median_cell_uv(const measurement::PackSample<Cells>& pack,
                                      const model::PlausibleRange& plausible) {
  std::array<std::int32_t, Cells> sorted{};
  std::size_t count = 0;
  for (const std::int32_t uv : pack.cell_uv) {
    if (!is_plausible(uv, plausible)) continue;
    std::size_t k = count++;
    for (; k > 0 && sorted[k - 1] > uv; --k) sorted[k] = sorted[k - 1];
    sorted[k] = uv;
  }
  return count > 0 ? sorted[(count - 1) / 2] : measurement::no_reading;
}

/// The mean cell as a sample.
template <std::size_t Cells>
constexpr measurement::Sample mean_cell(const measurement::PackSample<Cells>& pack,
                                        const model::PlausibleRange& plausible) {
  measurement::Sample mean{pack.time_us, pack.current_ua, measurement::no_reading, measurement::no_temperature};
  std::int32_t sum_uv = 0, cells = 0;  // plausible readings are below 6 V: 24 of them are far from the end of 32 bits
  std::int32_t sum_cdegc = 0, sensors = 0;
  const std::int32_t median_uv = median_cell_uv(pack, plausible);
  for (const std::int32_t uv : pack.cell_uv) {
    const std::int32_t off_uv = is_plausible(uv, plausible) ? uv - median_uv : outlier_uv;
    if (off_uv >= outlier_uv || off_uv <= -outlier_uv) continue;
    sum_uv += median_uv + std::clamp(off_uv, -max_deviation_uv, max_deviation_uv);
    ++cells;
  }
  for (const std::int16_t cdegc : pack.temperature_cdegc) {
    if (!measurement::temperature_possible(cdegc)) continue;
    sum_cdegc += cdegc;
    ++sensors;
  }
  if (cells > 0)
    mean.voltage_uv = sum_uv / cells;
  else if constexpr (Cells == 1)
    mean.voltage_uv = pack.cell_uv[0];  // the estimator flags what is wrong with it
  else if (pack.pack_uv != measurement::no_reading)
    mean.voltage_uv = pack.pack_uv / static_cast<std::int32_t>(Cells);
  if (sensors > 0) mean.temperature_cdegc = static_cast<std::int16_t>(sum_cdegc / sensors);
  return mean;
}

/// The sample of a single cell as the sample of a pack.
constexpr measurement::PackSample<1> single_cell_pack(const measurement::Sample& s) {
  measurement::PackSample<1> pack;
  pack.time_us = s.time_us;
  pack.current_ua = s.current_ua;
  pack.pack_uv = s.voltage_uv;
  pack.cell_uv[0] = s.voltage_uv;
  pack.temperature_cdegc[0] = s.temperature_cdegc;
  return pack;
}

/// The differences of all cells, updated with samples of the pack.
template <class S, std::size_t Cells>
class PackCells {
 public:
  /// Call it after the mean cell's step with the same sample.
  template <class Cell>
  constexpr void update(const Cell& cell, const measurement::PackSample<Cells>& pack, const Estimate<S>& mean) {
    using namespace model;
    if ((mean.flags & (not_started | time_not_increasing)) != 0) return;
    const std::uint64_t step_us = pack.time_us - time_us_;
    time_us_ = pack.time_us;
    const Soc<S> moved = started_ ? Soc<S>(mean.soc - soc_) : Soc<S>(0);
    soc_ = mean.soc;
    if (!started_ || step_us == 0 || step_us > longest_step_us) {
      started_ = true;
      return;
    }
    typename CellDifferences<S, Cells>::Observation observation;
    for (std::size_t k = 0; k < Cells; ++k) {
      observation.usable[k] = is_plausible(pack.cell_uv[k], cell.plausible);
      if (observation.usable[k]) observation.voltage_v[k] = from_micro<Voltage<S>>(pack.cell_uv[k]);
    }
    constexpr std::uint32_t unmeasured = current_missing | current_implausible;
    const Current<S> current_a =
        (mean.flags & unmeasured) == 0 ? from_micro<Current<S>>(pack.current_ua) : Current<S>(0);
    const auto correlated_samples =
        ratio<Count<S>>(cell.noise.model_correlation_s, seconds<S>(static_cast<std::uint32_t>(step_us)));
    differences_.step(cell, mean.soc, mean.soc_sigma, current_a, moved,
                      correlated_samples > Count<S>(1) ? correlated_samples : Count<S>(1), observation);
  }

  /// Starts cell k from a stored difference: SOC minus the mean's, and its standard deviation.
  constexpr void begin(std::size_t k, const arithmetic::Soc<S>& soc, const arithmetic::Soc<S>& sigma) {
    differences_.begin(k, soc, sigma);
  }

  /// Adds a charge of cell k alone, which the current of the pack does not show: that of its balancing resistor.
  constexpr void shift(std::size_t k, const arithmetic::Soc<S>& by) { differences_.shift(k, by); }

  constexpr const CellDifference<S>& operator[](std::size_t k) const { return differences_[k]; }

 private:
  static constexpr std::uint64_t longest_step_us = 4'000'000'000;

  CellDifferences<S, Cells> differences_;
  arithmetic::Soc<S> soc_{};
  std::uint64_t time_us_ = 0;
  bool started_ = false;
};

}  // namespace bms::estimator
