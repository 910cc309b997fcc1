// The functions of greybox/greybox.h for one cell. Include it in exactly one source, after the header of the cell:
//
//   #include "my_cell.hpp"               // bms cell header my_cell.toml --out my_cell.hpp
//   #include <greybox/c_interface.hpp>
//
// GREYBOX_SCALAR: float if not defined; greybox::FixedPoint for a core without an FPU. In CMake,
// greybox_c_library() writes and compiles this source.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <new>
#include <type_traits>

#include "library/greybox/estimator.hpp"
#include "library/greybox/greybox.h"

#ifndef GREYBOX_SCALAR
#define GREYBOX_SCALAR float
#endif

struct greybox_estimator {
  using Filter = greybox::Estimator<GREYBOX_SCALAR, bms::generated::Model>;
  static constexpr std::uint32_t created = 0x67726579;  ///< what the first word of an estimator holds

  explicit greybox_estimator(const greybox_start* start)
      : filter(start == nullptr
                   ? Filter()
                   : Filter(greybox::StartingPoint{.soc_ppb = start->soc_ppb, .soc_sigma_ppb = start->soc_sigma_ppb})) {
  }

  std::uint32_t mark = created;
  greybox_estimate last{.soc = 0.5F,
                        .soc_sigma = 0.289F,  // anything from 0 to 1: 1 / sqrt(12)
                        .v_rc_v = 0,
                        .voltage_predicted_v = 0,
                        .flags = GREYBOX_NOT_STARTED};
  Filter filter;
};

namespace greybox::c_interface {

static_assert(sizeof(greybox_estimator) <= GREYBOX_MEMORY_BYTES, "this cell needs a larger GREYBOX_MEMORY_BYTES");
static_assert(alignof(greybox_estimator) <= alignof(greybox_memory));
static_assert(std::is_trivially_destructible_v<greybox_estimator>, "nothing has to be done when an estimator ends");

/// A number of an estimate; fixed point has 27 fraction bits, so the rounding to float is below 6e-8 of the value.
template <class T>
float number(const T& value) {
  if constexpr (bms::arithmetic::is_q<T>)
    return static_cast<float>(value.raw()) * (1.0F / static_cast<float>(std::int64_t{1} << T::fraction_bits));
  else
    return static_cast<float>(value);
}

struct FlagText {
  std::uint32_t flag;
  const char* text;
};
inline constexpr std::array flag_texts = {
    FlagText{Flag::voltage_missing, "the voltage is missing"},
    FlagText{Flag::voltage_implausible, "the voltage is outside the range that the cell can have"},
    FlagText{Flag::voltage_stuck, "the voltage reading does not change although the model's voltage does"},
    FlagText{Flag::current_missing, "the current is missing"},
    FlagText{Flag::current_implausible, "the current is outside the range that the cell can have"},
    FlagText{Flag::time_gap, "a gap: more than ten times the usual step since the last sample"},
    FlagText{Flag::time_not_increasing, "the time does not increase; the sample was ignored"},
    FlagText{Flag::current_beyond_limits,
             "the current is beyond the limits of the cell file, but it lasts: it is used"},
    FlagText{Flag::not_started, "no usable voltage yet and no starting point"},
    FlagText{Flag::soc_ambiguous, "more than one state of charge fits the voltages so far"},
    FlagText{Flag::voltage_rejected, "the voltage contradicts the model and was not used"},
    FlagText{Flag::not_a_number, "a result was not a number; the estimator has started again"},
    FlagText{Flag::soc_contradicted, "the voltages contradicted the state of charge; it is estimated again"},
};

static_assert(std::uint32_t{GREYBOX_VOLTAGE_MISSING} == Flag::voltage_missing &&
              std::uint32_t{GREYBOX_VOLTAGE_IMPLAUSIBLE} == Flag::voltage_implausible &&
              std::uint32_t{GREYBOX_VOLTAGE_STUCK} == Flag::voltage_stuck &&
              std::uint32_t{GREYBOX_CURRENT_MISSING} == Flag::current_missing &&
              std::uint32_t{GREYBOX_CURRENT_IMPLAUSIBLE} == Flag::current_implausible &&
              std::uint32_t{GREYBOX_TIME_GAP} == Flag::time_gap &&
              std::uint32_t{GREYBOX_TIME_NOT_INCREASING} == Flag::time_not_increasing &&
              std::uint32_t{GREYBOX_CURRENT_BEYOND_LIMITS} == Flag::current_beyond_limits &&
              std::uint32_t{GREYBOX_NOT_STARTED} == Flag::not_started &&
              std::uint32_t{GREYBOX_SOC_AMBIGUOUS} == Flag::soc_ambiguous &&
              std::uint32_t{GREYBOX_VOLTAGE_REJECTED} == Flag::voltage_rejected &&
              std::uint32_t{GREYBOX_NOT_A_NUMBER} == Flag::not_a_number &&
              std::uint32_t{GREYBOX_SOC_CONTRADICTED} == Flag::soc_contradicted);
static_assert(GREYBOX_NO_READING == no_reading && GREYBOX_NO_TEMPERATURE == no_temperature);

}  // namespace greybox::c_interface

extern "C" {

size_t greybox_size(void) { return sizeof(greybox_estimator); }

greybox_status greybox_create(void* memory, size_t bytes, const greybox_start* start, greybox_estimator** estimator) {
  if (estimator == nullptr) return GREYBOX_BAD_ARGUMENT;
  *estimator = nullptr;
  if (memory == nullptr) return GREYBOX_BAD_ARGUMENT;
  if (bytes < sizeof(greybox_estimator)) return GREYBOX_MEMORY_TOO_SMALL;
  if (reinterpret_cast<std::uintptr_t>(memory) % alignof(greybox_estimator) != 0) return GREYBOX_MEMORY_MISALIGNED;
  *estimator = new (memory) greybox_estimator(start);
  return GREYBOX_OK;
}

greybox_status greybox_step(greybox_estimator* estimator, const greybox_sample* sample, greybox_estimate* estimate) {
  using greybox::c_interface::number;
  if (estimator == nullptr || sample == nullptr) return GREYBOX_BAD_ARGUMENT;
  if (estimator->mark != greybox_estimator::created) return GREYBOX_NOT_CREATED;
  const auto e = estimator->filter.step(bms::generated::cell<GREYBOX_SCALAR>,
                                        greybox::Sample{.time_us = sample->time_us,
                                                        .current_ua = sample->current_ua,
                                                        .voltage_uv = sample->voltage_uv,
                                                        .temperature_cdegc = sample->temperature_cdegc});
  estimator->last = {.soc = number(e.soc),
                     .soc_sigma = number(e.soc_sigma),
                     .v_rc_v = number(e.v_rc_v),
                     .voltage_predicted_v = number(e.voltage_predicted_v),
                     .flags = e.flags};
  if (estimate != nullptr) *estimate = estimator->last;
  return GREYBOX_OK;
}

greybox_status greybox_state(const greybox_estimator* estimator, greybox_estimate* estimate) {
  if (estimator == nullptr || estimate == nullptr) return GREYBOX_BAD_ARGUMENT;
  if (estimator->mark != greybox_estimator::created) return GREYBOX_NOT_CREATED;
  *estimate = estimator->last;
  return GREYBOX_OK;
}

const char* greybox_status_text(greybox_status status) {
  switch (status) {
    case GREYBOX_OK:
      return "no error";
    case GREYBOX_BAD_ARGUMENT:
      return "a pointer is NULL";
    case GREYBOX_MEMORY_TOO_SMALL:
      return "the memory is smaller than greybox_size()";
    case GREYBOX_MEMORY_MISALIGNED:
      return "the memory is not aligned; use greybox_memory";
    case GREYBOX_NOT_CREATED:
      return "the memory holds no estimator; call greybox_create() first";
  }
  return "no such status";
}

const char* greybox_flag_text(uint32_t flags) {
  for (const auto& [flag, text] : greybox::c_interface::flag_texts) {
    if ((flags & flag) != 0) return text;
  }
  return flags == 0 ? "" : "no such flag";
}

const char* greybox_cell_name(void) { return bms::generated::cell_name; }

uint32_t greybox_cell_hash(void) { return bms::generated::cell_hash; }

}  // extern "C"
