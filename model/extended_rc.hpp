// The 1RC model with a set of mechanisms, as the filter steps it: states v_rc, the mechanisms' voltages, soc.
//
//   Voltages   states of mechanisms that add to the voltage and that the filter corrects
//   Held       all states of mechanisms; those that are not corrected (a warmth) come last
//
// A mechanism's state depends on itself and on the current alone: x' = x + p (target - x), d x' / d x = 1 - p, nothing by soc. What
// its laws make of the tables runs through the tables' own derivatives. ExtendedRc<0, 0> is OneRc.
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
template <class Tables, class Drive, class X>
struct CellUnder {
  const Tables& cell;
  const Drive& drive;
  const X& x;  ///< v_rc and the mechanisms' states
};
template <class Tables, class Drive, class X>
CellUnder(const Tables&, const Drive&, const X&) -> CellUnder<Tables, Drive, X>;

template <class Tables, class S, class X>
constexpr TablePoint<S> look_up(const CellUnder<Tables, Drive<S>, X>& under, const Soc<S>& soc, std::uint8_t& interval) {
  const auto& laws = laws_of(under.cell);
  TablePoint<S> at = look_up(under.cell, soc, interval);
  if constexpr (std::remove_cvref_t<decltype(laws)>::reads_elsewhere) {
    at.read_slope_v = at.ocv_delta_v * at.per_width;
    if (const Soc<S> elsewhere = laws.read_at(soc, under.x.data() + 1); elsewhere != soc) {
      std::uint8_t there_interval = interval;
      const TablePoint<S> there = look_up(under.cell, elsewhere, there_interval);
      at.ocv_v = there.ocv_v;
      at.read_slope_v = VoltagePerSoc<S>(VoltagePerSoc<S>(there.ocv_delta_v * there.per_width) * laws.read_slope(soc, under.x.data() + 1));
      at.ocv_delta_v = ratio<Voltage<S>>(at.read_slope_v, at.per_width);
    }
  }
  laws.tables(at, soc, under.drive, under.x.data() + 1);
  return at;
}

template <std::size_t Voltages, std::size_t Held>
struct ExtendedRc {
  static_assert(Voltages <= Held);

  template <class S>
  struct Of {
    using Base = OneRc<S>;
    static constexpr std::size_t states = Base::states + Voltages;
    static constexpr std::size_t mechanism_states = Held;

    using Polarisation = std::array<Voltage<S>, 1 + Held>;  ///< v_rc and the mechanisms' states
    using Transition = std::array<std::array<Coupling<S>, states>, states>;
    using Sensitivity = std::array<VoltagePerSoc<S>, states>;
    using Variances = std::array<Variance<S>, states>;

    struct Settling {
      typename Base::Settling rc;
      std::array<Relaxation<S>, Held> mechanism;
    };

    template <class SomeLaws>
    static constexpr Settling settling(const SomeLaws& laws, const TablePoint<S>& at, const Drive<S>& drive) {
      return {Base::settling(at, drive.duration_s), laws.settling(at, drive)};
    }

    static constexpr Polarisation advance(const Polarisation& x, const TablePoint<S>& at, const Settling& settling, const Drive<S>& drive) {
      Polarisation next{};
      next[0] = Base::advance({x[0]}, at, settling.rc, drive)[0];
#pragma GCC unroll 8
      for (std::size_t k = 0; k < Held; ++k) next[1 + k] = relaxed<S>(x[1 + k], settling.mechanism[k]);
      return next;
    }

    /// What the sensor reads.
    template <class SomeLaws>
    static constexpr Voltage<S> voltage(const SomeLaws& laws, const Polarisation& x, const TablePoint<S>& at, const Drive<S>& drive) {
      Voltage<S> v = Base::voltage({x[0]}, at, drive);
      if constexpr (Voltages > 0) v = Voltage<S>(v + sum_v(x));
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
#pragma GCC unroll 8
      for (std::size_t k = 0; k < Voltages; ++k) sum = Voltage<S>(sum + x[1 + k]);
      return sum;
    }

    static constexpr Transition transition(const Polarisation& x, const TablePoint<S>& at, const Settling& settling, const Drive<S>& drive) {
      const auto base = Base::transition({x[0]}, at, settling.rc, drive);
      Transition f{};
      f[0][0] = base[0][0];
      f[0][states - 1] = base[0][1];
#pragma GCC unroll 8
      for (std::size_t k = 0; k < Voltages; ++k) f[1 + k][1 + k] = Coupling<S>(Fraction<S>(1) - settling.mechanism[k].settled);
      f[states - 1][states - 1] = Coupling<S>(1);
      return f;
    }

    template <class SomeLaws>
    static constexpr Sensitivity sensitivity(const SomeLaws& laws, const TablePoint<S>& at, const Drive<S>& drive) {
      const auto base = Base::sensitivity(at, drive);
      Sensitivity h;
#pragma GCC unroll 8
      for (std::size_t k = 0; k + 1 < states; ++k) h[k] = base[0];
      if constexpr (Voltages > 0 && SomeLaws::reads_elsewhere) {
        std::array<Coupling<S>, Voltages> ahead{};
        laws.ahead_per_v(ahead);
#pragma GCC unroll 8
        for (std::size_t k = 0; k < Voltages; ++k) h[1 + k] = VoltagePerSoc<S>(h[1 + k] + at.read_slope_v * ahead[k]);
      }
      h[states - 1] = base[1];
      if (laws.changes_reading()) {
        const Voltage<S> times = gain(laws);
#pragma GCC unroll 8
        for (std::size_t k = 0; k < states; ++k) h[k] = VoltagePerSoc<S>(h[k] * times);
      }
      return h;
    }

    /// Process noise of a step but soc's: what decays in it, 1 - (1 - p)^2, comes back to the variance of the steady state.
    template <class SomeLaws>
    static constexpr Variances noise(const SomeLaws& laws, const Settling& settling, const Variance<S>& v_rc_v2) {
      Variances q{};
      q[0] = coming_back(v_rc_v2, settling.rc.settled);
      if constexpr (Voltages > 0) {
        std::array<Variance<S>, Voltages> steady{};
        laws.variances(steady, [](const auto& law) -> decltype(law.lasting_error()) { return law.lasting_error(); }, [&](std::size_t) { return v_rc_v2; });
#pragma GCC unroll 8
        for (std::size_t k = 0; k < Voltages; ++k) q[1 + k] = coming_back(steady[k], settling.mechanism[k].settled);
      }
      return q;
    }

    /// The mechanisms' part of a start under a current of which nobody knows how long it has flowed: half of what it can have built up,
    /// give or take the same. Sets their states in x and their variances.
    template <class SomeLaws>
    static constexpr void start(const SomeLaws& laws, Polarisation& x, Variances& variances, const TablePoint<S>& at, const Drive<S>& drive, const Variance<S>& v_rc_v2) {
      if constexpr (Held > 0) {
        const auto initial = laws.initial();
        for (std::size_t k = 0; k < Held; ++k) x[1 + k] = initial[k];
      }
      if constexpr (Voltages > 0) {
        const auto settling = laws.settling(at, drive);
        std::array<Variance<S>, Voltages> first{};
        laws.variances(first, [](const auto& law) -> decltype(law.error_at_first()) { return law.error_at_first(); }, [&](std::size_t k) {
          x[1 + k] = Voltage<S>(settling[k].target * Fraction<S>(0.5));
          return Variance<S>(v_rc_v2 + x[1 + k] * x[1 + k]);
        });
        for (std::size_t k = 0; k < Voltages; ++k) variances[1 + k] = first[k];
      }
    }

   private:
    static constexpr Variance<S> coming_back(const Variance<S>& steady, const Fraction<S>& settled) {
      return product<Variance<S>>(steady, Fraction<S>(settled * Fraction<S>(Fraction<S>(2) - settled)));
    }
    /// A reading is a straight line of the voltage.
    template <class SomeLaws>
    static constexpr Voltage<S> gain(const SomeLaws& laws) {
      return Voltage<S>(laws.reading(Voltage<S>(1)) - laws.reading(Voltage<S>(0)));
    }
  };
};

}  // namespace bms::model
