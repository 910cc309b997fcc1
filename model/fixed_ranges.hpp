// Proof that in fixed point no number overflows, for every cell file that first_fault() accepts and for every reading
// of a sensor. Every compiler run that builds the estimator makes it.
//
// Sums and products: by their types. Q<I, F> (arithmetic/fixed.hpp) gives every sum and product a type that holds all
// its values; if 63 bits are not enough it does not compile. A value that is stored in a narrower type saturates there,
// so a state never wraps.
//
// Tables and constants: no value saturates. The assertions below use `accepted` (model/cell_parameters.hpp), by which
// files are refused.
//
// States:
//   soc    counted in 64 bits and clamped to -1/4 .. 5/4; estimator/charge.hpp asserts the sums before the clamp
//   v_rc   and the states of mechanisms and errors: x' = x + alpha (target - x), 0 <= alpha <= 1, lies between x and
//          target, and both fit their type
//   U, D   30 bits and an exponent in 32 more (arithmetic/scaled.hpp). In every step each entry results from a sum,
//          which limits its exponent to +-1,024. Fewer than a hundred products lie between two sums, and 100 x 1,024 is
//          far below 2^31. D stays positive: sums, products and quotients of positive numbers keep 30 digits of any
//          size
//
// tests/estimator/adversarial_inputs_test.cpp tries to break this with random cell files and samples, every signed
// operation checked.
#pragma once

#include "model/cell.hpp"

namespace bms::model::fixed_ranges {

using S = FixedPoint;
using accepted::Range;

/// Returns true if the value, rounded, is inside the range of T.
template <class T>
constexpr bool holds(double value) {
  const double most = static_cast<double>(T::highest());
  return value < most && value > -most;
}
template <class T>
constexpr bool holds(Range range) {
  return holds<T>(range.low) && holds<T>(range.high);
}

// Values in the tables. A delta covers at most the width of its interval (prepare() rounds widths down); outside, the
// end slopes of the OCV continue for outer_width.
static_assert(holds<Voltage<S>>(accepted::voltage_v));
static_assert(holds<Voltage<S>>(accepted::slope_v.high * outer_width), "the outer intervals of the OCV");
static_assert(holds<Voltage<S>>(accepted::voltage_v.high + 0.5), "a reading that is plausible");
static_assert(holds<Resistance<S>>(accepted::resistance_ohm));
// fits_fixed_point() refuses a larger C1.
static_assert(holds<Capacitance<S>>(accepted::fixed_capacitance_f));
// Between two nodes R1 and C1 are linear, so R1 C1 is at least the smaller of both ends and at most the product of the
// largest values.
static_assert(holds<Duration<S>>(accepted::resistance_ohm.high * accepted::fixed_capacitance_f));
static_assert(holds<Rate<S>>(1 / (accepted::time_constant_s.low - 1e-3)),
              "with the rounding of R1, C1 and their product");
static_assert(accepted::resistance_ohm.high * 2.0 / (1 << Capacitance<S>::fraction_bits) +
                      accepted::fixed_capacitance_f * 2.0 / (1 << Resistance<S>::fraction_bits) <
                  1e-3,
              "that rounding");
static_assert(static_cast<double>(PerSoc<S>(2 / accepted::least_width)) >= 1 / accepted::least_width &&
                  PerSoc<S>(2 / accepted::least_width).exponent <= 11,
              "the narrowest interval");
static_assert(holds<Current<S>>(accepted::current_a) && holds<Current<S>>(max_current_a) &&
              max_current_a * 1e6 < 0x1p31);
static_assert(holds<Current<S>>(accepted::capacity_ah.high), "the 1C current");
static_assert(holds<Temperature<S>>(accepted::reference_temperature_c) &&
              holds<Factor<S>>(mechanism_detail::energy_over_rt(assumed_activation_j_per_mol,
                                                                accepted::reference_temperature_c.low)));
static_assert(holds<Duration<S>>(accepted::lasts_s));
static_assert(holds<Fraction<S>>(accepted::most_gain) && holds<Fraction<S>>(accepted::most_resistance_error));
static_assert(holds<Fraction<S>>(1 / (3'600 * accepted::capacity_ah.low)), "SOC per ampere-second");
static_assert(holds<Soc<S>>(accepted::unknown_c.high / 3'600));

// Position of soc in an interval, in its own widths: below 2 inside, and outside 0 .. 1 up to the limits of counting.
static_assert(holds<Soc<S>>(2.0) && holds<Soc<S>>((max_soc - 1) / outer_width) &&
              holds<Soc<S>>((min_soc + outer_width) / outer_width));

}  // namespace bms::model::fixed_ranges
