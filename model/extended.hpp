// The base model with a set of mechanisms, open loop: what the simulation, the diagnosis and its fits run.
//
//   Laws<S, M...>        the mechanisms of a cell known at compile time, all acting (firmware)
//   ChosenLaws<S>        any of the catalogue, chosen at run time (host)
//
// Both call the same laws in the same order, that of model/catalogue.hpp.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <tuple>

#include "model/catalogue.hpp"
#include "model/one_rc.hpp"

namespace bms::model {

inline constexpr std::size_t most_states = 6;  ///< of mechanisms at once

template <class S, class... Slots>
class LawSet {
 public:
  using States = std::array<Voltage<S>, most_states>;

  constexpr LawSet() = default;
  constexpr explicit LawSet(const Slots&... slots) : slots_(slots...) {}

  template <std::size_t K>
  constexpr auto& slot() {
    return std::get<K>(slots_);
  }

  constexpr void at(double time_s) {
    each([&](auto& law) {
      if constexpr (requires { law.at(time_s); }) law.at(time_s);
    });
  }
  constexpr Current<S> true_current(Current<S> a) const {
    each([&](const auto& law) {
      if constexpr (requires { law.true_current(a); }) a = law.true_current(a);
    });
    return a;
  }
  constexpr Temperature<S> true_temperature(Temperature<S> c) const {
    each([&](const auto& law) {
      if constexpr (requires { law.true_temperature(c); }) c = law.true_temperature(c);
    });
    return c;
  }
  constexpr Current<S> counted(const Drive<S>& drive) const {
    Current<S> a = drive.current_a;
    each([&](const auto& law) {
      if constexpr (requires { law.counted(a, drive); }) a = law.counted(a, drive);
    });
    return a;
  }
  constexpr Soc<S> read_at(Soc<S> soc) const {
    each([&](const auto& law) {
      if constexpr (requires { law.read_at(soc); }) soc = law.read_at(soc);
    });
    return soc;
  }
  constexpr void tables(TablePoint<S>& at, const Soc<S>& soc, const Drive<S>& drive, const States& x) const {
    each_with_states([&](const auto& law, std::size_t first) {
      if constexpr (requires { law.warm(at, x[first], drive); }) law.warm(at, x[first], drive);
      if constexpr (requires { law.tables(at, soc, drive); }) law.tables(at, soc, drive);
    });
  }
  constexpr Voltage<S> reading(Voltage<S> v) const {
    each([&](const auto& law) {
      if constexpr (requires { law.reading(v); }) v = law.reading(v);
    });
    return v;
  }

  constexpr std::size_t states() const {
    std::size_t count = 0;
    each_with_states([&](const auto& law, std::size_t first) { count = first + states_of(law); });
    return count;
  }
  constexpr States initial() const {
    States x{};
    each_with_states([&](const auto& law, std::size_t first) {
      for (std::size_t i = 0; i < states_of(law); ++i) {
        if constexpr (requires { law.initial(i); }) x[first + i] = law.initial(i);
      }
    });
    return x;
  }
  /// Voltage states advanced, and what they add to the terminal's voltage.
  constexpr Voltage<S> advance(States& x, const TablePoint<S>& at, const Drive<S>& drive, bool moving) const {
    Voltage<S> sum(0);
    each_with_states([&](const auto& law, std::size_t first) {
      for (std::size_t i = 0; i < states_of(law); ++i) {
        if constexpr (requires { law.settle(i, at, drive); }) {
          if (moving) {
            const Relaxation<S> r = law.settle(i, at, drive);
            x[first + i] = Voltage<S>(x[first + i] + r.settled * Voltage<S>(r.target - x[first + i]));
          }
          if (adds_voltage(law)) sum = Voltage<S>(sum + x[first + i]);
        }
      }
    });
    return sum;
  }

 private:
  template <class Law>
  static constexpr std::size_t states_of(const Law&) {
    if constexpr (requires(Law l, TablePoint<S> p, Drive<S> d) { l.settle(0, p, d); }) return Law::states;
    else return 0;
  }
  template <class Law>
  static constexpr bool adds_voltage(const Law&) {
    if constexpr (requires { Law::voltage_states; }) return Law::voltage_states;
    else return false;
  }

  template <class F, class Law>
  static constexpr void call(F& f, Law& law) {
    f(law);
  }
  template <class F, class Law>
  static constexpr void call(F& f, std::optional<Law>& law) {
    if (law) f(*law);
  }
  template <class F, class Law>
  static constexpr void call(F& f, const std::optional<Law>& law) {
    if (law) f(*law);
  }
  template <class F>
  constexpr void each(F f) {
    std::apply([&](auto&... slot) { (call(f, slot), ...); }, slots_);
  }
  template <class F>
  constexpr void each(F f) const {
    std::apply([&](const auto&... slot) { (call(f, slot), ...); }, slots_);
  }
  template <class F>
  constexpr void each_with_states(F f) const {
    std::size_t first = 0;
    each([&](const auto& law) {
      f(law, first);
      first += states_of(law);
    });
  }

  std::tuple<Slots...> slots_;
};

template <class S, class... M>
using Laws = LawSet<S, typename M::template Law<S>...>;

namespace extended_detail {

template <class S, class List>
struct Chosen;
template <class S, class... M>
struct Chosen<S, std::tuple<M...>> {
  using type = LawSet<S, std::optional<typename M::template Law<S>>...>;
};

}  // namespace extended_detail

template <class S>
using ChosenLaws = typename extended_detail::Chosen<S, Catalogue>::type;

/// Values of a mechanism's parameters, in the order of its info. Unused places are 0.
template <class Real = double>
using MechanismValues = std::array<Real, max_mechanism_parameters>;

/// One mechanism as a cell file states it.
struct MechanismSetting {
  std::size_t index = 0;          ///< in the catalogue
  MechanismValues<> value{};
  MechanismValues<> deviation{};  ///< standard deviations; 0: not known, or given
};

namespace extended_detail {

template <class S, class Real, std::size_t K>
constexpr void choose_at(ChosenLaws<S>& laws, std::size_t index, const MechanismValues<Real>& values, double capacity_ah) {
  if constexpr (K < mechanism_count) {
    if (index != K) return choose_at<S, Real, K + 1>(laws, index, values, capacity_ah);
    using M = std::tuple_element_t<K, Catalogue>;
    std::array<Real, M::parameters.size()> own{};
    for (std::size_t i = 0; i < own.size(); ++i) own[i] = values[i];
    laws.template slot<K>().emplace(own, capacity_ah);
  }
}

}  // namespace extended_detail

/// Adds the mechanism with that index in the catalogue, or changes it.
template <class S, class Real>
constexpr void choose(ChosenLaws<S>& laws, std::size_t index, const MechanismValues<Real>& values, double capacity_ah) {
  extended_detail::choose_at<S, Real, 0>(laws, index, values, capacity_ah);
}

/// What the tables say for a dual number, from tables that are not unknowns themselves.
template <Dual S>
TablePoint<S> look_up_dual(const Cell<double, max_intervals>& cell, const S& soc, std::uint8_t& interval) {
  const TablePoint<double> p = look_up(cell, soc.a, interval);
  const auto line = [&](double value, double delta) {
    S v(value);
    v.v = soc.v * (delta * p.per_width);
    return v;
  };
  return {.per_width = S(p.per_width), .ocv_v = line(p.ocv_v, p.ocv_delta_v), .ocv_delta_v = S(p.ocv_delta_v),
          .r0_ohm = line(p.r0_ohm, p.r0_delta_ohm), .r0_delta_ohm = S(p.r0_delta_ohm),
          .r1_ohm = line(p.r1_ohm, p.r1_delta_ohm), .r1_delta_ohm = S(p.r1_delta_ohm),
          .c1_f = line(p.c1_f, p.c1_delta_f), .c1_delta_f = S(p.c1_delta_f)};
}

/// A cell on its way through a recording, open loop. S: double or a dual number.
template <class S>
class Course {
 public:
  using Tables = Cell<double, max_intervals>;

  Course(const Tables& cell, double capacity_ah, const ChosenLaws<S>& laws, const S& initial_soc)
      : cell_(cell), per_capacity_(1 / (3'600 * capacity_ah)), laws_(laws), soc_(initial_soc), x_(laws_.initial()) {}

  /// One row: duration_s since the row before (0: the state stays), current that was read (of a channel that is not late), the
  /// temperature (NaN: none). adjust(TablePoint&, soc): what else changes the tables. Returns the voltage that would be read.
  template <class Adjust>
  S step(double time_s, double duration_s, const S& read_a, const S& read_c, Adjust&& adjust) {
    laws_.at(time_s);
    const Drive<S> drive{laws_.true_current(read_a), S(duration_s), laws_.true_temperature(read_c)};
    const bool moving = duration_s > 0;
    soc_ += laws_.counted(drive) * (duration_s * per_capacity_);
    hold();
    TablePoint<S> at = tables_at(soc_);
    const S elsewhere = laws_.read_at(soc_);
    if (value(elsewhere) != value(soc_)) {
      const TablePoint<S> there = tables_at(elsewhere);
      at.ocv_v = there.ocv_v;
    }
    adjust(at, soc_);
    laws_.tables(at, soc_, drive, x_);
    if (moving) v_rc_ = OneRc<S>::advance(v_rc_, at, OneRc<S>::settling(at, drive.duration_s), drive);
    const S more_v = laws_.advance(x_, at, drive, moving);
    return laws_.reading(OneRc<S>::voltage(v_rc_, at, drive) + more_v);
  }

  const S& soc() const { return soc_; }
  const S& v_rc_v() const { return v_rc_[0]; }

 private:
  static double value(const S& s) {
    if constexpr (Dual<S>) return s.a;
    else return s;
  }
  TablePoint<S> tables_at(const S& soc) {
    if constexpr (Dual<S>) return look_up_dual(cell_, soc, interval_);
    else return look_up(cell_, soc, interval_);
  }
  void hold() {
    if (value(soc_) < -0.25) soc_ = S(-0.25);
    if (value(soc_) > 1.25) soc_ = S(1.25);
  }

  const Tables& cell_;
  double per_capacity_;
  ChosenLaws<S> laws_;
  S soc_;
  typename OneRc<S>::Polarisation v_rc_{};
  typename ChosenLaws<S>::States x_;
  std::uint8_t interval_ = 0;
};

}  // namespace bms::model
