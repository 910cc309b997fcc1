// The 1RC model with a set of mechanisms, open loop: for the simulation, the diagnosis and its fits.
//
//   Laws<S, M...>        the mechanisms of a cell known at compile time, all acting (firmware)
//   ChosenLaws<S>        any of the catalogue, chosen at run time (host)
//
// Both call the same laws in the same order, that of model/catalogue.hpp, with the same results. A call that no law of
// the set has costs nothing in Laws and one `if` per mechanism in ChosenLaws.
#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <optional>
#include <span>
#include <tuple>

#include "model/catalogue.hpp"
#include "model/law_set.hpp"
#include "model/one_rc.hpp"

namespace bms::model {

/// The mechanism with this index in the catalogue.
template <std::size_t index>
using MechanismAt = std::tuple_element_t<index, Catalogue>;

template <class S, class... M>
using Laws = LawSet<S, typename M::template Law<S>...>;

namespace extended_detail {

/// Takes the place of a law that needs an FPU where the scalar is fixed point.
struct NoLaw {
  static constexpr LawMembers members = law_member::none;
  template <class... Any>
  constexpr explicit NoLaw(const Any&...) {}
};

template <class S, class M>
struct LawFor {
  using type = typename M::template Law<S>;
};
template <class S, class M>
requires(std::same_as<S, FixedPoint>&& requires { M::needs_fpu; }) struct LawFor<S, M> {
  using type = NoLaw;
};

template <class S, class List>
struct Chosen;
template <class S, class... M>
struct Chosen<S, std::tuple<M...>> {
  using type = LawSet<S, std::optional<typename LawFor<S, M>::type>...>;
};

/// Laws whose states add to the voltage come before laws with other states, so that the filter's states come first.
template <class... M>
constexpr bool voltage_states_first(std::tuple<M...>*) {
  bool others = false, good = true;
  const auto see = [&](bool has_states, bool adds) {
    if (has_states && !adds) others = true;
    if (adds && others) good = false;
  };
  (see(states_of<typename M::template Law<double>>() > 0, adds_voltage<typename M::template Law<double>>()), ...);
  return good;
}
static_assert(voltage_states_first(static_cast<Catalogue*>(nullptr)));

}  // namespace extended_detail

template <class S>
using ChosenLaws = typename extended_detail::Chosen<S, Catalogue>::type;

/// Values of a mechanism's parameters, in the order of its info. Unused places are 0.
template <class Real = double>
using MechanismValues = std::array<Real, max_mechanism_parameters>;

/// One mechanism as a cell file states it.
struct MechanismSetting {
  std::size_t index = 0;  ///< in the catalogue
  MechanismValues<> value{};
  MechanismValues<> deviation{};  ///< standard deviations; 0: unknown, or the value was given
  constexpr bool operator==(const MechanismSetting&) const = default;
};

/// Index of the first parameter whose value is outside its bounds or whose standard deviation is invalid; the number of
/// parameters if all are valid.
constexpr std::size_t first_fault(const MechanismSetting& setting, double capacity_ah) {
  const MechanismInfo& info = catalogue[setting.index];
  std::size_t k = 0;
  for (; k < info.parameters; ++k) {
    const double v = setting.value[k], deviation = setting.deviation[k];
    if (!(v >= info.parameter[k].lower(capacity_ah) && v <= info.parameter[k].upper(capacity_ah)) ||
        !(deviation >= 0 && deviation < 1e300))
      break;
  }
  return k;
}

/// All parameters at their default values: the mechanism has no effect.
template <class Real>
constexpr MechanismSetting default_setting(std::size_t index, const CellParameters<Real>& cell) {
  MechanismSetting setting{index, {}, {}};
  for (std::size_t k = 0; k < catalogue[index].parameters; ++k) {
    const Parameter& p = catalogue[index].parameter[k];
    setting.value[k] = p.is_reference_temperature ? cell.reference_temperature_c : p.default_value(cell.capacity_ah);
  }
  return setting;
}

namespace extended_detail {

template <class S, class Real, std::size_t K>
constexpr void choose_at(ChosenLaws<S>& laws, std::size_t index, const MechanismValues<Real>& values,
                         double capacity_ah) {
  if constexpr (K < mechanism_count) {
    if (index != K) return choose_at<S, Real, K + 1>(laws, index, values, capacity_ah);
    using M = std::tuple_element_t<K, Catalogue>;
    std::array<Real, M::parameters.size()> own{};
    for (std::size_t i = 0; i < own.size(); ++i) own[i] = values[i];
    laws.template slot<K>().emplace(own, capacity_ah);
  }
}

}  // namespace extended_detail

/// Adds the mechanism with this index in the catalogue, or replaces its parameters.
template <class S, class Real>
constexpr void choose(ChosenLaws<S>& laws, std::size_t index, const MechanismValues<Real>& values, double capacity_ah) {
  extended_detail::choose_at<S, Real, 0>(laws, index, values, capacity_ah);
}

/// The laws of all mechanisms of a cell file.
template <class S>
constexpr ChosenLaws<S> chosen(std::span<const MechanismSetting> settings, double capacity_ah) {
  ChosenLaws<S> laws;
  for (const MechanismSetting& m : settings) choose<S, double>(laws, m.index, m.value, capacity_ah);
  return laws;
}

/// The tables for a dual number; the tables themselves are constants.
template <Dual S>
TablePoint<S> look_up_dual(const Cell<double, max_intervals>& cell, const S& soc, std::uint8_t& interval) {
  const TablePoint<double> p = look_up(cell, soc.a, interval);
  const auto line = [&](double value, double delta) {
    S v(value);
    v.v = soc.v * (delta * p.per_width);
    return v;
  };
  return {.per_width = S(p.per_width),
          .ocv_v = line(p.ocv_v, p.ocv_delta_v),
          .ocv_delta_v = S(p.ocv_delta_v),
          .r0_ohm = line(p.r0_ohm, p.r0_delta_ohm),
          .r0_delta_ohm = S(p.r0_delta_ohm),
          .r1_ohm = line(p.r1_ohm, p.r1_delta_ohm),
          .r1_delta_ohm = S(p.r1_delta_ohm),
          .c1_f = line(p.c1_f, p.c1_delta_f),
          .c1_delta_f = S(p.c1_delta_f),
          .gap = line(p.gap, p.gap_delta),
          .gap_delta = S(p.gap_delta)};
}

/// Open-loop simulation of a cell over a recording. S: double or a dual number.
template <class S>
class OpenLoopSimulation {
 public:
  using Tables = Cell<double, max_intervals>;

  OpenLoopSimulation(const Tables& cell, double capacity_ah, const ChosenLaws<S>& laws, const S& initial_soc)
      : cell_(cell), per_capacity_(1 / (3'600 * capacity_ah)), laws_(laws), soc_(initial_soc), x_(laws_.initial()) {}

  /// One row: duration_s since the row before (0: the state stays), the current that was read (without delay), the
  /// temperature (NaN if missing). adjust(TablePoint&, soc): further changes of the tables. Returns the voltage that
  /// the sensor would read.
  template <class Adjust>
  S step(double time_s, double duration_s, const S& read_a, const S& read_c, Adjust&& adjust) {
    laws_.at(time_s);
    const StepInput<S> input{laws_.true_current(read_a), S(duration_s), laws_.true_temperature(read_c)};
    const bool moving = duration_s > 0;
    soc_ += laws_.counted(input) * (duration_s * per_capacity_);
    limit_soc();
    TablePoint<S> at = tables_at(soc_);
    const S elsewhere = laws_.ocv_soc(soc_, x_);
    if (differs(elsewhere, soc_)) {
      const TablePoint<S> there = tables_at(elsewhere);
      at.ocv_v = there.ocv_v;
    }
    adjust(at, soc_);
    laws_.tables(at, soc_, input, x_);
    if (moving) v_rc_ = OneRc<S>::advance(v_rc_, at, OneRc<S>::discretise(at, input.duration_s), input);
    const S more_v = laws_.advance(x_, at, input, moving);
    return laws_.reading(OneRc<S>::voltage(v_rc_, at, input) + more_v);
  }

  const S& soc() const { return soc_; }
  const S& v_rc_v() const { return v_rc_[0]; }

  /// Calls f(S&) for each state that the next row depends on: SOC, v_rc, the laws' states.
  template <class F>
  void each_state(F&& f) {
    f(soc_);
    for (S& v : v_rc_) f(v);
    for (std::size_t k = 0; k < laws_.states(); ++k) f(x_[k]);
  }
  static constexpr std::size_t most_states = OneRc<S>::states + ChosenLaws<S>::most_states;

 private:
  static double value(const S& s) {
    if constexpr (Dual<S>)
      return s.a;
    else
      return s;
  }
  /// Returns true if values or derivatives differ.
  static bool differs(const S& a, const S& b) {
    if constexpr (Dual<S>)
      return a.a != b.a || a.v != b.v;
    else
      return a != b;
  }
  TablePoint<S> tables_at(const S& soc) {
    if constexpr (Dual<S>)
      return look_up_dual(cell_, soc, interval_);
    else
      return look_up(cell_, soc, interval_);
  }
  void limit_soc() {
    if (value(soc_) < min_soc) soc_ = S(min_soc);
    if (value(soc_) > max_soc) soc_ = S(max_soc);
  }

  const Tables& cell_;
  double per_capacity_;
  ChosenLaws<S> laws_;
  S soc_;
  typename OneRc<S>::State v_rc_{};
  typename ChosenLaws<S>::States x_;
  std::uint8_t interval_ = 0;
};

}  // namespace bms::model
