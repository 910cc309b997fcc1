// The cell of a concealed case: a smooth 1RC cell and, switched on one by one, what a calibrated 1RC model leaves out.
//
//   V = U(z) + v1 + R0 I + what the effects add,   dv1/dt = (I - v1 / R1) / C1,   dz/dt = I / Q,   I > 0 charges
//
// R0, R1, C1 are smooth in z. Integrated in substeps of at most 0.25 s during which the current stands still: v1 by the
// exact exponential with the parameters of the middle of the substep, or by the midpoint rule where it is not linear.
// The equations of the effects are listed in README.md beside the usual ones. Nothing here comes from model/,
// estimator/, identification/ or diagnosis/.
//
// At the start the cell is rested (no overvoltage anywhere, as warm as its surroundings) and has a history: charged
// full, then discharged to the start soc; where it starts above 92 % it comes from charging and has not been
// discharged.
#pragma once

#include <algorithm>
#include <cstddef>
#include <functional>
#include <vector>

#include "plant/truth_cell.hpp"

namespace bms::benchmark::truth {

/// A function of soc, tabulated every 0.05 % from -30 % to 130 %, straight in between and beyond.
class Curve {
 public:
  Curve() : Curve([](double) { return 0.0; }) {}
  explicit Curve(const std::function<double(double)>& function);

  double at(double soc) const {
    const double place = (soc - first) / step;
    const std::size_t k = place <= 0 ? 0 : std::min(static_cast<std::size_t>(place), cells - 1);
    return value_[k] + (place - static_cast<double>(k)) * (value_[k + 1] - value_[k]);
  }
  double slope_at(double soc) const { return (at(soc + 0.002) - at(soc - 0.002)) / 0.004; }

 private:
  static constexpr double first = -0.3, step = 0.0005;
  static constexpr std::size_t cells = 3'200;
  std::vector<double> value_;
};

/// All that a calibration at 25 degrees C would find out.
struct HealthyCell {
  double capacity_ah = 6;
  Curve ocv_v, r0_ohm, r1_ohm, c1_f;
  plant::Thermal thermal;
};

/// Prandtl-Ishlinskii: charge less its play operators. A play of half width w follows the charge once it has turned by
/// 2 w.
struct Hysteresis {
  std::vector<double> half_width;  ///< fraction of the capacity
  std::vector<double> share;       ///< of the gap, sum 1
  double half_gap_v = 0;
  double tilt = 0;                   ///< the gap at soc: half_gap_v (1 + tilt (soc - 0.5))
  bool on_discharge_branch = false;  ///< U(z) is the lower branch instead of the middle
};

/// Diffusion into a slab: surface less mean concentration, after the lag that R1 C1 has already answered for.
struct Diffusion {
  double resistance_ohm = 0;  ///< in the steady state
  double time_s = 1'000;      ///< thickness squared by diffusivity
  double lag_s = 20;
};

/// Three RC elements around one time constant, as a constant phase element has them.
struct FastElement {
  double resistance_ohm = 0;
  double time_s = 1;
  double spread = 2.8;  ///< ratio of neighbouring time constants
};

/// A share of R0 and R1 is a Butler-Volmer electrode of the same resistance at small currents.
struct ChargeTransfer {
  double share_of_r0 = 0, share_of_r1 = 0;
  double alpha = 0.5;
};

/// Resistances of a charging cell times 1 + excess, with a smooth passage over width_a around zero.
struct Asymmetry {
  double excess = 0;
  double width_a = 1;
};

/// R1 times f, R0 times f^share: f = exp(steepness (g(T) - g(25 degrees C))), g = 1/T (Arrhenius) or 1/(T - zero_k)
/// (VTF).
struct TemperatureLaw {
  double steepness_k = 0;
  double zero_k = 0;
  double share_of_r0 = 1;
};

/// Heat arises in the core; the can between core and surroundings is what carries the sensor.
struct Core {
  double to_can_k_per_w = 0;  ///< 0: one node
  double share_of_heat_capacity = 0.8;
  double cooling = 12;  ///< the can is cooled so many times better than the cell of one node
};

struct Leak {
  double at_3v3_a = 0;
  double per_e_v = 0.12;  ///< [V] in which it grows e-fold
};

/// Of the charging current the share loss (0.6 + 0.8 I / (I + half_a)) is not stored.
struct ChargeLoss {
  double share = 0;
  double half_a = 3;
};

/// U(z) read at z + slide b(z) (1 + lean (z - 0.5)), b = 1 in the middle and 0 at both ends.
struct PlateauSlide {
  double slide = 0;
  double lean = 0;
};

struct ResistanceGrowth {
  double of_r0 = 0, r0_lean = 0;     ///< R0 (1 + of_r0 (1 + r0_lean (z - 0.5)))
  double of_r1 = 0, c1_answers = 0;  ///< C1 (1 + of_r1)^-c1_answers
};

/// While charging a second electrode state fills; afterwards it empties in hold_s and holds the voltage up until it is
/// empty.
struct Plating {
  double plateau_v = 0;
  double hold_s = 2'400;
  double fill_s = 900;
  double least_a = 1;  ///< smaller charging currents do not fill it
};

/// A bump of the OCV where the cell turned round in an earlier partial cycle; gone once a charge from below has passed
/// it by 12 % of soc.
struct Memory {
  double bump_v = 0;
  double turned_at = 0.5;
  double width = 0.03;
};

/// Pressure follows the mean |I| of the last hour and lifts the OCV, more than proportionally.
struct Pressure {
  double lift_v = 0;  ///< at a lasting C-rate of 0.5
  double time_constant_s = 3'600;
};

/// Two cells in parallel that share the capacity and the conductance unequally.
struct Parallel {
  double inequality = 0;  ///< first has (1 + inequality) / 2 of the capacity
  double resistance_exponent =
      1;  ///< R of the first (1 + inequality)^exponent, of the second (1 - inequality)^exponent
};

struct CellEffects {
  double capacity_factor = 1;
  Hysteresis hysteresis;
  Diffusion diffusion;
  FastElement fast;
  ChargeTransfer charge_transfer;
  Asymmetry asymmetry;
  TemperatureLaw temperature_law;
  Core core;
  Leak leak;
  ChargeLoss charge_loss;
  PlateauSlide plateau_slide;
  ResistanceGrowth growth;
  Plating plating;
  Memory memory;
  Pressure pressure;
  Parallel parallel;
  Curve entropy_v_per_k;
  double entropy_scale = 0;
  double contact_scale = 0;
  std::vector<double> contact_ohm;  ///< per sample, times contact_scale, in series
};

/// current_a[k] flows from sample k - 1 to sample k. current_a[0] should be 0: there is nothing before.
struct Stimulus {
  double step_s = 1;
  std::vector<double> current_a;
  std::vector<double> ambient_c;
  std::vector<double> resistance_temperature_c;  ///< if not empty: the temperature that the resistances follow
};

struct CellTrace {
  std::vector<double> voltage_v, soc, temperature_c;  ///< temperature where the sensor sits
  std::vector<double> v1_v;                           ///< over R1
};

CellTrace run_cell(const HealthyCell& cell, const CellEffects& effects, const Stimulus& stimulus, double start_soc);

}  // namespace bms::benchmark::truth
