#include "plant/circuit/cell_string.hpp"

#include <cmath>
#include <utility>

namespace bms::plant {

namespace {

constexpr double table9_ah = 6;
constexpr double linear_soc = 1e-3;

}  // namespace

CellString::CellString(const std::vector<StringCell>& cells, MonotoneCurve ocv_v) : ocv_curve_(std::move(ocv_v)) {
  for (const StringCell& cell : cells) {
    cells_.push_back({.capacity_as = 3'600 * cell.capacity_ah,
                      .soc = cell.soc,
                      .v_rc_v = cell.v_rc_v,
                      .resistance_factor = cell.resistance_factor,
                      .scale = table9_ah / cell.capacity_ah});
  }
  linearise();
}

void CellString::linearise() {
  r0_ohm_ = 0;
  for (Cell& cell : cells_) {
    const double ohm = cell.scale * cell.resistance_factor;
    cell.at_soc = cell.soc;
    cell.ocv_v = ocv_curve_.at(cell.soc);
    cell.slope_v = (ocv_curve_.at(cell.soc + linear_soc) - ocv_curve_.at(cell.soc - linear_soc)) / (2 * linear_soc);
    cell.r0_ohm = ohm * curves_.r0_ohm.at(cell.soc);
    cell.r1_ohm = ohm * curves_.r1_ohm.at(cell.soc);
    cell.c1_f = curves_.c1_f.at(cell.soc) / cell.scale;
    r0_ohm_ += cell.r0_ohm;
  }
  sum_up();
}

void CellString::sum_up() { emf_v_ = emf_v(cells_.size()); }

double CellString::emf_v(std::size_t cells) const {
  double sum_v = 0;
  for (std::size_t k = 0; k < cells; ++k)
    sum_v += ocv_v(cells_[k]) + cells_[k].v_rc_v - cells_[k].r0_ohm * cells_[k].bleeding_a;
  return sum_v;
}

double CellString::resistance_ohm(std::size_t cells) const {
  double sum_ohm = 0;
  for (std::size_t k = 0; k < cells; ++k) sum_ohm += cells_[k].r0_ohm;
  return sum_ohm;
}

bool CellString::advance(double current_a, double duration_s) {
  bool moved = false;
  for (Cell& cell : cells_) {
    if (cell.bleeding_s > 0) {
      cell.bleeding_a = cell.bleeding_s * (ocv_v(cell) + cell.v_rc_v + cell.r0_ohm * (current_a - cell.bleeding_a));
    } else {
      cell.bleeding_a = 0;
    }
    const double into_a = current_a - cell.bleeding_a;
    cell.soc += into_a * duration_s / cell.capacity_as;
    // backward Euler; a step is at most 1 ms, the time constant 10 s
    cell.v_rc_v = (cell.v_rc_v + duration_s * into_a / cell.c1_f) / (1 + duration_s / (cell.r1_ohm * cell.c1_f));
    moved = moved || std::abs(cell.soc - cell.at_soc) > linear_soc;
  }
  if (moved) {
    linearise();
  } else {
    sum_up();
  }
  return moved;
}

double CellString::voltage_v(std::size_t cell, double current_a) const {
  const Cell& c = cells_[cell];
  return ocv_v(c) + c.v_rc_v + c.r0_ohm * (current_a - c.bleeding_a);
}

void CellString::set_soc(std::size_t cell, double soc) {
  cells_[cell].soc = soc;
  linearise();
}

}  // namespace bms::plant
