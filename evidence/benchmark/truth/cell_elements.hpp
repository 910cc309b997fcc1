// Elements of the concealed cell that have a state of their own: diffusion, Butler-Volmer electrode, hysteresis.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "benchmark/truth/concealed_cell.hpp"

namespace bms::benchmark::truth {

inline constexpr double zero_celsius_k = 273.15, reference_k = 298.15;
inline constexpr double thermal_voltage_v = 8.314462618 * reference_k / 96'485.33212;  ///< RT/F at 25 degrees C

/// Concentration in an electrode while charge diffuses into it: finite volumes from the closed back to the surface.
class Slab {
 public:
  Slab(double time_s, double step_s) {
    const double r = step_s / time_s * volumes * volumes;
    // Implicit Euler: (1 + 2 r) c[k] - r (c[k-1] + c[k+1]) = c_before[k]. There is no flow at the back; the flux enters
    // the last volume.
    double below_factor = 0;
    for (std::size_t k = 0; k < volumes; ++k) {
      const double diagonal = 1 + (k == 0 || k + 1 == volumes ? r : 2 * r);
      inverse_[k] = 1 / (diagonal - (k == 0 ? 0 : r * below_factor));
      upper_[k] = below_factor = r * inverse_[k];
    }
    r_ = r;
    inflow_ = step_s / time_s * volumes;
  }

  /// Surface minus mean concentration, scaled so that a constant flux of 1 leads to 1. (A slab tends to a third of its
  /// flux.)
  double advance(double flux) {
    std::array<double, volumes>& c = concentration_;
    c[volumes - 1] += 3 * flux * inflow_;
    c[0] *= inverse_[0];
    for (std::size_t k = 1; k < volumes; ++k) c[k] = (c[k] + r_ * c[k - 1]) * inverse_[k];
    for (std::size_t k = volumes - 1; k-- > 0;) c[k] += upper_[k] * c[k + 1];
    mean_ += 3 * flux * inflow_ / volumes;
    return c[volumes - 1] + 1.5 * flux / volumes - mean_;
  }

 private:
  static constexpr std::size_t volumes = 24;
  std::array<double, volumes> concentration_{}, inverse_{}, upper_{};
  double r_ = 0, inflow_ = 0, mean_ = 0;
};

/// Butler-Volmer: i = i0 (exp((1 - alpha) x) - exp(-alpha x)), x = overvoltage / thermal voltage.
class Electrode {
 public:
  explicit Electrode(double alpha) : alpha_(alpha) {}

  /// Overvoltage [V] at a current. resistance_ohm: slope of the overvoltage at zero current.
  double under_current(double current_a, double resistance_ohm) {
    const double i0 = thermal_voltage_v / resistance_ohm;
    double x = 2 * std::asinh(current_a / (2 * i0));  // exact for alpha 0.5
    for (int k = 0; k < 30; ++k) {
      const double up = std::exp((1 - alpha_) * x), down = std::exp(-alpha_ * x);
      const double change = (i0 * (up - down) - current_a) / (i0 * ((1 - alpha_) * up + alpha_ * down));
      x -= std::clamp(change, -1.0, 1.0);
      if (std::abs(change) < 1e-10) break;
    }
    return thermal_voltage_v * x;
  }

  /// Current [A] through the electrode and series_ohm when voltage_v drops across both.
  double current_at(double voltage_v, double resistance_ohm, double series_ohm) {
    const double i0 = thermal_voltage_v / resistance_ohm;
    double up = 1, down = 1;
    for (int k = 0; k < 30; ++k) {
      up = std::exp((1 - alpha_) * x_);
      down = std::exp(-alpha_ * x_);
      const double over_v = thermal_voltage_v * x_ + series_ohm * i0 * (up - down) - voltage_v;
      const double change = over_v / (thermal_voltage_v + series_ohm * i0 * ((1 - alpha_) * up + alpha_ * down));
      x_ -= std::clamp(change, -1.0, 1.0);
      if (std::abs(change) < 1e-10) break;
    }
    return i0 * (std::exp((1 - alpha_) * x_) - std::exp(-alpha_ * x_));
  }

 private:
  double alpha_;
  double x_ = 0;  ///< start of the next Newton iteration
};

/// Prandtl-Ishlinskii hysteresis as stop operators: charge minus play. At construction the cell has the history that
/// concealed_cell.hpp describes.
class StopOperators {
 public:
  StopOperators(const Hysteresis& parameters, double start_soc)
      : parameters_(parameters), stretched_(parameters.half_width) {
    const double turned = start_soc > 0.92 ? 0 : 1 - start_soc;  // charge since the cell was full
    for (double& s : stretched_) s = std::max(-s, s - turned);
  }

  void move(double soc_change) {
    for (std::size_t k = 0; k < stretched_.size(); ++k) {
      const double w = parameters_.half_width[k];
      stretched_[k] = std::clamp(stretched_[k] + soc_change, -w, w);
    }
  }

  double voltage_v(double soc) const {
    double sum = parameters_.on_discharge_branch ? 1 : 0;
    for (std::size_t k = 0; k < stretched_.size(); ++k)
      sum += parameters_.share[k] * stretched_[k] / parameters_.half_width[k];
    return sum * parameters_.half_gap_v * (1 + parameters_.tilt * (soc - 0.5));
  }

 private:
  const Hysteresis& parameters_;
  std::vector<double> stretched_;
};

}  // namespace bms::benchmark::truth
