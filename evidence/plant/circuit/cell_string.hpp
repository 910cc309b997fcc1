// Cells in series as one source for the circuit: v = emf + R i, and the state of each cell behind it.
//
//   cell k   v = OCV(SOC) + v_rc + R0 i,  C1 dv_rc/dt = i - v_rc / R1,  i = current of the string - bleeding current
//
// The curves are those of evidence/plant/truth_cell (Table 9 of the paper, 6 Ah), with resistances scaled by 6 Ah /
// capacity and capacitances by its inverse. A current > 0 charges. OCV is linearised over SOC and the parameters are
// constant until the charge has changed by 0.1 % of the capacity. The cells are isothermal.
#pragma once

#include <cstddef>
#include <vector>

#include "plant/truth_cell.hpp"

namespace bms::plant {

struct StringCell {
  double capacity_ah = 200;
  double soc = 0.5;
  double resistance_factor = 1;
  double v_rc_v = 0;
};

class CellString {
 public:
  explicit CellString(const std::vector<StringCell>& cells, MonotoneCurve ocv_v = table9_ocv_v());

  std::size_t size() const { return cells_.size(); }
  double emf_v() const { return emf_v_; }  ///< with the voltages of the RC branches and of bleeding
  double resistance_ohm() const { return r0_ohm_; }
  /// The same of the lowest cells.
  double emf_v(std::size_t cells) const;
  double resistance_ohm(std::size_t cells) const;
  /// Returns true if the resistance has changed.
  bool advance(double current_a, double duration_s);
  void set_bleeding_ohm(std::size_t cell, double ohm) { cells_[cell].bleeding_s = 1 / ohm; }  ///< infinite: off

  double voltage_v(std::size_t cell, double current_a) const;
  double soc(std::size_t cell) const { return cells_[cell].soc; }
  void set_soc(std::size_t cell, double soc);

 private:
  struct Cell {
    double capacity_as, soc, v_rc_v, resistance_factor, scale;
    double bleeding_s = 0, bleeding_a = 0;
    double at_soc = 0, ocv_v = 0, slope_v = 0, r0_ohm = 0, r1_ohm = 0, c1_f = 0;  ///< where OCV is linearised
  };
  double ocv_v(const Cell& cell) const { return cell.ocv_v + cell.slope_v * (cell.soc - cell.at_soc); }
  void linearise();
  void sum_up();

  MonotoneCurve ocv_curve_;
  CircuitCurves curves_ = table9_circuit();
  std::vector<Cell> cells_;
  double emf_v_ = 0, r0_ohm_ = 0;
};

}  // namespace bms::plant
