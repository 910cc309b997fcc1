// The output of the estimator after each sample.
#pragma once

#include <array>
#include <bit>
#include <concepts>
#include <cstdint>

#include "arithmetic/scalar.hpp"

namespace bms::estimator {

/// Why an estimate is less accurate than usual; several reasons are or-ed. Bits 0-7: the sample; 8-15: the estimator.
enum Flag : std::uint32_t {
  voltage_missing = 1U << 0,
  voltage_implausible = 1U << 1,  ///< outside the range that the cell can have
  voltage_stuck = 1U << 2,        ///< the reading stays the same while the model's voltage changes
  current_missing = 1U << 3,
  current_implausible = 1U << 4,
  time_gap = 1U << 5,               ///< more than ten times the usual step: the charge in between is uncertain
  time_not_increasing = 1U << 6,    ///< the sample was ignored
  current_beyond_limits = 1U << 7,  ///< beyond the plausible range, but it lasts: used
  not_started = 1U << 8,            ///< no usable voltage yet and no starting point
  soc_ambiguous = 1U << 9,          ///< more than one state of charge fits the voltages so far; soc_sigma spans them
  /// Far from every voltage that the model can explain, so not used. If this persists, the SOC is estimated again.
  voltage_rejected = 1U << 10,
  /// A result was not a number. The estimator started again from the counted charge, with an unknown SOC.
  not_a_number = 1U << 11,
  /// The voltages of the last half hour contradicted the state of charge, which is being estimated again.
  soc_contradicted = 1U << 12,
};

template <class S>
struct Estimate {
  arithmetic::Soc<S> soc{};                      ///< fraction, after the correction by this sample's voltage
  arithmetic::Soc<S> soc_sigma{};                ///< its standard deviation
  arithmetic::Voltage<S> v_rc_v{};               ///< after the correction
  arithmetic::Voltage<S> voltage_predicted_v{};  ///< before it: the voltage that the model expected
  std::uint32_t flags = 0;                       ///< Flag
};

/// An estimate with the other states of an extended cell (model/extended_rc.hpp), after the correction: if errors are
/// states, the voltage error [V], the current offset [capacity per hour] and its standard deviation; then the states of
/// the mechanisms.
template <class S, std::size_t N>
struct ExtendedEstimate : Estimate<S> {
  std::array<arithmetic::Voltage<S>, N> extra{};
};

/// Whether every number of an estimate in floating point is finite, and sigma above 0. Not-a-number and infinity times
/// 0 are not-a-number, so one comparison decides.
template <class S>
constexpr auto is_finite(const Estimate<S>& e, const S& more = S(0)) {
  const S sum = e.voltage_predicted_v + e.v_rc_v + more;
  return e.soc_sigma > (sum + e.soc_sigma) * S(0);
}
template <class S, std::size_t N>
constexpr auto is_finite(const ExtendedEstimate<S, N>& e) {
  S sum(0);
  for (const S& value : e.extra) sum += value;
  return is_finite<S>(static_cast<const Estimate<S>&>(e), sum);
}

/// Number of 32-bit words of an estimate, and their names in that order: host and board are compared word by word.
inline constexpr std::size_t estimate_words = 5;
inline constexpr std::array<const char*, estimate_words> estimate_word_names = {"soc", "soc_sigma", "v_rc_v",
                                                                                "voltage_predicted_v", "flags"};
using EstimateWords = std::array<std::uint32_t, estimate_words>;

/// The bits of one number of an estimate. Host and board must agree in them.
template <class T>
constexpr std::uint32_t word(const T& value) {
  if constexpr (arithmetic::is_q<T>) {
    return static_cast<std::uint32_t>(value.raw());
  } else {
    static_assert(std::same_as<T, float>, "a board computes in float or in fixed point");
    return std::bit_cast<std::uint32_t>(value);
  }
}

template <class S>
constexpr EstimateWords words(const Estimate<S>& e) {
  return {word(e.soc), word(e.soc_sigma), word(e.v_rc_v), word(e.voltage_predicted_v), e.flags};
}

/// The other states follow the five words.
template <class S, std::size_t N>
constexpr std::array<std::uint32_t, estimate_words + N> words(const ExtendedEstimate<S, N>& e) {
  std::array<std::uint32_t, estimate_words + N> all{};
  const EstimateWords first = words(static_cast<const Estimate<S>&>(e));
  for (std::size_t k = 0; k < estimate_words; ++k) all[k] = first[k];
  for (std::size_t k = 0; k < N; ++k) all[estimate_words + k] = word(e.extra[k]);
  return all;
}

/// Hash of all estimates of a run, to compare two runs. FNV-1a, 32 bits, over the words, low byte first (G. Fowler,
/// L. Noll, K. Vo, draft-eastlake-fnv).
class EstimateHash {
 public:
  template <std::size_t N>
  constexpr void add(const std::array<std::uint32_t, N>& words) {
    for (const std::uint32_t w : words) {
      for (unsigned shift = 0; shift < 32; shift += 8) value_ = (value_ ^ (w >> shift & 0xFF)) * 16'777'619U;
    }
  }
  constexpr std::uint32_t value() const { return value_; }

 private:
  std::uint32_t value_ = 2'166'136'261U;
};

}  // namespace bms::estimator
