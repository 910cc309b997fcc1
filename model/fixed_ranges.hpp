// Proof, made by every compiler run that builds the estimator, that in fixed point no number overflows, whatever cell
// file first_fault() accepts and whatever a sensor says.
//
// Sums and products: by their types. Q<I, F> (arithmetic/fixed.hpp) makes of every sum and product a type that holds
// all it can be; where 63 bits are not enough it does not compile. What is stored in a narrower type saturates there,
// so a state never wraps.
//
// Tables and constants: none of them saturates. The assertions below take `accepted` (model/cell_parameters.hpp), by
// which files are refused.
//
// States:
//   soc     counted in 64 bits and held within -1/4 .. 5/4; what is added before it is held is asserted in
//   estimator/charge.hpp v_rc, and what mechanisms and errors have for it: x' = x + p (target - x), 0 <= p <= 1, is
//   between x and target, both within their type U, D    30 bits and a power of two in 32 more (arithmetic/scaled.hpp).
//   Each entry comes out of a sum in every step, which holds its power within
//           +-1,024; no number goes through a hundred products between two sums, and 100 x 1,024 is far below 2^31. D
//           stays positive: sums, products and quotients of positive numbers keep 30 digits of whatever size
//
// tests/estimator/adversarial_inputs_test.cpp tries to break it: random cell files and samples, every signed operation
// checked.
#pragma once

#include "model/cell.hpp"

namespace bms::model::fixed_ranges {

using S = FixedPoint;
using accepted::Range;

/// Either end, rounded, is inside the type.
template <class T>
constexpr bool holds(double value) {
  const double most = static_cast<double>(T::highest());
  return value < most && value > -most;
}
template <class T>
constexpr bool holds(Range range) {
  return holds<T>(range.low) && holds<T>(range.high);
}

// What the tables hold. A value's delta is that over at most an interval's own width (prepare() rounds widths down);
// outside, the OCV's end slopes go on for outer_width.
static_assert(holds<Voltage<S>>(accepted::voltage_v));
static_assert(holds<Voltage<S>>(accepted::slope_v.high * outer_width), "the outer intervals of the OCV");
static_assert(holds<Voltage<S>>(accepted::voltage_v.high + 0.5), "a reading that is plausible");
static_assert(holds<Resistance<S>>(accepted::resistance_ohm) && holds<Capacitance<S>>(accepted::capacitance_f));
// Between two nodes R1 and C1 are straight lines, so that R1 C1 is not below the smaller of both ends; and not above
// the product of the largest.
static_assert(holds<Duration<S>>(accepted::resistance_ohm.high * accepted::capacitance_f.high));
static_assert(holds<Rate<S>>(1 / (accepted::time_constant_s.low - 1e-3)),
              "with the rounding of R1, C1 and their product");
static_assert(accepted::resistance_ohm.high * 2.0 / (1 << Capacitance<S>::fraction_bits) +
                      accepted::capacitance_f.high * 2.0 / (1 << Resistance<S>::fraction_bits) <
                  1e-3,
              "that rounding");
static_assert(static_cast<double>(PerSoc<S>(2 / accepted::least_width)) >= 1 / accepted::least_width &&
                  PerSoc<S>(2 / accepted::least_width).exponent <= 11,
              "the narrowest interval");
static_assert(holds<Current<S>>(accepted::current_a) && holds<Current<S>>(max_current_a) &&
              max_current_a * 1e6 < 0x1p31);
static_assert(holds<Current<S>>(accepted::capacity_ah.high), "the 1C current");
static_assert(holds<Duration<S>>(accepted::lasts_s));
static_assert(holds<Fraction<S>>(accepted::most_gain) && holds<Fraction<S>>(accepted::most_resistance_error));
static_assert(holds<Fraction<S>>(1 / (3'600 * accepted::capacity_ah.low)), "what an ampere makes of soc in a second");
static_assert(holds<Soc<S>>(accepted::unknown_c.high / 3'600));

// Where soc can be, in an interval's own steps: below 2 in its own, beyond 0 and 1 as far as counting goes.
static_assert(holds<Soc<S>>(2.0) && holds<Soc<S>>((max_soc - 1) / outer_width) &&
              holds<Soc<S>>((min_soc + outer_width) / outer_width));

}  // namespace bms::model::fixed_ranges
