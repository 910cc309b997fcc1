// Non-linear charge transfer: the overpotential of a reaction grows with the logarithm of a large current
// (Butler-Volmer with equal transfer coefficients).
//
//   eta = (2 R T / F) asinh(I / (2 I_0)):  a share of R0 and of R1 becomes  R asinh(x) / x,  x = I / (2 I_0)
//
// At small currents nothing changes: there the shares have the resistance of the cell file.
#pragma once

#include "model/mechanism.hpp"

namespace bms::model {

struct ChargeTransfer {
  static constexpr std::string_view id = "charge_transfer";
  static constexpr Domain domain = Domain::physics;
  static constexpr bool on_board = true;
  static constexpr bool needs_fpu = true;
  static constexpr std::array parameters = {
      Parameter{"r0_share", "1", Role::strength, 0, 0, 1, Per::cell, "share of R0 that is charge transfer"},
      Parameter{"r1_share", "1", Role::strength, 0, 0, 1, Per::cell, "share of R1 that is charge transfer"},
      Parameter{"exchange_current_a", "A", Role::shape, 1, 0.05, 20, Per::ah, "I_0, bounds in multiples of 1C"},
  };

  template <class S>
  struct Law {
    static constexpr LawMembers members = law_member::tables;
    Factor<S> r0_share, r1_share;
    Current<S> twice_i0_a;

    template <class Real>
    constexpr Law(const std::array<Real, 3>& p, double)
        : r0_share(Factor<S>(p[0])), r1_share(Factor<S>(p[1])), twice_i0_a(Current<S>(p[2] * Real(2))) {}

    constexpr void tables(TablePoint<S>& at, const Soc<S>&, const StepInput<S>& input) const {
      const S less = S(1) - flattening(input.current_a / twice_i0_a);
      mechanism_detail::scale<S>(at.r0_ohm, at.r0_delta_ohm, S(1) - r0_share * less);
      mechanism_detail::scale<S>(at.r1_ohm, at.r1_delta_ohm, S(1) - r1_share * less);
    }

   private:
    /// asinh(x) / x. Halved, asinh(x) = 2 asinh(x / sqrt(2 (1 + sqrt(1 + x^2)))), until its series is short; relative
    /// error below 1e-7.
    static constexpr S flattening(S x) {
      S y = x, times(1);
      while (y > S(0.25) || y < S(-0.25)) {
        y = y / root<S>(S(S(2) * (S(1) + root<S>(S(S(1) + y * y)))));
        times = times * S(2);
      }
      const S y2 = y * y;
      const S series = S(1) + y2 * (S(-1.0 / 6) + y2 * (S(3.0 / 40) + y2 * (S(-15.0 / 336) + y2 * S(105.0 / 3456))));
      return x > S(0.25) || x < S(-0.25) ? S(times * y * series / x) : series;
    }
  };
};

}  // namespace bms::model
