// The cells of a pack beside their mean. One current flows through all: a full filter follows the mean cell, and of
// each cell only what makes it another is estimated, its soc and its resistance, by a filter of two states without
// dynamics. What a model gets wrong it gets wrong of all cells alike and drops out of their difference, so a difference
// is known better than the mean.
//
//   v_k - mean v = OCV(soc_k) - mean OCV(soc_j) + r_k (R0 + R1) I        r_k: resistance of cell k over the mean
//   cell's, less 1
//
// With a knee of the curve among the cells the mean of their OCVs is not the OCV of their mean; by how much is taken
// from the sample before. Differences add up to nothing: what they do add up to is taken off them.
//
// G. Plett, "Efficient battery pack state estimation using bar-delta filtering", EVS24, Stavanger 2009.
//
// Memory: 20 bytes a cell. A cell whose voltage is missing keeps what is known of it; its sigma grows.
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
  static constexpr double initial_soc_sigma = 0.05,
                          initial_resistance_sigma =
                              0.1;                 ///< one sigma between cells of a pack that nobody has measured
  static constexpr double capacity_spread = 0.02;  ///< cells differ in capacity by that: of all soc that moves

  constexpr CellDifference() {
    covariance_.set_diagonal({Variance(initial_resistance_sigma * initial_resistance_sigma),
                              Variance(initial_soc_sigma * initial_soc_sigma)});
  }

  /// From what is known before.
  constexpr void begin(const Soc& soc, const Soc& sigma) {
    soc_ = soc;
    covariance_.set_diagonal({Variance(initial_resistance_sigma * initial_resistance_sigma), Variance(sigma * sigma)});
  }

  /// moved: how far soc of the mean has moved since the last call.
  constexpr void predict(const Soc& moved) {
    // the same way until the current turns: deviations add, (sigma + d)^2 - sigma^2, linear in d
    const Soc d = Soc(arithmetic::magnitude(moved) * Fraction(capacity_spread)),
              sigma = arithmetic::root<Soc>(covariance_.template variance<1>());
    covariance_.add_noise_to_last(Variance(Variance((sigma + sigma) * d) + Variance(d * d)));
  }
  /// Of what all differences share, which is the mean's.
  constexpr void remove_mean(const Soc& common) { soc_ = Soc(soc_ - common); }
  /// off_v: this cell's voltage less the mean, less what the OCV curve says of the difference; slope: at this cell;
  /// drop_v: over R0 and R1; noise_v2: of off_v.
  constexpr void correct(const Voltage& off_v, const arithmetic::VoltagePerSoc<S>& slope, const Voltage& drop_v,
                         const Variance& noise_v2) {
    const auto correction = covariance_.observe({arithmetic::VoltagePerSoc<S>(drop_v), slope}, noise_v2,
                                                Voltage(off_v - drop_v * resistance_));
    resistance_ = Soc(resistance_ + correction[0]);
    soc_ = Soc(soc_ + correction[1]);
  }

  constexpr const Soc& soc() const { return soc_; }  ///< of this cell less the mean's
  constexpr Soc soc_sigma() const { return arithmetic::root<Soc>(covariance_.template variance<1>()); }
  constexpr const Soc& resistance() const { return resistance_; }  ///< over the mean's, less 1

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
  /// What one sample of the pack says.
  struct Observation {
    std::array<Voltage, Cells> voltage_v{};
    std::array<bool, Cells> usable{};
  };

  /// soc, sigma: of the mean cell; moved: how far it has moved since the last call; correlated_samples: samples that
  /// share one error of the model (its correlation time over the step).
  template <class Cell>
  constexpr void step(const Cell& cell, const Soc& soc, const Soc& sigma, const arithmetic::Current<S>& current_a,
                      const Soc& moved, const arithmetic::Count<S>& correlated_samples,
                      const Observation& observation) {
    arithmetic::Current<S> sum_v(0), sum_above_v(0), sum_soc(0);
    int count = 0;
    for (std::size_t k = 0; k < Cells; ++k) {
      if (observation.usable[k]) sum_v = arithmetic::Current<S>(sum_v + observation.voltage_v[k]), ++count;
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
      // of the model's error, a quarter is each cell's own, and stays with it: it lasts ten times as long; with a knee
      // between cell and mean, the mean's own error counts
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
  constexpr const CellDifference<S>& operator[](std::size_t k) const { return difference_[k]; }

 private:
  std::array<CellDifference<S>, Cells> difference_;
  Voltage mean_above_v_{};  ///< mean of the cells' OCVs less the OCV of their mean, in the sample before
  Soc common_{};
  std::uint8_t interval_ = 0;
};

}  // namespace bms::estimator
