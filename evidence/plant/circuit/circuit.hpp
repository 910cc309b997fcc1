// Transients of a linear circuit with switches and diodes, by modified nodal analysis.
//
// Every two-terminal element is a branch: a source, a resistor, a capacitor and an inductor in series, each of which
// may be missing. With the current i from `from` to `to`:
//
//   v_from - v_to = emf + R i + v_C + L di/dt,   C dv_C/dt = i
//
// A step of the length h has the two stages of Alexander's diagonally implicit Runge-Kutta method (gamma = 1 - 1/sqrt
// 2, SIAM J. Numer. Anal. 14 (1977) 1006). It has order 2 and is L-stable: a jump at a switch does not ring. Both
// stages use the same matrix, which has one row per node and one per ideal voltage source. Its LU factors are stored
// per switch state and step length.
//
// The step adapts itself: 10 us after a switch has moved, up to 1 ms when the capacitor voltages change slowly.
// A diode is a switch with a forward voltage; a step in which it turns is repeated with the new state.
// Ground is node 0. Every node needs a path to ground, if only through an open switch.
#pragma once

#include <cstddef>
#include <cstdint>
#include <unordered_map>
#include <vector>

namespace bms::plant {

struct Branch {
  std::size_t from = 0, to = 0;
  double resistance_ohm = 0;
  double capacitance_f = 0;  ///< 0: no capacitor
  double inductance_h = 0;   ///< 0: no inductor
  double emf_v = 0;          ///< > 0: `from` is the positive terminal
  double capacitor_v = 0;    ///< at the start
  double inductor_a = 0;     ///< at the start
};

struct Switch {
  std::size_t from = 0, to = 0;
  double on_ohm = 1e-3, off_ohm = 1e10;
  bool closed = false;
};

/// Conducts from `from` to `to` above its forward voltage.
struct Diode {
  std::size_t from = 0, to = 0;
  double forward_v = 0, on_ohm = 1e-3, off_ohm = 1e10;
};

class Circuit {
 public:
  static constexpr std::size_t ground = 0;

  /// Returns the number of the new node.
  std::size_t add_node() { return nodes_++; }
  /// The four return the number of the branch, with which its value is changed and read. At most 64 switches and
  /// diodes.
  std::size_t add(const Branch& branch);
  std::size_t add(const Switch& contact);
  std::size_t add(const Diode& diode);
  std::size_t add_current_source(std::size_t from, std::size_t to);

  void set_emf_v(std::size_t branch, double emf_v) {
    elements_[branch].emf_v = emf_v;
  }  ///< of a diode: forward voltage
  void set_source_a(std::size_t branch, double current_a) { elements_[branch].current_a = current_a; }
  /// Discards the stored factors.
  void set_resistance_ohm(std::size_t branch, double ohm);
  void set_closed(std::size_t branch, bool closed);
  /// Shortest and longest step, and the change of a capacitor's slope within a step [V] that shortens it.
  void set_steps(double shortest_s, double longest_s, double tolerance_v);

  /// One step of at most limit_s; returns its length.
  double step(double limit_s);
  void advance(double duration_s);
  /// Voltages and currents right after a switch or a source has changed; capacitors and inductors keep their state.
  void solve_now();

  double voltage_v(std::size_t node) const { return node == ground ? 0 : potentials_[node - 1]; }
  double across_v(std::size_t branch) const;
  double current_a(std::size_t branch) const { return elements_[branch].current_a; }
  double capacitor_v(std::size_t branch) const { return elements_[branch].capacitor_v; }
  bool closed(std::size_t branch) const { return elements_[branch].closed; }
  double charge_as(std::size_t branch) const { return elements_[branch].charge_as; }  ///< since the start
  double heat_j(std::size_t branch) const { return elements_[branch].heat_j; }  ///< in its resistance, since the start
  double time_s() const { return time_s_; }
  std::size_t steps() const { return steps_; }
  std::size_t factorisations() const { return factorisations_; }

 private:
  enum class Kind { passive, ideal_source, current_source, contact, diode };
  struct Element {
    Kind kind = Kind::passive;
    std::size_t from = 0, to = 0;
    double on_ohm = 0, off_ohm = 0, capacitance_f = 0, inductance_h = 0, emf_v = 0;
    bool closed = true;
    std::size_t bit = 0;  ///< of a switch or a diode in the key of the stored factors; of an ideal source its row
    double capacitor_v = 0, inductor_a = 0, current_a = 0, charge_as = 0, heat_j = 0;
    double first_stage_a = 0;  ///< current at the first stage of the step
    bool stores() const { return capacitance_f > 0 || inductance_h > 0; }
  };
  struct Factors {
    double step_s = 0;
    std::vector<double> lu, inverse_pivot, conductance_s;
    std::vector<std::size_t> row;
  };

  std::size_t insert(const Element& element);
  std::size_t unknowns() const { return nodes_ - 1 + ideal_sources_; }
  double conductance_s(const Element& element, double step_s) const;
  Factors factorise(double step_s) const;
  const Factors& factors(double step_s);
  double source_v(const Element& element, double step_s, bool second) const;
  void solve_stage(const Factors& factors, bool second);
  bool turn_diodes();
  double slope_change_v(double step_s) const;
  void accept(double step_s);

  std::size_t nodes_ = 1, ideal_sources_ = 0, bits_ = 0;
  std::vector<Element> elements_;
  std::vector<double> potentials_, right_side_;
  std::uint64_t state_ = 0;  ///< closed switches and conducting diodes
  std::unordered_map<std::uint64_t, std::vector<Factors>> stored_;
  std::size_t stored_count_ = 0, steps_ = 0, factorisations_ = 0;
  double shortest_s_ = 1e-5, longest_s_ = 1e-3, tolerance_v_ = 1e-3;
  double next_s_ = 1e-5, time_s_ = 0;
};

}  // namespace bms::plant
