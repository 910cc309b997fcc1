// Telemetry on CAN: what each frame holds, packed by the firmware and unpacked by the host from this one page.
// Little-endian; a value that is not known is sent as the field's invalid value; one that does not fit saturates.
//
//   id     cycle     content
//   0x180  sample    u16 soc [0.01 %, 0xFFFF], u16 sigma of soc [0.01 %, 0xFFFF], u16 voltage [mV, 0xFFFF], i16 current [0.1 A, 0x8000]
//   0x181  sample    i32 RC voltage [uV], i32 predicted voltage [uV]
//   0x182  sample    u32 flags (estimator/estimate.hpp), u16 sample counter, u8 frame counter, u8 reset cause
//   0x183  1 s       u32 hash of the cell file, u32 firmware version
//   0x184  once      u32 pc, u32 cfsr of the fault that ended the last run; only if there was one
//
// soc is sent as it is estimated: below 0 as 0, above 100 % up to 125 %.
#pragma once

#include <cstdint>

#include "estimator/estimate.hpp"
#include "estimator/sample.hpp"
#include "hal/bytes.hpp"
#include "hal/can.hpp"

namespace bms::messages {

inline constexpr std::uint16_t pack_state_id = 0x180, estimate_id = 0x181, status_id = 0x182, identity_id = 0x183, fault_id = 0x184;
inline constexpr std::uint16_t invalid_u16 = 0xFFFF;
inline constexpr std::int16_t invalid_i16 = -0x8000;

struct PackState {
  std::uint16_t soc_permyriad = invalid_u16;        ///< 0.01 %
  std::uint16_t soc_sigma_permyriad = invalid_u16;  ///< 0.01 %
  std::uint16_t voltage_mv = invalid_u16;
  std::int16_t current_da = invalid_i16;            ///< 0.1 A
};

struct Status {
  std::uint32_t flags = 0;
  std::uint16_t sample_counter = 0;
  std::uint8_t frame_counter = 0;
  std::uint8_t reset_cause = 0;
};

constexpr hal::CanFrame frame_of(const PackState& m) {
  hal::CanFrame frame{pack_state_id, 8, {}};
  hal::put_bytes(frame.data, 0, m.soc_permyriad);
  hal::put_bytes(frame.data, 2, m.soc_sigma_permyriad);
  hal::put_bytes(frame.data, 4, m.voltage_mv);
  hal::put_bytes(frame.data, 6, m.current_da);
  return frame;
}

constexpr hal::CanFrame frame_of(const Status& m) {
  hal::CanFrame frame{status_id, 8, {}};
  hal::put_bytes(frame.data, 0, m.flags);
  hal::put_bytes(frame.data, 4, m.sample_counter);
  frame.data[6] = m.frame_counter;
  frame.data[7] = m.reset_cause;
  return frame;
}

/// Two 32-bit words: the shape of the other frames.
template <class T>
constexpr hal::CanFrame frame_of_two(std::uint16_t id, T first, T second) {
  hal::CanFrame frame{id, 8, {}};
  hal::put_bytes(frame.data, 0, first);
  hal::put_bytes(frame.data, 4, second);
  return frame;
}

constexpr PackState pack_state_of(const hal::CanFrame& frame) {
  return {hal::get_bytes<std::uint16_t>(frame.data, 0), hal::get_bytes<std::uint16_t>(frame.data, 2), hal::get_bytes<std::uint16_t>(frame.data, 4),
          hal::get_bytes<std::int16_t>(frame.data, 6)};
}

constexpr Status status_of(const hal::CanFrame& frame) {
  return {hal::get_bytes<std::uint32_t>(frame.data, 0), hal::get_bytes<std::uint16_t>(frame.data, 4), frame.data[6], frame.data[7]};
}

/// value / unit to the nearest, held within 0 .. highest; for the estimate's fractions and volts, of any scalar.
template <class T>
constexpr std::int32_t scaled(const T& value, std::int32_t per_unit, std::int32_t lowest, std::int32_t highest) {
  std::int32_t result = 0;
  if constexpr (model::is_q<T>) {
    const std::int64_t product = static_cast<std::int64_t>(value.raw()) * per_unit + (std::int64_t{1} << (T::fraction_bits - 1));
    const std::int64_t rounded = product >> T::fraction_bits;
    result = rounded > highest ? highest : rounded < lowest ? lowest : static_cast<std::int32_t>(rounded);
  } else {
    const T exact = value * static_cast<T>(per_unit);
    if (exact >= static_cast<T>(highest)) return highest;
    if (exact <= static_cast<T>(lowest)) return lowest;
    result = static_cast<std::int32_t>(exact + (exact < 0 ? T(-0.5) : T(0.5)));
  }
  return result;
}

template <class S>
constexpr PackState pack_state(const Sample& sample, const Estimate<S>& estimate) {
  PackState m;
  constexpr std::int32_t most = invalid_u16 - 1;
  m.soc_permyriad = static_cast<std::uint16_t>(scaled(estimate.soc, 10'000, 0, most));
  m.soc_sigma_permyriad = static_cast<std::uint16_t>(scaled(estimate.soc_sigma, 10'000, 0, most));
  if (sample.voltage_uv != no_reading && sample.voltage_uv >= 0) {
    const std::int32_t mv = (sample.voltage_uv + 500) / 1'000;
    m.voltage_mv = static_cast<std::uint16_t>(mv < most ? mv : most);
  }
  if (sample.current_ua != no_reading) {
    const std::int32_t da = sample.current_ua / 100'000;  // +-21,474: fits
    m.current_da = static_cast<std::int16_t>(da);
  }
  return m;
}

template <class S>
constexpr hal::CanFrame estimate_frame(const Estimate<S>& e) {
  constexpr std::int32_t most = 100'000'000;
  return frame_of_two(estimate_id, scaled(e.v_rc_v, 1'000'000, -most, most), scaled(e.voltage_predicted_v, 1'000'000, -most, most));
}

}  // namespace bms::messages
