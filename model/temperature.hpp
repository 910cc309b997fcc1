// The temperature dependence of resistances by Arrhenius, and the temperature of a cell that was not measured.
#pragma once

#include <cstdint>

#include "arithmetic/exponential.hpp"

namespace bms::model {

using namespace arithmetic;  // the physics uses these number types and functions

/// Temperature of a cell whose temperature was never measured [degrees C]: that of a room. It says nothing about the
/// cell file.
inline constexpr double assumed_ambient_c = 25;

namespace mechanism_detail {

/// exp(x) for |x| <= 4.5, the range of Factor.
template <class S>
constexpr Factor<S> exponential(const Exponent<S>& x) {
  const Exponent<S> none(0), most(4.5);
  if (x < none) return Factor<S>(Fraction<S>(1) - step_response<S>(-x < most ? Exponent<S>(-x) : most));
  const Fraction<S> remaining = Fraction<S>(Fraction<S>(1) - step_response<S>(x < most ? x : most));
  return ratio<Factor<S>>(Fraction<S>(1), remaining);
}

/// (T_ref - T) / T with T in kelvin; 0 for what is not a temperature.
template <class S>
constexpr Fraction<S> colder(const Temperature<S>& reference_c, const Temperature<S>& temperature_c) {
  const Temperature<S> kelvin = temperature_c + Temperature<S>(273.15);
  if (kelvin < Temperature<S>(150)) return Fraction<S>(0);
  return ratio<Fraction<S>>(Temperature<S>(reference_c - temperature_c), kelvin);
}

/// Arrhenius factor of a resistance with this activation energy, relative to reference_c. energy_over_rt: E / (R
/// T_ref).
///   exp(E / R (1 / T - 1 / T_ref)) = exp((E / (R T_ref)) (T_ref - T) / T)
template <class S>
constexpr Factor<S> arrhenius(const Factor<S>& energy_over_rt, const Temperature<S>& reference_c,
                              const Temperature<S>& temperature_c) {
  return exponential<S>(Exponent<S>(energy_over_rt * colder<S>(reference_c, temperature_c)));
}

inline constexpr double gas_constant_j_per_mol_k = 8.314462618;
template <class Real>
constexpr Real energy_over_rt(const Real& energy_j_per_mol, const Real& reference_c) {
  return energy_j_per_mol / (Real(gas_constant_j_per_mol_k) * (reference_c + Real(273.15)));
}

}  // namespace mechanism_detail

/// In the cold, resistances are larger than a cell file says that does not follow the temperature. The filter assumes
/// this activation energy of them: 30 to 60 kJ/mol for lithium iron phosphate.
inline constexpr double assumed_activation_j_per_mol = 40'000;

/// The temperature at which the tables are valid.
template <class S>
struct ReferenceTemperature {
  std::int16_t cdegc = 0;
  Temperature<S> c{};
  Factor<S> energy_over_rt{};  ///< of assumed_activation_j_per_mol

  static constexpr ReferenceTemperature of(double c) {
    return {static_cast<std::int16_t>(100 * c + (c < 0 ? -0.5 : 0.5)), Temperature<S>(c),
            Factor<S>(mechanism_detail::energy_over_rt(assumed_activation_j_per_mol, c))};
  }
};

}  // namespace bms::model
