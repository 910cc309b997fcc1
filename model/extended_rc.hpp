// The 1RC model with a set of mechanisms, as the filter steps it: states v_rc, the mechanisms' voltages, soc.
//
//   Voltages   states of mechanisms that add to the voltage and that the filter corrects
//   Held       all states of mechanisms; those that are not corrected (a warmth) come last
//   Errors     whether two lasting errors are states as well: by how much the model's voltage is too low [V], and by
//   how much the
//              current reads too high, as part of the capacity per hour [1/h]. Both are first-order Gauss-Markov
//              processes: noise.model_v over `lasting_error_lasts` times noise.model_correlation_s,
//              noise.current_offset_a over its own correlation time
//
//   covariance   v_rc, voltage error, mechanisms' voltages, soc, current offset        what the offset moves comes
//   before it values       v_rc, voltage error, current offset, mechanisms' states               soc is counted
//   elsewhere
//
// A mechanism's state depends on itself and on the current alone: x' = x + p (target - x), d x' / d x = 1 - p, nothing
// by soc. What its laws make of the tables runs through the tables' own derivatives. ExtendedRc<0, 0> is OneRc.
//
// The laws come with the cell: a Cell has none, an ExtendedCell has those of its file.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "model/law_set.hpp"
#include "model/one_rc.hpp"

namespace bms::model {

/// A prepared cell and what the 1RC model leaves out of it. SomeLaws: Laws or ChosenLaws (model/extended.hpp).
template <class S, std::size_t Max, class SomeLaws>
struct ExtendedCell : Cell<S, Max> {
  SomeLaws laws;
};

template <class S, std::size_t Max>
constexpr LawSet<S> laws_of(const Cell<S, Max>&) {
  return {};
}
template <class S, std::size_t Max, class SomeLaws>
constexpr const SomeLaws& laws_of(const ExtendedCell<S, Max, SomeLaws>& cell) {
  return cell.laws;
}

/// A cell under one drive and with one state of its mechanisms: what its tables then say.
template <class Tables, class Drive, class Voltage>
struct CellUnder {
  const Tables& cell;
  const Drive& drive;
  const Voltage* mechanism;  ///< the mechanisms' states
};
template <class Tables, class Drive, class Voltage>
CellUnder(const Tables&, const Drive&, const Voltage*) -> CellUnder<Tables, Drive, Voltage>;

template <class Tables, class S>
constexpr TablePoint<S> look_up(const CellUnder<Tables, Drive<S>, Voltage<S>>& under, const Soc<S>& soc,
                                std::uint8_t& interval) {
  const auto& laws = laws_of(under.cell);
  TablePoint<S> at = look_up(under.cell, soc, interval);
  if constexpr (std::remove_cvref_t<decltype(laws)>::reads_elsewhere) {
    at.read_slope_v = at.ocv_delta_v * at.per_width;
    if (const Soc<S> elsewhere = laws.read_at(soc, under.mechanism); elsewhere != soc) {
      std::uint8_t there_interval = interval;
      const TablePoint<S> there = look_up(under.cell, elsewhere, there_interval);
      at.ocv_v = there.ocv_v;
      at.read_slope_v = VoltagePerSoc<S>(VoltagePerSoc<S>(there.ocv_delta_v * there.per_width) *
                                         laws.read_slope(soc, under.mechanism));
      at.ocv_delta_v = ratio<Voltage<S>>(at.read_slope_v, at.per_width);
    }
  }
  laws.tables(at, soc, under.drive, under.mechanism);
  return at;
}

template <std::size_t Voltages, std::size_t Held, bool Errors = false>
struct ExtendedRc {
  static_assert(Voltages <= Held);

  template <class S>
  struct Of {
    using Base = OneRc<S>;
    static constexpr bool errors_are_states = Errors;
    static constexpr std::size_t states = Base::states + Voltages + (Errors ? 2 : 0);
    static constexpr std::size_t values = 1 + (Errors ? 2 : 0) + Held;
    static constexpr std::size_t voltage_error = 1, current_offset = 2;  ///< places among the values, if Errors
    static constexpr std::size_t first_held = values - Held;
    static constexpr std::size_t soc = states - (Errors ? 2 : 1), last = states - 1;  ///< places in the covariance
    static constexpr std::size_t first_voltage = soc - Voltages;

    using Polarisation = std::array<Voltage<S>, values>;
    using Transition = std::array<std::array<Coupling<S>, states>, states>;
    using Sensitivity = std::array<VoltagePerSoc<S>, states>;
    using Variances = std::array<Variance<S>, states>;

    /// Where among the values the covariance's state i is; i != soc.
    static constexpr std::size_t place(std::size_t i) {
      return !Errors ? i : i > soc ? current_offset : i < first_voltage ? i : i - first_voltage + first_held;
    }
    static constexpr const Voltage<S>* held(const Polarisation& x) { return x.data() + first_held; }

    /// How much of the two errors is forgotten in a step: of its duration alone.
    struct Forgetting {
      Fraction<S> voltage_error{}, current_offset{};
    };
    struct Nothing {};
    using Forgotten = std::conditional_t<Errors, Forgetting, Nothing>;
    static constexpr Forgotten forgotten(const FilterNoise<S>& noise, const TimeStep<S>& duration_s) {
      if constexpr (Errors)
        return {part(duration_s * Fraction<S>(1.0 / lasting_error_lasts), noise.model_correlation_s),
                part(duration_s, noise.current_offset_correlation_s)};
      else
        return {};
    }

    struct Settling {
      typename Base::Settling rc;
      std::array<Relaxation<S>, Held> mechanism;
      Forgotten forgotten;
    };

    template <class SomeLaws>
    static constexpr Settling settling(const SomeLaws& laws, const Polarisation& x, const TablePoint<S>& at,
                                       const Drive<S>& drive, const Forgotten& forgotten = {}) {
      return {Base::settling(at, drive.duration_s), laws.settling(held(x), at, drive), forgotten};
    }

    /// What the current sensor reads, less its offset.
    static constexpr Current<S> without_offset(const Current<S>& read_a, const Polarisation& x,
                                               const FilterNoise<S>& noise) {
      if constexpr (Errors)
        return Current<S>(read_a - noise.one_c_a * x[current_offset]);
      else
        return read_a;
    }

    static constexpr Polarisation advance(const Polarisation& x, const TablePoint<S>& at, const Settling& settling,
                                          const Drive<S>& drive) {
      Polarisation next{};
      next[0] = Base::advance({x[0]}, at, settling.rc, drive)[0];
      if constexpr (Errors) {
        next[voltage_error] = relaxed<S>(x[voltage_error], {settling.forgotten.voltage_error, Voltage<S>(0)});
        next[current_offset] = relaxed<S>(x[current_offset], {settling.forgotten.current_offset, Voltage<S>(0)});
      }
#pragma GCC unroll 8
      for (std::size_t k = 0; k < Held; ++k)
        next[first_held + k] = relaxed<S>(x[first_held + k], settling.mechanism[k]);
      return next;
    }

    /// What the sensor reads.
    template <class SomeLaws>
    static constexpr Voltage<S> voltage(const SomeLaws& laws, const Polarisation& x, const TablePoint<S>& at,
                                        const Drive<S>& drive) {
      Voltage<S> v = Base::voltage({x[0]}, at, drive);
      if constexpr (Voltages > 0 || Errors) v = Voltage<S>(v + sum_v(x));
      return laws.reading(v);
    }

    /// The terminal's voltage of a reading.
    template <class SomeLaws>
    static constexpr Voltage<S> true_voltage(const SomeLaws& laws, const Voltage<S>& read_v) {
      if (!laws.changes_reading()) return read_v;
      return ratio<Voltage<S>>(Voltage<S>(read_v - laws.reading(Voltage<S>(0))), gain(laws));
    }

    static constexpr Voltage<S> sum_v(const Polarisation& x) {
      Voltage<S> sum(0);
      if constexpr (Errors) sum = x[voltage_error];
#pragma GCC unroll 8
      for (std::size_t k = 0; k < Voltages; ++k) sum = Voltage<S>(sum + x[first_held + k]);
      return sum;
    }

    static constexpr Transition transition(const Polarisation& x, const TablePoint<S>& at, const Settling& settling,
                                           const Drive<S>& drive) {
      const auto base = Base::transition({x[0]}, at, settling.rc, drive);
      Transition f{};
      f[0][0] = base[0][0];
      f[0][soc] = base[0][1];
#pragma GCC unroll 8
      for (std::size_t k = 0; k < Voltages; ++k)
        f[first_voltage + k][first_voltage + k] = Coupling<S>(Fraction<S>(1) - settling.mechanism[k].renewed);
      f[soc][soc] = Coupling<S>(1);
      if constexpr (Errors) {
        f[voltage_error][voltage_error] = Coupling<S>(Fraction<S>(1) - settling.forgotten.voltage_error);
        // what an offset drops over the resistances is below a millivolt
        f[soc][last] = -Coupling<S>(drive.duration_s * Fraction<S>(1.0 / 3'600));
        f[last][last] = Coupling<S>(Fraction<S>(1) - settling.forgotten.current_offset);
      }
      return f;
    }

    template <class SomeLaws>
    static constexpr Sensitivity sensitivity(const SomeLaws& laws, const TablePoint<S>& at, const Drive<S>& drive) {
      const auto base = Base::sensitivity(at, drive);
      Sensitivity h{};
#pragma GCC unroll 8
      for (std::size_t k = 0; k < soc; ++k) h[k] = base[0];
      if constexpr (Voltages > 0 && SomeLaws::reads_elsewhere) {
        std::array<Coupling<S>, Voltages> ahead{};
        laws.ahead_per_v(ahead);
#pragma GCC unroll 8
        for (std::size_t k = 0; k < Voltages; ++k)
          h[first_voltage + k] = VoltagePerSoc<S>(h[first_voltage + k] + at.read_slope_v * ahead[k]);
      }
      h[soc] = base[1];
      if (laws.changes_reading()) {
        const Voltage<S> times = gain(laws);
#pragma GCC unroll 8
        for (std::size_t k = 0; k <= soc; ++k) h[k] = VoltagePerSoc<S>(h[k] * times);
      }
      return h;
    }

    /// Process noise of a step but soc's: what decays in it, 1 - (1 - p)^2, comes back to the variance of the steady
    /// state.
    template <class SomeLaws>
    static constexpr Variances noise(const SomeLaws& laws, const Settling& settling, const FilterNoise<S>& of) {
      Variances q{};
      q[0] = coming_back(of.v_rc_v2, settling.rc.settled);
      if constexpr (Voltages > 0) {
        std::array<Variance<S>, Voltages> steady{};
        laws.variances(
            steady, [](const auto& law) -> decltype(law.lasting_error()) { return law.lasting_error(); },
            [&](std::size_t) { return of.v_rc_v2; });
#pragma GCC unroll 8
        for (std::size_t k = 0; k < Voltages; ++k)
          q[first_voltage + k] = coming_back(steady[k], settling.mechanism[k].renewed);
      }
      if constexpr (Errors) {
        q[voltage_error] = coming_back(of.model_v2, settling.forgotten.voltage_error);
        q[last] = coming_back(of.offset_per_h2, settling.forgotten.current_offset);
      }
      return q;
    }

    /// The lasting errors' and the mechanisms' part of a start under a current of which nobody knows how long it has
    /// flowed: half of what it can have built up, give or take the same. Sets the mechanisms' states in x and all these
    /// variances.
    template <class SomeLaws>
    static constexpr void start(const SomeLaws& laws, Polarisation& x, Variances& variances, const TablePoint<S>& at,
                                const Drive<S>& drive, const FilterNoise<S>& of) {
      if constexpr (Errors) {
        variances[voltage_error] = of.model_v2;
        variances[last] = of.offset_per_h2;
      }
      if constexpr (Held > 0) {
        const auto initial = laws.initial();
        for (std::size_t k = 0; k < Held; ++k) x[first_held + k] = initial[k];
      }
      if constexpr (Voltages > 0) {
        const auto settling = laws.settling(held(x), at, drive);
        std::array<Variance<S>, Voltages> first{};
        laws.variances(
            first, [](const auto& law) -> decltype(law.error_at_first()) { return law.error_at_first(); },
            [&](std::size_t k) {
              x[first_held + k] = Voltage<S>(settling[k].target * Fraction<S>(0.5));
              return Variance<S>(of.v_rc_v2 + x[first_held + k] * x[first_held + k]);
            });
        for (std::size_t k = 0; k < Voltages; ++k) variances[first_voltage + k] = first[k];
      }
    }

   private:
    static constexpr Variance<S> coming_back(const Variance<S>& steady, const Fraction<S>& settled) {
      return product<Variance<S>>(steady, Fraction<S>(settled * Fraction<S>(Fraction<S>(2) - settled)));
    }
    /// Of a long time that a short one is, 1 at most.
    template <class Time>
    static constexpr Fraction<S> part(const Time& short_s, const Duration<S>& long_s) {
      return long_s > Duration<S>(short_s) ? ratio<Fraction<S>>(Duration<S>(short_s), long_s) : Fraction<S>(1);
    }
    /// A reading is a straight line of the voltage.
    template <class SomeLaws>
    static constexpr Voltage<S> gain(const SomeLaws& laws) {
      return Voltage<S>(laws.reading(Voltage<S>(1)) - laws.reading(Voltage<S>(0)));
    }
  };
};

}  // namespace bms::model
