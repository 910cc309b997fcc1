// Telemetry on CAN: what each frame holds, packed by the firmware and unpacked by the host from this one page.
// Little-endian; a value that is not known is sent as the field's invalid value; one that does not fit saturates.
//
//   id     content
//   0x180  u16 soc [0.01 %, 0xFFFF], u16 sigma of soc [0.01 %, 0xFFFF], u16 voltage [mV, 0xFFFF], i16 current [0.01 A, 0x8000]
//   0x181  i32 RC voltage [uV], i32 predicted voltage [uV]
//   0x182  u32 flags (estimator/estimate.hpp), u16 sample counter, u8 status counter, u8 reset cause (hal/power.hpp)
//   0x183  u32 hash of the cell file, u32 firmware version
//   0x184  u32 pc, u32 cfsr of the fault that ended the last run
//
// When: firmware/telemetry.hpp. soc is sent as it is estimated: below 0 as 0, above 100 % up to 125 %; unknown while the
// estimator has not started.
#pragma once

#include <concepts>
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
  std::int16_t current_ca = invalid_i16;            ///< 0.01 A, > 0 charges
};

struct EstimateDetail {
  std::int32_t v_rc_uv = 0;
  std::int32_t voltage_predicted_uv = 0;  ///< what the model expected before it saw the sample
};

struct Status {
  std::uint32_t flags = 0;            ///< Flag, or-ed
  std::uint16_t sample_counter = 0;   ///< samples since boot, whether told or not; wraps
  std::uint8_t status_counter = 0;    ///< this frame since boot; a jump tells how many were lost
  std::uint8_t reset_cause = 0;       ///< hal::ResetCause
};

struct Identity {
  std::uint32_t cell_hash = 0;  ///< first 32 bits of the cell file's SHA-256
  std::uint32_t version = 0;    ///< 0xMMmmpp
};

struct LastFault {
  std::uint32_t pc = 0;
  std::uint32_t cfsr = 0;  ///< ARMv7-M, B3.2.15
};

constexpr hal::CanFrame frame_of(const PackState& m) {
  hal::CanFrame frame{pack_state_id, 8, {}};
  hal::put_bytes(frame.data, 0, m.soc_permyriad);
  hal::put_bytes(frame.data, 2, m.soc_sigma_permyriad);
  hal::put_bytes(frame.data, 4, m.voltage_mv);
  hal::put_bytes(frame.data, 6, m.current_ca);
  return frame;
}

constexpr hal::CanFrame frame_of(const Status& m) {
  hal::CanFrame frame{status_id, 8, {}};
  hal::put_bytes(frame.data, 0, m.flags);
  hal::put_bytes(frame.data, 4, m.sample_counter);
  frame.data[6] = m.status_counter;
  frame.data[7] = m.reset_cause;
  return frame;
}

/// Two 32-bit words: the shape of the other frames.
template <std::integral T>
constexpr hal::CanFrame frame_of_two(std::uint16_t id, T first, T second) {
  hal::CanFrame frame{id, 8, {}};
  hal::put_bytes(frame.data, 0, first);
  hal::put_bytes(frame.data, 4, second);
  return frame;
}

constexpr hal::CanFrame frame_of(const EstimateDetail& m) { return frame_of_two(estimate_id, m.v_rc_uv, m.voltage_predicted_uv); }
constexpr hal::CanFrame frame_of(const Identity& m) { return frame_of_two(identity_id, m.cell_hash, m.version); }
constexpr hal::CanFrame frame_of(const LastFault& m) { return frame_of_two(fault_id, m.pc, m.cfsr); }

// What a frame says. The caller has seen that its id is the right one and its length 8.
constexpr PackState pack_state_of(const hal::CanFrame& frame) {
  return {hal::get_bytes<std::uint16_t>(frame.data, 0), hal::get_bytes<std::uint16_t>(frame.data, 2), hal::get_bytes<std::uint16_t>(frame.data, 4),
          hal::get_bytes<std::int16_t>(frame.data, 6)};
}

constexpr Status status_of(const hal::CanFrame& frame) {
  return {hal::get_bytes<std::uint32_t>(frame.data, 0), hal::get_bytes<std::uint16_t>(frame.data, 4), frame.data[6], frame.data[7]};
}

constexpr EstimateDetail estimate_detail_of(const hal::CanFrame& frame) {
  return {hal::get_bytes<std::int32_t>(frame.data, 0), hal::get_bytes<std::int32_t>(frame.data, 4)};
}

constexpr Identity identity_of(const hal::CanFrame& frame) {
  return {hal::get_bytes<std::uint32_t>(frame.data, 0), hal::get_bytes<std::uint32_t>(frame.data, 4)};
}

constexpr LastFault last_fault_of(const hal::CanFrame& frame) {
  return {hal::get_bytes<std::uint32_t>(frame.data, 0), hal::get_bytes<std::uint32_t>(frame.data, 4)};
}

/// value * per_unit to the nearest, held within lowest .. highest; for the estimate's fractions and volts, of any scalar.
/// NaN gives highest.
template <class T>
constexpr std::int32_t scaled(const T& value, std::int32_t per_unit, std::int32_t lowest, std::int32_t highest) {
  if constexpr (model::is_q<T>) {
    const std::int64_t product = static_cast<std::int64_t>(value.raw()) * per_unit + (std::int64_t{1} << (T::fraction_bits - 1));
    const std::int64_t rounded = product >> T::fraction_bits;
    return rounded > highest ? highest : rounded < lowest ? lowest : static_cast<std::int32_t>(rounded);
  } else {
    const T exact = value * static_cast<T>(per_unit);
    if (!(exact < static_cast<T>(highest))) return highest;
    if (exact <= static_cast<T>(lowest)) return lowest;
    return static_cast<std::int32_t>(exact + (exact < 0 ? T(-0.5) : T(0.5)));
  }
}

template <class S>
constexpr PackState pack_state(const Sample& sample, const Estimate<S>& estimate) {
  PackState m;
  constexpr std::int32_t most = invalid_u16 - 1;
  if ((estimate.flags & not_started) == 0) {
    m.soc_permyriad = static_cast<std::uint16_t>(scaled(estimate.soc, 10'000, 0, most));
    m.soc_sigma_permyriad = static_cast<std::uint16_t>(scaled(estimate.soc_sigma, 10'000, 0, most));
  }
  if (sample.voltage_uv != no_reading && sample.voltage_uv >= 0) {
    const std::int32_t mv = sample.voltage_uv / 1'000 + (sample.voltage_uv % 1'000) / 500;
    m.voltage_mv = static_cast<std::uint16_t>(mv < most ? mv : most);
  }
  if (sample.current_ua != no_reading) {
    constexpr std::int32_t most_ca = 0x7FFF;
    const std::int32_t ca = sample.current_ua / 10'000 + (sample.current_ua % 10'000) / 5'000;  // to the nearest
    m.current_ca = static_cast<std::int16_t>(ca > most_ca ? most_ca : ca < -most_ca ? -most_ca : ca);
  }
  return m;
}

template <class S>
constexpr EstimateDetail estimate_detail(const Estimate<S>& e) {
  constexpr std::int32_t most = 100'000'000;  // far outside any cell, and exact as a float
  return {scaled(e.v_rc_v, 1'000'000, -most, most), scaled(e.voltage_predicted_v, 1'000'000, -most, most)};
}

}  // namespace bms::messages
