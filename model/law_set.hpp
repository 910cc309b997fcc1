// A set of mechanisms' laws, called one after the other. A call that no law of the set has costs nothing; an optional
// law costs an `if`.
//
//   LawSet<S, Law...>                   laws that all act
//   LawSet<S, std::optional<Law>...>    laws that act if they are set
//
// The states are stored one after the other in the order of the laws; laws that do not act take no place.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <tuple>
#include <type_traits>

#include "model/law.hpp"
#include "model/mechanism.hpp"

namespace bms::model {

namespace extended_detail {

/// The law of a slot, and whether the slot may be empty.
template <class Slot>
struct LawIn {
  using type = Slot;
  static constexpr bool optional = false;
};
template <class Law>
struct LawIn<std::optional<Law>> {
  using type = Law;
  static constexpr bool optional = true;
};

template <class Law>
constexpr bool adds_voltage() {
  if constexpr (requires { Law::voltage_states; })
    return Law::voltage_states;
  else
    return false;
}
template <class Law, class S>
constexpr bool shifts_ocv_soc() {
  return requires(Law law, Soc<S> soc) { law.ocv_soc(soc); }
  || requires(Law law) { law.soc_shift_per_v(); };
}
template <class Law, class S>
constexpr bool scales_state() {
  return requires(Law law, TablePoint<S> at) { law.voltage_per_state(at); };
}
template <class Law>
constexpr std::size_t states_of() {
  if constexpr (requires { Law::states; })
    return Law::states;
  else
    return 0;
}

template <class Law>
constexpr std::size_t voltage_states_of() {
  return adds_voltage<Law>() ? states_of<Law>() : 0;
}

}  // namespace extended_detail

template <class S, class... Slots>
class LawSet {
  static_assert(
      (true && ... && MechanismLaw<typename extended_detail::LawIn<Slots>::type, S>),
      "a law must declare exactly the members that it has (model/law.hpp): a misspelt one would have no effect");

 public:
  static constexpr std::size_t most_states =
      (std::size_t{0} + ... + extended_detail::states_of<typename extended_detail::LawIn<Slots>::type>());
  static constexpr std::size_t most_voltage_states =
      (std::size_t{0} + ... + extended_detail::voltage_states_of<typename extended_detail::LawIn<Slots>::type>());
  static constexpr bool shifts_ocv_soc =
      (false || ... || extended_detail::shifts_ocv_soc<typename extended_detail::LawIn<Slots>::type, S>());
  static constexpr bool scales_states =
      (false || ... || extended_detail::scales_state<typename extended_detail::LawIn<Slots>::type, S>());
  static constexpr bool all_act = !(false || ... || extended_detail::LawIn<Slots>::optional);
  using States = std::array<Voltage<S>, most_states>;
  using Relaxations = std::array<Relaxation<S>, most_states>;

  constexpr LawSet() = default;
  constexpr explicit LawSet(const Slots&... slots) requires(sizeof...(Slots) > 0) : slots_(slots...) {}

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
  constexpr Current<S> counted(const StepInput<S>& input) const {
    Current<S> a = input.current_a;
    each([&](const auto& law) {
      if constexpr (requires { law.counted(a, input); }) a = law.counted(a, input);
    });
    return a;
  }
  /// SOC at which the OCV is read. x: the laws' states.
  template <class X>
  constexpr Soc<S> ocv_soc(Soc<S> soc, const X& x) const {
    each_with_states([&](const auto& law, std::size_t first) { soc = ocv_soc(law, soc, x, first); });
    return soc;
  }
  /// d ocv_soc / d soc.
  template <class X>
  constexpr Coupling<S> ocv_soc_slope(Soc<S> soc, const X& x) const {
    Coupling<S> slope(1);
    each_with_states([&](const auto& law, std::size_t first) {
      if constexpr (requires { law.ocv_soc_slope(soc); }) slope = Coupling<S>(slope * law.ocv_soc_slope(soc));
      soc = ocv_soc(law, soc, x, first);
    });
    return slope;
  }
  /// Shift of the SOC at which the OCV is read, per volt of each voltage state.
  template <class Couplings>
  constexpr void soc_shift_per_v(Couplings& out) const {
    each_with_states([&](const auto& law, std::size_t first) {
      if constexpr (requires { law.soc_shift_per_v(); }) {
        for (std::size_t i = 0; i < states_of(law) && first + i < out.size(); ++i)
          out[first + i] = law.soc_shift_per_v();
      }
    });
  }
  /// d voltage / d state of the voltage states of which it is not 1.
  template <class Factors>
  constexpr void voltage_per_state(const TablePoint<S>& at, Factors& out) const {
    each_with_states([&](const auto& law, std::size_t first) {
      if constexpr (requires { law.voltage_per_state(at); }) {
        for (std::size_t i = 0; i < states_of(law) && first + i < out.size(); ++i)
          out[first + i] = law.voltage_per_state(at);
      }
    });
  }
  template <class X>
  constexpr void tables(TablePoint<S>& at, const Soc<S>& soc, const StepInput<S>& input, const X& x) const {
    each_with_states([&](const auto& law, std::size_t first) {
      if constexpr (requires { law.apply_state(at, x[first], input); }) law.apply_state(at, x[first], input);
      if constexpr (requires { law.tables(at, soc, input); }) law.tables(at, soc, input);
    });
  }
  constexpr Voltage<S> reading(Voltage<S> v) const {
    each([&](const auto& law) {
      if constexpr (requires { law.reading(v); }) v = law.reading(v);
    });
    return v;
  }

  /// Returns true if a law changes the current between reading and charge.
  constexpr bool changes_charge() const {
    bool any = false;
    each([&](const auto& law) {
      any = any || requires(Current<S> a) { law.true_current(a); }
      || requires(Current<S> a, StepInput<S> d) { law.counted(a, d); };
    });
    return any;
  }
  /// Returns false if the resistances are those of the cell file at every temperature.
  constexpr bool resistances_follow_temperature() const {
    bool any = false;
    each([&](const auto& law) {
      any = any || requires { law.resistances_follow_temperature; };
    });
    return any;
  }
  /// Returns true if a law changes the voltage reading.
  constexpr bool changes_reading() const {
    bool any = false;
    each([&](const auto& law) {
      any = any || requires(Voltage<S> v) { law.reading(v); };
    });
    return any;
  }

  constexpr std::size_t states() const {
    std::size_t count = 0;
    each([&](const auto& law) { count += states_of(law); });
    return count;
  }
  /// Number of states that add to the voltage; they come first.
  constexpr std::size_t voltage_states() const {
    std::size_t count = 0;
    each([&](const auto& law) { count += extended_detail::voltage_states_of<std::remove_cvref_t<decltype(law)>>(); });
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
  /// The relaxation of each state in a step; in places without a state, nothing moves and any error decays at once.
  /// x: the laws' states before it.
  template <class X>
  constexpr Relaxations discretise(const X& x, const TablePoint<S>& at, const StepInput<S>& input) const {
    Relaxations r{};
    if constexpr (!all_act) {
      for (Relaxation<S>& unused : r) unused.error_decay = Fraction<S>(1);
    }
    each_with_states([&](const auto& law, std::size_t first) {
      for (std::size_t i = 0; i < states_of(law); ++i) r[first + i] = relaxation(law, i, at, input, &x[first]);
    });
    return r;
  }
  /// Variances of the voltage states: the law's own sigma if it has one, else otherwise(state, law).
  template <class Variances, class Own, class Otherwise>
  constexpr void variances(Variances& out, Own own, Otherwise otherwise) const {
    each_with_states([&](const auto& law, std::size_t first) {
      if (!adds_voltage(law)) return;
      for (std::size_t i = 0; i < states_of(law) && first + i < out.size(); ++i) {
        if constexpr (requires { own(law); }) {
          const Voltage<S> error_v = own(law);
          out[first + i] = Variance<S>(error_v * error_v);
        } else {
          out[first + i] = otherwise(first + i, law);
        }
      }
    });
  }
  /// Whether voltage state k has a sigma of its own at the start: it is not a polarisation.
  constexpr bool starts_with_own_sigma(std::size_t k) const {
    bool own = false;
    each_with_states([&](const auto& law, std::size_t first) {
      if constexpr (requires { law.initial_sigma_v(); }) own = own || (k >= first && k < first + states_of(law));
    });
    return own;
  }
  /// Advances the states if `moving`. Returns the sum of the voltage states.
  constexpr Voltage<S> advance(States& x, const TablePoint<S>& at, const StepInput<S>& input, bool moving) const {
    Voltage<S> sum(0);
    each_with_states([&](const auto& law, std::size_t first) {
      for (std::size_t i = 0; i < states_of(law); ++i) {
        if (moving) x[first + i] = relaxed<S>(x[first + i], relaxation(law, i, at, input, &x[first]));
        if (adds_voltage(law)) sum = Voltage<S>(sum + x[first + i]);
      }
    });
    return sum;
  }

 private:
  template <class Law, class X>
  static constexpr Soc<S> ocv_soc(const Law& law, const Soc<S>& soc, const X& x, std::size_t first) {
    if constexpr (requires { law.ocv_soc(soc); }) {
      return law.ocv_soc(soc);
    } else if constexpr (requires { law.soc_shift_per_v(); }) {
      Voltage<S> sum = x[first];
      for (std::size_t i = 1; i < states_of(law); ++i) sum = Voltage<S>(sum + x[first + i]);
      return Soc<S>(soc + law.soc_shift_per_v() * sum);
    } else {
      return soc;
    }
  }
  template <class Law>
  static constexpr Relaxation<S> relaxation(const Law& law, std::size_t i, const TablePoint<S>& at,
                                            const StepInput<S>& input, const Voltage<S>* x) {
    if constexpr (requires { law.relaxation(i, at, input, x); })
      return law.relaxation(i, at, input, x);
    else if constexpr (extended_detail::states_of<Law>() > 0)
      return law.relaxation(i, at, input);
    else
      return {};
  }
  template <class Law>
  static constexpr std::size_t states_of(const Law&) {
    return extended_detail::states_of<Law>();
  }
  template <class Law>
  static constexpr bool adds_voltage(const Law&) {
    return extended_detail::adds_voltage<Law>();
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

}  // namespace bms::model
