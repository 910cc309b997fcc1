#include "plant/circuit/circuit.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cassert>
#include <cmath>
#include <numbers>

namespace bms::plant {

namespace {

constexpr double gamma = 1 - std::numbers::sqrt2 / 2;
/// For the state right after a switch has moved: so short that no capacitor changes its voltage.
constexpr double instant_s = 1e-12;
/// Steps are whole multiples of it, so that sums of times with rounding errors find the stored factors.
constexpr double tick_s = 1e-10;
/// Above the rounding errors, so that a diode without current and voltage does not turn on and off.
constexpr double zero_a = 1e-9, zero_v = 1e-9;
constexpr int most_diode_turns = 40;
constexpr std::size_t most_stored = 512;

}  // namespace

std::size_t Circuit::insert(const Element& element) {
  elements_.push_back(element);
  Element& added = elements_.back();
  if (added.kind == Kind::ideal_source) added.bit = ideal_sources_++;
  if (added.kind == Kind::contact || added.kind == Kind::diode) {
    assert(bits_ < 64);
    added.bit = bits_++;
    if (added.closed) state_ |= std::uint64_t{1} << added.bit;
  }
  stored_.clear();
  return elements_.size() - 1;
}

std::size_t Circuit::add(const Branch& b) {
  Element element;
  element.from = b.from;
  element.to = b.to;
  element.on_ohm = b.resistance_ohm;
  element.capacitance_f = b.capacitance_f;
  element.inductance_h = b.inductance_h;
  element.emf_v = b.emf_v;
  element.capacitor_v = b.capacitor_v;
  element.inductor_a = b.inductor_a;
  if (b.resistance_ohm == 0 && !element.stores()) element.kind = Kind::ideal_source;
  return insert(element);
}

std::size_t Circuit::add(const Switch& contact) {
  Element element;
  element.kind = Kind::contact;
  element.from = contact.from;
  element.to = contact.to;
  element.on_ohm = contact.on_ohm;
  element.off_ohm = contact.off_ohm;
  element.closed = contact.closed;
  return insert(element);
}

std::size_t Circuit::add(const Diode& diode) {
  Element element;
  element.kind = Kind::diode;
  element.from = diode.from;
  element.to = diode.to;
  element.on_ohm = diode.on_ohm;
  element.off_ohm = diode.off_ohm;
  element.emf_v = diode.forward_v;
  element.closed = false;
  return insert(element);
}

std::size_t Circuit::add_current_source(std::size_t from, std::size_t to) {
  Element element;
  element.kind = Kind::current_source;
  element.from = from;
  element.to = to;
  return insert(element);
}

void Circuit::set_resistance_ohm(std::size_t branch, double ohm) {
  elements_[branch].on_ohm = ohm;
  stored_.clear();
  stored_count_ = 0;
}

void Circuit::set_closed(std::size_t branch, bool closed) {
  Element& element = elements_[branch];
  if (element.closed == closed) return;
  element.closed = closed;
  state_ ^= std::uint64_t{1} << element.bit;
  next_s_ = shortest_s_;
}

void Circuit::set_steps(double shortest_s, double longest_s, double tolerance_v) {
  shortest_s_ = shortest_s;
  longest_s_ = longest_s;
  tolerance_v_ = tolerance_v;
  next_s_ = shortest_s;
}

double Circuit::across_v(std::size_t branch) const {
  return voltage_v(elements_[branch].from) - voltage_v(elements_[branch].to);
}

double Circuit::conductance_s(const Element& element, double step_s) const {
  if (element.kind == Kind::current_source || element.kind == Kind::ideal_source) return 0;
  if (!element.closed) return 1 / element.off_ohm;
  double ohm = element.on_ohm;
  if (element.capacitance_f > 0) ohm += gamma * step_s / element.capacitance_f;
  if (element.inductance_h > 0) ohm += element.inductance_h / (gamma * step_s);
  return 1 / ohm;
}

Circuit::Factors Circuit::factorise(double step_s) const {
  const auto size = static_cast<Eigen::Index>(unknowns());
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(size, size);
  const auto add = [&](std::size_t row, std::size_t column, double value) {
    if (row == ground || column == ground) return;
    matrix(static_cast<Eigen::Index>(row - 1), static_cast<Eigen::Index>(column - 1)) += value;
  };
  Factors result;
  result.step_s = step_s;
  for (const Element& element : elements_) {
    const double g = conductance_s(element, step_s);
    result.conductance_s.push_back(g);
    add(element.from, element.from, g);
    add(element.to, element.to, g);
    add(element.from, element.to, -g);
    add(element.to, element.from, -g);
    if (element.kind != Kind::ideal_source) continue;
    const std::size_t row = nodes_ + element.bit;
    add(element.from, row, 1);
    add(element.to, row, -1);
    add(row, element.from, 1);
    add(row, element.to, -1);
  }
  const Eigen::PartialPivLU<Eigen::MatrixXd> lu(matrix);
  for (Eigen::Index row = 0; row < size; ++row) {
    for (Eigen::Index column = 0; column < size; ++column) result.lu.push_back(lu.matrixLU()(row, column));
    result.inverse_pivot.push_back(1 / lu.matrixLU()(row, row));
  }
  result.row.resize(unknowns());
  for (Eigen::Index row = 0; row < size; ++row) {
    result.row[static_cast<std::size_t>(lu.permutationP().indices()(row))] = static_cast<std::size_t>(row);
  }
  return result;
}

const Circuit::Factors& Circuit::factors(double step_s) {
  const std::vector<Factors>& known = stored_[state_];
  const auto same = std::find_if(known.begin(), known.end(), [&](const Factors& f) { return f.step_s == step_s; });
  if (same != known.end()) return *same;
  if (++stored_count_ > most_stored) {
    stored_.clear();
    stored_count_ = 1;
  }
  ++factorisations_;
  return stored_[state_].emplace_back(factorise(step_s));
}

/// Voltage of a branch without current at this stage, seen through its conductance.
double Circuit::source_v(const Element& element, double step_s, bool second) const {
  if (!element.closed) return 0;
  double v = element.emf_v;
  if (element.capacitance_f > 0) {
    v += element.capacitor_v;
    if (second) v += (1 - gamma) * step_s * element.first_stage_a / element.capacitance_f;
  }
  if (element.inductance_h > 0) {
    const double ohm = element.inductance_h / (gamma * step_s);
    v -= ohm * element.inductor_a;
    if (second) v -= (1 - gamma) / gamma * ohm * (element.first_stage_a - element.inductor_a);
  }
  return v;
}

void Circuit::solve_stage(const Factors& f, bool second) {
  const std::size_t size = unknowns();
  right_side_.assign(nodes_ + ideal_sources_, 0);  // entry 0, ground, is not used
  for (std::size_t k = 0; k < elements_.size(); ++k) {
    const Element& element = elements_[k];
    if (element.kind == Kind::ideal_source) {
      right_side_[nodes_ + element.bit] = element.emf_v;
      continue;
    }
    const double current = element.kind == Kind::current_source
                               ? -element.current_a
                               : f.conductance_s[k] * source_v(element, f.step_s, second);
    right_side_[element.from] += current;
    right_side_[element.to] -= current;
  }
  potentials_.resize(size);
  for (std::size_t row = 0; row < size; ++row) {
    double sum = right_side_[f.row[row] + 1];
    for (std::size_t column = 0; column < row; ++column) sum -= f.lu[row * size + column] * potentials_[column];
    potentials_[row] = sum;
  }
  for (std::size_t row = size; row-- > 0;) {
    double sum = potentials_[row];
    for (std::size_t column = row + 1; column < size; ++column) sum -= f.lu[row * size + column] * potentials_[column];
    potentials_[row] = sum * f.inverse_pivot[row];
  }
  for (std::size_t k = 0; k < elements_.size(); ++k) {
    Element& element = elements_[k];
    if (element.kind == Kind::current_source) continue;
    if (element.kind == Kind::ideal_source) {
      element.current_a = potentials_[nodes_ - 1 + element.bit];
      continue;
    }
    element.current_a =
        f.conductance_s[k] * (voltage_v(element.from) - voltage_v(element.to) - source_v(element, f.step_s, second));
  }
}

bool Circuit::turn_diodes() {
  bool turned = false;
  for (Element& element : elements_) {
    if (element.kind != Kind::diode) continue;
    const double across_v = voltage_v(element.from) - voltage_v(element.to);
    const bool conducts = element.closed ? element.current_a > -zero_a : across_v > element.emf_v + zero_v;
    if (conducts == element.closed) continue;
    element.closed = conducts;
    state_ ^= std::uint64_t{1} << element.bit;
    turned = true;
  }
  return turned;
}

double Circuit::slope_change_v(double step_s) const {
  double worst_v = 0;
  for (const Element& element : elements_) {
    if (element.capacitance_f == 0) continue;
    worst_v = std::max(worst_v, std::abs(element.current_a - element.first_stage_a) * step_s / element.capacitance_f);
  }
  return worst_v;
}

void Circuit::accept(double step_s) {
  for (Element& element : elements_) {
    const double first = element.kind == Kind::current_source ? element.current_a : element.first_stage_a;
    const double second = element.current_a;
    const double charge_as = step_s * ((1 - gamma) * first + gamma * second);
    element.charge_as += charge_as;
    const double ohm = element.closed ? element.on_ohm : element.off_ohm;
    element.heat_j += step_s * ohm * ((1 - gamma) * first * first + gamma * second * second);
    if (element.capacitance_f > 0) element.capacitor_v += charge_as / element.capacitance_f;
    if (element.inductance_h > 0) element.inductor_a = second;
  }
  time_s_ += step_s;
  ++steps_;
}

double Circuit::step(double limit_s) {
  double step_s = std::min(next_s_, std::max(1.0, std::round(limit_s / tick_s)) * tick_s);
  for (int turns = 0;;) {
    const Factors& f = factors(step_s);
    solve_stage(f, false);
    for (Element& element : elements_) element.first_stage_a = element.current_a;
    solve_stage(f, true);
    const bool shortest = step_s <= shortest_s_;
    if (turns < most_diode_turns && turn_diodes()) {
      ++turns;
      if (!shortest) next_s_ = step_s = std::max(step_s / 2, shortest_s_);
      continue;
    }
    const double error_v = slope_change_v(step_s);
    if (error_v > tolerance_v_ && !shortest) {
      next_s_ = step_s = std::max(step_s / 2, shortest_s_);
      continue;
    }
    if (4 * error_v < tolerance_v_ && step_s >= next_s_) next_s_ = std::min(2 * next_s_, longest_s_);
    break;
  }
  accept(step_s);
  return step_s;
}

void Circuit::advance(double duration_s) {
  const double end_s = time_s_ + duration_s;
  for (double rest_s = duration_s; rest_s > tick_s; rest_s = end_s - time_s_) step(rest_s);
}

void Circuit::solve_now() {
  for (int turns = 0; turns < most_diode_turns; ++turns) {
    solve_stage(factors(instant_s), false);
    if (!turn_diodes()) return;
  }
}

}  // namespace bms::plant
