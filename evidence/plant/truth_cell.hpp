// The reference cell of the tests: estimator and identification are compared with it.
//
//   OCV      smooth in SOC along Table 9 of the paper, with rounded corners
//   circuit  d v_rc / dt = I / C1 - v_rc / (R1 C1),  V = OCV + v_rc + R0 I,  R0, R1, C1 smooth in SOC
//   thermal  one node: C dT/dt = heat - G (T - ambient)
//   cold     R0, R1 and C1 times factors that follow the temperature, if the cell is given them
//
// The differential equations are integrated by Runge-Kutta 4 in steps of at most step_s, with the parameters at the
// momentary SOC; charge is counted by compensated summation. Currents > 0 charge. Nothing here comes from model/ or
// estimator/, so that an error there cannot be repeated here. It uses no libm: with -ffp-contract=off the bits are the
// same on every machine.
#pragma once

#include <optional>

#include "plant/monotone_curve.hpp"

namespace bms::plant {

/// Open-circuit voltage [V] over SOC. It agrees with the ten lines of Table 9 within 1 mV except at the two sharp
/// corners: up to 11 mV within 2.5 % of SOC around 10 %, up to 4.5 mV within 1 % around 90 %.
MonotoneCurve table9_ocv_v();

/// Parameters over SOC. The curves pass through the values of Table 9 and are flat below 10 %. Straight lines between
/// the values differ from them by up to 3 % above 20 % SOC, and by up to 11 % (C1) below.
struct CircuitCurves {
  MonotoneCurve r0_ohm;
  MonotoneCurve r1_ohm;
  MonotoneCurve c1_f;
};
CircuitCurves table9_circuit();

/// Factors of the circuit over temperature [degrees C], 1 at 25.
struct TemperatureFactors {
  MonotoneCurve r0, r1, c1;
};
/// Of an LFP cell between -30 and 45 degrees C. Not from the paper, whose cell was measured at one temperature: steps
/// of current at eight temperatures gave R0 a constant part of 7.4 and a part of 2.4 mOhm with 0.473 eV; R1 has 0.3 eV,
/// and the time constant rises by the root of that. Tables, since the plant has no libm.
TemperatureFactors lfp_in_the_cold();

/// Not from the paper: a cell of 140 g at 1 J/(gK) between neighbours with little air; time constant 24 min.
struct Thermal {
  double heat_capacity_j_per_k = 140;
  double to_ambient_w_per_k = 0.1;
};

struct CellParameters {
  double capacity_ah = 6;
  MonotoneCurve ocv_v = table9_ocv_v();
  CircuitCurves circuit = table9_circuit();
  Thermal thermal = {};
  std::optional<TemperatureFactors> over_temperature = {};  ///< without: the same at every temperature
  double step_s = 0.05;
};

struct CellState {
  double soc = 0.5;
  double v_rc_v = 0;  ///< > 0 after charging
  double temperature_c = 20;
};

class Cell {
 public:
  Cell(CellParameters parameters, CellState start);

  /// Applies a constant current for a duration.
  void run(double current_a, double ambient_c, double duration_s);

  double soc() const { return soc_at(0); }
  double v_rc_v() const { return dynamic_.v_rc_v; }
  double temperature_c() const { return dynamic_.temperature_c; }
  /// At the terminals, under the current of the last run; at rest before the first run.
  double voltage_v() const;

 private:
  /// State of the differential equations, or its rate of change per second.
  struct DynamicState {
    double v_rc_v;
    double temperature_c;
  };
  double soc_at(double more_as) const;
  DynamicState rates(const DynamicState& at, double soc, double current_a, double ambient_c) const;
  struct Circuit {
    double r0_ohm, r1_ohm, c1_f;
  };
  Circuit circuit_at(double soc, double temperature_c) const;

  CellParameters parameters_;
  double start_soc_;
  DynamicState dynamic_;
  double current_a_ = 0;
  double charge_as_ = 0, lost_as_ = 0;  ///< since the start; lost_as_: rounding error of charge_as_
};

}  // namespace bms::plant
