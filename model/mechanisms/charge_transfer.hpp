// Non-linear charge transfer: the overpotential of a reaction grows with the logarithm of a large current
// (Butler-Volmer).
//
//   I = I_0 (exp(a f eta) - exp((a - 1) f eta)),  f = F / (R T):  a share of R0 and of R1 becomes  R y / x
//   with  x = I / (2 I_0),  y = f eta / 2:  sinh(y) exp((2 a - 1) y) = x;  y = asinh(x) if a = 1/2
//
// At small currents nothing changes: there the shares have the resistance of the cell file. A transfer coefficient a
// other than 1/2 makes charging and discharging differ, the more the larger the current is.
#pragma once

#include "model/mechanism.hpp"
#include "model/temperature.hpp"

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
      Parameter{"transfer_coefficient", "1", Role::place, 0.5, 0.3, 0.7, Per::cell,
                "a: of the charging direction; 0.5 in most cells", 0, 0.5, 0.1},
  };

  template <class S>
  struct Law {
    static constexpr LawMembers members = law_member::tables;
    Factor<S> r0_share, r1_share;
    Current<S> twice_i0_a;
    S skew;  ///< 2 a - 1
    bool is_skewed;

    template <class Real>
    constexpr Law(const std::array<Real, 4>& p, double)
        : r0_share(Factor<S>(p[0])),
          r1_share(Factor<S>(p[1])),
          twice_i0_a(Current<S>(p[2] * Real(2))),
          skew(S(Real(2) * p[3] - Real(1))),
          is_skewed(Dual<S> || p[3] != Real(0.5)) {}  // a dual number's derivative by a exists at 0.5, too

    constexpr void tables(TablePoint<S>& at, const Soc<S>&, const StepInput<S>& input) const {
      const S x = input.current_a / twice_i0_a;
      const S less = S(1) - (is_skewed ? skewed_flattening(x) : flattening(x));
      mechanism_detail::scale<S>(at.r0_ohm, at.r0_delta_ohm, S(1) - r0_share * less);
      mechanism_detail::scale<S>(at.r1_ohm, at.r1_delta_ohm, S(1) - r1_share * less);
    }

   private:
    /// y / x by Newton's method for y = asinh(x exp(-skew y)), from y = asinh(x); relative error below 3e-7.
    constexpr S skewed_flattening(S x) const {
      S y = x * flattening(x);
      for (int k = 0; k < 2; ++k) {
        const S w = x * mechanism_detail::exponential<S>(Exponent<S>(-(skew * y)));
        const S slope = S(1) + skew * w / root<S>(S(S(1) + w * w));
        y = y - (y - w * flattening(w)) / slope;
      }
      const S bent = mechanism_detail::exponential<S>(Exponent<S>(-(skew * y)));
      return bent * flattening(x * bent);
    }
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
