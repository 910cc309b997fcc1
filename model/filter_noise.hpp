// Noise and persistent errors of a cell file, in the units of the filter.
#pragma once

#include <cstdint>

#include "arithmetic/scalar.hpp"
#include "model/cell_parameters.hpp"
#include "model/temperature.hpp"

namespace bms::model {

using namespace arithmetic;  // the physics uses these number types and functions

/// Largest current of any sensor [A]; limits the plausible range and the unknown current.
inline constexpr double max_current_a = 2'000;

/// Largest time constant of the filter [s]: the range of Duration in fixed point.
inline constexpr double longest_duration_s = 131'000;

/// Limits of a current reading at rest (estimator/current_at_rest.hpp).
struct RestingCurrent {
  std::int32_t largest_ua = 0;  ///< that can be an offset, either sign
  std::int32_t still_ua = 0;    ///< by which a resting reading may move
};

/// Temperatures of the identification, and how the error of the overpotential grows outside of them.
template <class S>
struct IdentifiedTemperatures {
  std::int16_t min_cdegc = 0, max_cdegc = 0;
  Temperature<S> min_c{}, max_c{};
  Factor<S> per_colder{}, per_hotter{};  ///< tolerance.resistance_per_ev / (k T_edge): times (T_edge - T) / T
};

/// Noise in the filter's units.
template <class S>
struct FilterNoise {
  Variance<S> voltage_v2{};           ///< white, per sample
  Variance<S> model_v2{};             ///< the part of Interval::error_v2 that does not depend on the SOC
  Duration<S> model_correlation_s{};  ///< correlation time of Interval::error_v2 and of the resistance error
  Fraction<S> resistance_error{};     ///< relative standard deviation of the overpotential
  Soc<S> soc_axis{};                  ///< standard deviation of the tables' SOC axis
  IdentifiedTemperatures<S> identified;
  Variance<S> v_rc_v2{};  ///< in the steady state
  Variance<S> rest_v2{};
  Soc<S> white_soc_per_s{};       ///< current_a over the capacity
  Variance<S> walk_soc2_per_s{};  ///< slow current error: 2 offset^2 correlation / capacity^2
  Variance<S> offset_per_h2{};    ///< the same as a state: (current_offset_a over the capacity in Ah)^2
  Duration<S> current_offset_correlation_s{};
  Variance<S> at_rest_per_h2{};  ///< (current_at_rest_a over the capacity in Ah)^2; 0: unknown
  RestingCurrent at_rest;
  Fraction<S> gain{};          ///< current_gain
  Current<S> one_c_a{};        ///< moves the capacity in one hour
  Soc<S> unknown_soc_per_s{};  ///< current_unknown_a over the capacity
  Current<S> unknown_a{};
};

namespace cell_detail {

/// A current in microamperes, max_current_a at most.
constexpr std::int32_t micro_a(double a) {
  return static_cast<std::int32_t>(1e6 * (a < max_current_a ? a : max_current_a));
}

/// A file that does not state its range was identified at the temperature of its tables.
template <class S, class Real>
constexpr IdentifiedTemperatures<S> identified_temperatures(const CellParameters<Real>& p) {
  constexpr double kelvin_per_ev = 11'604.518;
  const auto edge = [&](double c) { return c == IdentifiedRange::unknown ? p.reference_temperature_c : c; };
  const auto cdegc = [](double c) { return static_cast<std::int16_t>(100 * c + (c < 0 ? -0.5 : 0.5)); };
  const auto per = [&](double c) { return Factor<S>(p.tolerance.resistance_per_ev * kelvin_per_ev / (c + 273.15)); };
  const double min_c = edge(p.range.temperature_min_c), max_c = edge(p.range.temperature_max_c);
  return {cdegc(min_c), cdegc(max_c), Temperature<S>(min_c), Temperature<S>(max_c), per(min_c), per(max_c)};
}

template <class S, class Real>
constexpr FilterNoise<S> filter_noise(const CellParameters<Real>& p, double capacity_as) {
  FilterNoise<S> f;
  const Noise& n = p.noise;
  const auto square = [](double v) { return v * v; };
  f.voltage_v2 = Variance<S>(square(n.voltage_v));
  f.model_v2 = Variance<S>(square(n.model_v));
  f.model_correlation_s = Duration<S>(n.model_correlation_s);
  f.resistance_error = Fraction<S>(p.tolerance.resistance_fraction);
  f.soc_axis = Soc<S>(p.tolerance.initial_soc);
  f.identified = identified_temperatures<S>(p);
  f.v_rc_v2 = Variance<S>(square(n.v_rc_v));
  f.rest_v2 = Variance<S>(square(n.rest_v));
  f.white_soc_per_s = Soc<S>(n.current_a / capacity_as);
  f.walk_soc2_per_s = Variance<S>(2 * square(n.current_offset_a / capacity_as) * n.current_offset_correlation_s);
  f.offset_per_h2 = Variance<S>(square(n.current_offset_a / p.capacity_ah));
  f.current_offset_correlation_s = Duration<S>(
      n.current_offset_correlation_s < longest_duration_s ? n.current_offset_correlation_s : longest_duration_s);
  f.at_rest_per_h2 = Variance<S>(square(n.current_at_rest_a / p.capacity_ah));
  f.at_rest = {micro_a(3 * (n.current_offset_a + n.current_at_rest_a)), micro_a(n.current_offset_a)};
  f.gain = Fraction<S>(n.current_gain);
  f.one_c_a = Current<S>(p.capacity_ah);
  f.unknown_soc_per_s = Soc<S>(n.current_unknown_a / capacity_as);
  f.unknown_a = Current<S>(n.current_unknown_a < max_current_a ? n.current_unknown_a : max_current_a);
  return f;
}

}  // namespace cell_detail

}  // namespace bms::model
