// What the firmware tells of an estimate, in the messages of can/greybox_bms.dbc.
#pragma once

#include <cstdint>
#include <optional>

#include "can_messages.hpp"  // generated from can/greybox_bms.dbc
#include "estimator/condition.hpp"

namespace bms::messages {

/// A quantity of any scalar as a float: by its bits, without double arithmetic.
template <class T>
constexpr float number(const T& value) {
  if constexpr (model::is_q<T>) return static_cast<float>(value.raw()) * (1.0F / static_cast<float>(std::int64_t{1} << T::fraction_bits));
  else return static_cast<float>(value);
}
template <class T>
constexpr float percent(const T& fraction) {
  return 100.0F * number(fraction);
}

struct Identity {
  std::uint32_t cell_hash = 0;  ///< first 32 bits of the cell file's SHA-256
  std::uint32_t version = 0;    ///< 0xMMmmpp
};

constexpr can::Identity identity(const Identity& i) {
  can::Identity m;
  m.cell_hash = i.cell_hash;
  m.version_major = i.version >> 16 & 0xFF;
  m.version_minor = i.version >> 8 & 0xFF;
  m.version_patch = i.version & 0xFF;
  return m;
}

template <class S>
constexpr std::uint32_t soc_quality(const Estimate<S>& e, bool observable) {
  using M = can::PackState;
  if ((e.flags & not_started) != 0) return M::soc_quality_not_started;
  if ((e.flags & voltage_disbelieved) != 0) return M::soc_quality_the_voltage_contradicts;
  if ((e.flags & soc_unsettled) != 0) return M::soc_quality_more_than_one_state_of_charge_fits;
  return observable ? M::soc_quality_told_by_the_voltage : M::soc_quality_carried_by_counting;
}

template <class Condition, class S>
constexpr can::PackState pack_state(const Estimate<S>& e, const Condition& condition) {
  can::PackState m;
  m.soc_quality = soc_quality(e, condition.quality().observable);
  if ((e.flags & not_started) != 0) return m;
  m.soc = percent(e.soc);
  m.soc_sigma = percent(e.soc_sigma);
  m.soc_display = percent(condition.display_soc());
  return m;
}

constexpr can::PackElectrical pack_electrical(const Sample& sample) {
  can::PackElectrical m;
  if (sample.voltage_uv != no_reading && sample.voltage_uv >= 0) m.voltage = static_cast<float>(sample.voltage_uv) * 1e-6F;
  if (sample.current_ua != no_reading) m.current = static_cast<float>(sample.current_ua) * 1e-6F;
  if (temperature_possible(sample.temperature_cdegc)) m.temperature = static_cast<float>(sample.temperature_cdegc) * 0.01F;
  return m;
}

template <class S>
constexpr can::ModelDetail model_detail(const Estimate<S>& e) {
  can::ModelDetail m;
  m.voltage_rc = number(e.v_rc_v);
  m.voltage_predicted = number(e.voltage_predicted_v);
  return m;
}

template <class Condition>
constexpr can::CurrentLimits current_limits(const Condition& condition) {
  can::CurrentLimits m;
  m.discharge_now = number(condition.limits_now().discharge_a);
  m.charge_now = number(condition.limits_now().charge_a);
  m.discharge_ten_seconds = number(condition.limits_10s().discharge_a);
  m.charge_ten_seconds = number(condition.limits_10s().charge_a);
  return m;
}

template <class Condition>
constexpr can::Health health(const Condition& condition) {
  can::Health m;
  m.capacity = percent(condition.capacity().ratio);
  m.capacity_sigma = percent(condition.capacity().sigma);
  m.resistance = percent(condition.resistance().ratio);
  m.resistance_sigma = percent(condition.resistance().sigma);
  return m;
}

template <class Condition>
constexpr can::SocAnchor soc_anchor(const Condition& condition) {
  can::SocAnchor m;
  const auto& now = condition.quality();
  m.observable = now.observable ? 1 : 0;
  m.seconds_since_anchor = static_cast<float>(now.bridged_s);
  m.charge_since_anchor = percent(now.bridged_soc);
  return m;
}

/// capacity_ah: what a current of one is in the filter's units.
template <class Result>
constexpr can::SensorErrors sensor_errors(const Result& e, float capacity_ah) {
  can::SensorErrors m;
  if constexpr (requires { e.further; }) {
    m.voltage_error = number(e.further[0]);
    m.current_offset = number(e.further[1]) * capacity_ah;
    m.current_offset_sigma = number(e.further[2]) * capacity_ah;
  }
  return m;
}

// What the estimator saw, bit for bit.

constexpr can::SampleCurrent sample_current(const Sample& sample, std::uint16_t counter) {
  can::SampleCurrent m;
  m.current_ua = sample.current_ua;
  m.sample_counter = counter;
  return m;
}
constexpr can::SampleVoltage sample_voltage(const Sample& sample) {
  can::SampleVoltage m;
  m.voltage_uv = sample.voltage_uv;
  m.temperature_cdegc = sample.temperature_cdegc;
  return m;
}
constexpr can::SampleTime sample_time(const Sample& sample) {
  can::SampleTime m;
  m.time_low = static_cast<std::uint32_t>(sample.time_us);
  m.time_high = static_cast<std::uint32_t>(sample.time_us >> 32) & 0xFFFF;  // nine years
  return m;
}
constexpr can::StartingSoc starting_soc(const std::optional<StartingPoint>& start) {
  can::StartingSoc m;
  m.soc_ppb = start ? start->soc_ppb : 0;
  m.given = start ? can::StartingSoc::given_yes : can::StartingSoc::given_no;
  return m;
}
constexpr can::StartingSigma starting_sigma(const std::optional<StartingPoint>& start) {
  can::StartingSigma m;
  m.sigma_ppb = start ? start->soc_sigma_ppb : 0;
  return m;
}

}  // namespace bms::messages
