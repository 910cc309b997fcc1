// The optional members of a mechanism's law, and a check that a law has exactly those that it declares.
//
// LawSet (model/law_set.hpp) calls a member only if the law has it. A misspelt member would compile and have no effect,
// so each law declares its members by name:
//
//   static constexpr LawMembers members = law_member::true_current | law_member::tables;
//
// A name that is misspelt there does not compile. A member that is declared and missing, or present and not declared,
// fails the concept MechanismLaw, which LawSet asserts.
#pragma once

#include <cstddef>
#include <cstdint>

#include "model/cell.hpp"
#include "model/one_rc.hpp"

namespace bms::model {

/// A set of law_member bits.
using LawMembers = std::uint32_t;

namespace law_member {

enum Bit : LawMembers {
  none = 0,
  true_current = 1U << 0,
  true_temperature = 1U << 1,
  counted = 1U << 2,
  ocv_soc = 1U << 3,
  ocv_soc_slope = 1U << 4,
  soc_shift_per_v = 1U << 5,
  tables = 1U << 6,
  apply_state = 1U << 7,
  reading = 1U << 8,
  states = 1U << 9,
  voltage_states = 1U << 10,
  state_unit = 1U << 11,
  initial = 1U << 12,
  relaxation = 1U << 13,
  initial_sigma_v = 1U << 14,
  steady_state_sigma_v = 1U << 15,
  resistances_follow_temperature = 1U << 16,
  at = 1U << 17,
  voltage_per_state = 1U << 18,
  most_sigma_v = 1U << 19,
};

/// The members that law L for scalar S has, with the arguments that LawSet passes.
template <class L, class S>
constexpr LawMembers found_in() {
  LawMembers found = none;
  const auto add = [&](bool has, Bit member) {
    if (has) found |= member;
  };
  add(
      requires(L l, Current<S> a) { Current<S>(l.true_current(a)); }, true_current);
  add(
      requires(L l, Temperature<S> c) { Temperature<S>(l.true_temperature(c)); }, true_temperature);
  add(
      requires(L l, Current<S> a, StepInput<S> u) { Current<S>(l.counted(a, u)); }, counted);
  add(
      requires(L l, Soc<S> soc) { Soc<S>(l.ocv_soc(soc)); }, ocv_soc);
  add(
      requires(L l, Soc<S> soc) { Coupling<S>(l.ocv_soc_slope(soc)); }, ocv_soc_slope);
  add(
      requires(L l) { Coupling<S>(l.soc_shift_per_v()); }, soc_shift_per_v);
  add(
      requires(L l, TablePoint<S> & t, Soc<S> soc, StepInput<S> u) { l.tables(t, soc, u); }, tables);
  add(
      requires(L l, TablePoint<S> & t, Voltage<S> x, StepInput<S> u) { l.apply_state(t, x, u); }, apply_state);
  add(
      requires(L l, Voltage<S> v) { Voltage<S>(l.reading(v)); }, reading);
  add(
      requires { std::size_t{L::states}; }, states);
  add(
      requires { bool{L::voltage_states}; }, voltage_states);
  add(
      requires { L::state_unit.scale; }, state_unit);
  add(
      requires(L l, std::size_t i) { Voltage<S>(l.initial(i)); }, initial);
  add(
      requires(L l, std::size_t i, TablePoint<S> t, StepInput<S> u) { l.relaxation(i, t, u).target; } ||
          requires(L l, std::size_t i, TablePoint<S> t, StepInput<S> u, const Voltage<S>* x) {
            l.relaxation(i, t, u, x).target;
          },
      relaxation);
  add(
      requires(L l) { Voltage<S>(l.initial_sigma_v()); }, initial_sigma_v);
  add(
      requires(L l) { Voltage<S>(l.steady_state_sigma_v()); }, steady_state_sigma_v);
  add(
      requires(L l) { Voltage<S>(l.most_sigma_v()); }, most_sigma_v);
  add(
      requires { bool{L::resistances_follow_temperature}; }, resistances_follow_temperature);
  add(
      requires(L & l, double time_s) { l.at(time_s); }, at);
  add(
      requires(L l, TablePoint<S> t) { Factor<S>(l.voltage_per_state(t)); }, voltage_per_state);
  return found;
}

/// Returns true if the members fit together: what concerns states needs states, and states need to start and to move.
constexpr bool complete(LawMembers members) {
  constexpr LawMembers of_states = voltage_states | state_unit | initial | relaxation | apply_state | soc_shift_per_v |
                                   initial_sigma_v | steady_state_sigma_v | most_sigma_v | voltage_per_state;
  constexpr LawMembers needed_by_states = voltage_states | initial | relaxation;
  const bool has_states = (members & states) != 0;
  if (!has_states) return (members & of_states) == 0;
  return (members & needed_by_states) == needed_by_states;
}

}  // namespace law_member

/// A law whose declared members are the members that it has.
template <class L, class S>
concept MechanismLaw = requires {
  LawMembers{L::members};
}
&&L::members == law_member::found_in<L, S>() && law_member::complete(L::members);

}  // namespace bms::model
