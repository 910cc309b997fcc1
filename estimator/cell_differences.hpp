// The cells of a pack relative to their mean. One current flows through all cells. A full filter follows the mean cell;
// for each cell, a filter of two states without dynamics estimates only the differences: its SOC and its resistance. An
// error of the model is the same in all cells and cancels in the difference, so a difference is known better than the
// mean.
//
//   v_k - mean v = OCV(soc_k) - mean OCV(soc_j) + r_k (R0 + R1) I        r_k: relative resistance of cell k minus 1
//
// If a knee of the curve lies among the cells, the mean of their OCVs differs from the OCV of their mean; this
// difference is taken from the previous sample. The differences must sum to zero: their common part is removed.
//
// G. Plett, "Efficient battery pack state estimation using bar-delta filtering", EVS24, Stavanger 2009.
//
// Memory: 20 bytes a cell. A cell whose voltage is missing keeps its state, and its sigma grows.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "estimator/ud_covariance.hpp"
#include "estimator/voltage_uncertainty.hpp"
#include "model/cell.hpp"

namespace bms::estimator {

template <class S>
class CellDifference {
  using Soc = arithmetic::Soc<S>;
  using Voltage = arithmetic::Voltage<S>;
  using Variance = arithmetic::Variance<S>;
  using Fraction = arithmetic::Fraction<S>;
  using Coupling = arithmetic::Coupling<S>;

 public:
  // standard deviations between the cells of an unmeasured pack
  static constexpr double initial_soc_sigma = 0.05;
  static constexpr double initial_resistance_sigma = 0.1;  ///< relative
  static constexpr double capacity_spread = 0.02;          ///< relative, so this share of the SOC that moves

  constexpr CellDifference() {
    covariance_.set_diagonal({Variance(initial_resistance_sigma * initial_resistance_sigma),
                              Variance(initial_soc_sigma * initial_soc_sigma)});
  }

  /// Starts from a known difference.
  constexpr void begin(const Soc& soc, const Soc& sigma) {
    soc_ = soc;
    covariance_.set_diagonal({Variance(initial_resistance_sigma * initial_resistance_sigma), Variance(sigma * sigma)});
  }

  /// Charge of this cell alone, through its balancing resistor.
  constexpr void shift(const Soc& by) { soc_ = soc_ + by; }

  /// moved: change of the mean SOC since the last call.
  constexpr void predict(const Soc& moved) {
    // the error keeps its sign until the current turns, so standard deviations add: (sigma + d)^2 - sigma^2
    const Soc d = Soc(arithmetic::magnitude(moved) * Fraction(capacity_spread));
    const Soc sigma = arithmetic::root<Soc>(covariance_.template variance<1>());
    covariance_.add_noise_to_last(Variance(Variance((sigma + sigma) * d) + Variance(d * d)));
  }
  /// Removes the common part of all differences, which belongs to the mean.
  constexpr void remove_mean(const Soc& common) { soc_ = Soc(soc_ - common); }
  /// off_v: voltage of this cell minus the mean, minus the difference of the OCVs; slope: of the OCV at this cell;
  /// drop_v: over R0 and R1; noise_v2: variance of off_v.
  constexpr void correct(const Voltage& off_v, const arithmetic::VoltagePerSoc<S>& slope, const Voltage& drop_v,
                         const Variance& noise_v2) {
    const auto correction = covariance_.observe({arithmetic::VoltagePerSoc<S>(drop_v), slope}, noise_v2,
                                                Voltage(off_v - drop_v * resistance_));
    resistance_ = Soc(resistance_ + correction[0]);
    soc_ = Soc(soc_ + correction[1]);
  }

  constexpr const Soc& soc() const { return soc_; }  ///< of this cell minus the mean's
  constexpr Soc soc_sigma() const { return arithmetic::root<Soc>(covariance_.template variance<1>()); }
  constexpr const Soc& resistance() const { return resistance_; }  ///< relative to the mean's, minus 1

 private:
  Soc soc_{}, resistance_{};
  UdCovariance<S, 2> covariance_;
};

template <class S, std::size_t Cells>
class CellDifferences {
  using Soc = arithmetic::Soc<S>;
  using Voltage = arithmetic::Voltage<S>;
  using Variance = arithmetic::Variance<S>;

 public:
  /// Cell voltages of one sample.
  struct Observation {
    std::array<Voltage, Cells> voltage_v{};
    std::array<bool, Cells> usable{};
  };

  /// soc, sigma: of the mean cell; moved: change of its SOC since the last call; correlated_samples: number of samples
  /// that share one error of the model (its correlation time over the step), >= 1.
  template <class Cell>
  constexpr void step(const Cell& cell, const Soc& soc, const Soc& sigma, const arithmetic::Current<S>& current_a,
                      const Soc& moved, const arithmetic::Count<S>& correlated_samples,
                      const Observation& observation) {
    arithmetic::Current<S> sum_v(0), sum_above_v(0), sum_soc(0);
    int count = 0;
    for (std::size_t k = 0; k < Cells; ++k) {
      if (observation.usable[k]) {
        sum_v = arithmetic::Current<S>(sum_v + observation.voltage_v[k]);
        ++count;
      }
      difference_[k].remove_mean(common_);
      difference_[k].predict(moved);
    }
    if (count < 2) return;
    const Voltage mean_v = arithmetic::ratio<Voltage>(sum_v, arithmetic::Current<S>(count));
    const auto at = look_up(cell, soc, interval_);
    const auto slope = ocv_slope<S>(at);
    const Voltage drop_v = steady_state_drop_v<S>(at, current_a);
    for (std::size_t k = 0; k < Cells; ++k) {
      if (!observation.usable[k]) continue;
      std::uint8_t interval = interval_;
      const auto here = look_up(cell, Soc(soc + difference_[k].soc()), interval);
      const auto slope_here = ocv_slope<S>(here);
      const Voltage above_v = here.ocv_v - at.ocv_v;
      sum_above_v = arithmetic::Current<S>(sum_above_v + above_v);
      // a quarter of the model's error belongs to each cell and lasts ten times as long; with a knee between cell and
      // mean, the error of the mean counts as well
      const Voltage knee_v = Voltage(arithmetic::VoltagePerSoc<S>(slope_here - slope) * sigma);
      const Variance own_v2 = Variance(Variance(here.error_v2 * arithmetic::Fraction<S>(10.0 / 16)) + knee_v * knee_v);
      const Variance noise_v2 = Variance(Variance(cell.noise.voltage_v2 + cell.noise.voltage_v2) +
                                         arithmetic::product<Variance>(own_v2, correlated_samples));
      difference_[k].correct(Voltage((observation.voltage_v[k] - mean_v) - Voltage(above_v - mean_above_v_)),
                             slope_here, drop_v, noise_v2);
    }
    for (const CellDifference<S>& d : difference_) sum_soc = arithmetic::Current<S>(sum_soc + d.soc());
    mean_above_v_ = arithmetic::ratio<Voltage>(sum_above_v, arithmetic::Current<S>(count));
    common_ = Soc(sum_soc * arithmetic::Fraction<S>(1.0 / Cells));
  }

  constexpr void begin(std::size_t k, const Soc& soc, const Soc& sigma) { difference_[k].begin(soc, sigma); }
  constexpr void shift(std::size_t k, const Soc& by) { difference_[k].shift(by); }
  constexpr const CellDifference<S>& operator[](std::size_t k) const { return difference_[k]; }

 private:
  std::array<CellDifference<S>, Cells> difference_;
  Voltage mean_above_v_{};  ///< mean of the cells' OCVs minus the OCV of their mean, in the previous sample
  Soc common_{};
  std::uint8_t interval_ = 0;
};

}  // namespace bms::estimator
