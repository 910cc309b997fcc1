// The cell of a concealed case: a smooth 1RC cell, and each effect that a calibrated 1RC model leaves out.
//
//   V = U(z) + v1 + R0 I + effects,   dv1/dt = (I - v1 / R1) / C1,   dz/dt = I / Q,   I > 0 charges
//
// R0, R1 and C1 are smooth functions of z. The cell is integrated in substeps of at most 0.25 s with a constant
// current: v1 by the exact exponential with the parameters at the middle of the substep, or by the midpoint rule where
// it is not linear. README.md lists the equations of the effects next to the usual ones. Nothing here comes from
// model/, estimator/, inference/identification/ or inference/diagnosis/.
//
// At the start the cell is at rest: it has no overvoltage and the temperature of its surroundings. It was charged full
// before and then discharged to the start SOC. If it starts above 92 % SOC, it was charged and not discharged.
#pragma once

#include <algorithm>
#include <cstddef>
#include <functional>
#include <vector>

#include "plant/truth_cell.hpp"

namespace bms::benchmark::truth {

/// A function of SOC, tabulated every 0.05 % from -30 % to 130 %, with straight lines between and beyond.
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

/// Everything that a calibration at 25 degrees C would determine.
struct HealthyCell {
  double capacity_ah = 6;
  Curve ocv_v, r0_ohm, r1_ohm, c1_f;
  plant::Thermal thermal;
};

/// Prandtl-Ishlinskii: charge minus its play operators. A play of half width w follows the charge once it has turned by
/// 2 w.
struct Hysteresis {
  std::vector<double> half_width;  ///< fraction of the capacity
  std::vector<double> share;       ///< of the gap, sum 1
  double half_gap_v = 0;
  double tilt = 0;                   ///< the gap at soc is half_gap_v (1 + tilt (soc - 0.5))
  bool on_discharge_branch = false;  ///< U(z) is the lower branch instead of the middle
};

/// Diffusion into a slab: surface minus mean concentration, after the lag that R1 C1 already describes.
struct Diffusion {
  double resistance_ohm = 0;  ///< in the steady state
  double time_s = 1'000;      ///< thickness squared by diffusivity
  double lag_s = 20;
};

/// Three RC elements around one time constant, similar to a constant phase element.
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

/// While charging, the resistances are larger by the factor 1 + excess, with a smooth transition of width_a around
/// zero.
struct Asymmetry {
  double excess = 0;
  double width_a = 1;
};

/// R1 times f, R0 times f^share with f = exp(steepness (g(T) - g(25 degrees C))); g = 1/T (Arrhenius) or 1/(T - zero_k)
/// (Vogel, Tammann, Fulcher).
struct TemperatureLaw {
  double steepness_k = 0;
  double zero_k = 0;
  double share_of_r0 = 1;
};

/// Heat arises in the core. The can lies between core and surroundings and carries the sensor.
struct Core {
  double to_can_k_per_w = 0;  ///< 0: one thermal node
  double share_of_heat_capacity = 0.8;
  double cooling = 12;  ///< cooling of the can, as a multiple of that of the cell with one node
};

struct Leak {
  double at_3v3_a = 0;
  double per_e_v = 0.12;  ///< voltage [V] over which the current grows e-fold
};

/// The current of a leak at this voltage over that at 3.3 V.
double growth_of(const Leak& leak, double voltage_v);

/// The fraction share (0.6 + 0.8 I / (I + half_a)) of the charging current is not stored.
struct ChargeLoss {
  double share = 0;
  double half_a = 3;
};

/// U(z) read at z + slide b(z) (1 + tilt (z - 0.5)); b is 1 in the middle and 0 at both ends.
struct PlateauSlide {
  double slide = 0;
  double tilt = 0;
};

struct ResistanceGrowth {
  double of_r0 = 0, r0_tilt = 0;      ///< R0 (1 + of_r0 (1 + r0_tilt (z - 0.5)))
  double of_r1 = 0, c1_exponent = 0;  ///< C1 (1 + of_r1)^-c1_exponent
};

/// While charging, a second electrode state fills. Afterwards it empties in hold_s and holds the voltage up until it is
/// empty.
struct Plating {
  double plateau_v = 0;
  double hold_s = 2'400;
  double fill_s = 900;
  double least_a = 1;  ///< smaller charging currents do not fill it
};

/// A bump of the OCV at the SOC at which an earlier partial cycle turned. A charge from below that passes it by 12 % of
/// SOC removes it.
struct Memory {
  double bump_v = 0;
  double turned_at = 0.5;
  double width = 0.03;
};

/// Pressure follows the mean |I| of the last hour and lifts the OCV more than proportionally.
struct Pressure {
  double lift_v = 0;  ///< at a lasting C-rate of 0.5
  double time_constant_s = 3'600;
};

/// Two cells in parallel that share the capacity and the conductance unequally.
struct Parallel {
  double inequality = 0;           ///< the first cell has (1 + inequality) / 2 of the capacity
  double resistance_exponent = 1;  ///< first cell: R (1 + inequality)^exponent; second: R (1 - inequality)^exponent
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

/// current_a[k] flows from sample k - 1 to sample k. current_a[0] is 0: no interval ends at the first sample.
struct Stimulus {
  double step_s = 1;
  std::vector<double> current_a;
  std::vector<double> ambient_c;
  std::vector<double> resistance_temperature_c;  ///< if not empty: the temperature that the resistances follow
};

struct CellTrace {
  std::vector<double> voltage_v, soc, temperature_c;  ///< temperature: at the sensor
  std::vector<double> v1_v;                           ///< voltage across R1
};

/// Substeps of one sampling step: at most 0.25 s each.
int substeps_of(double step_s);

CellTrace run_cell(const HealthyCell& cell, const CellEffects& effects, const Stimulus& stimulus, double start_soc);

}  // namespace bms::benchmark::truth
