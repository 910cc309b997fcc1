// Converts estimates, decisions and states into the messages of firmware/can/greybox_bms.dbc.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>

#include "can_messages.hpp"  // generated from firmware/can/greybox_bms.dbc
#include "estimator/condition.hpp"
#include "estimator/pack_estimator.hpp"
#include "hal/board_state.hpp"
#include "hal/power.hpp"
#include "hal/second_line.hpp"
#include "protection/protection.hpp"
#include "storage/persistence.hpp"

namespace bms::firmware::messages {

/// Converts a quantity of any scalar type to float, without double arithmetic.
template <class T>
constexpr float number(const T& value) {
  if constexpr (arithmetic::is_q<T>)
    return static_cast<float>(value.raw()) * (1.0F / static_cast<float>(std::int64_t{1} << T::fraction_bits));
  else
    return static_cast<float>(value);
}
template <class T>
constexpr float percent(const T& fraction) {
  return 100.0F * number(fraction);
}

/// Whether an estimate can be used at all: finite, and not certain.
template <class Estimate>
constexpr bool is_number(const Estimate& e) {
  const float sum = number(e.soc) + number(e.soc_sigma);
  return sum * 0 == 0 && number(e.soc_sigma) > 0;  // not so for infinity
}

/// Converts to units of 1e-9. Clamped to -2..2; not-a-number becomes 0.
template <class T>
constexpr std::int32_t ppb(const T& value) {
  if constexpr (arithmetic::is_q<T>) {
    static_assert(T::fraction_bits <= 31);
    constexpr std::int64_t most = std::int64_t{2} << T::fraction_bits;
    const std::int64_t clamped = std::clamp<std::int64_t>(value.raw(), -most, most);
    return static_cast<std::int32_t>(clamped * 1'000'000'000 >> T::fraction_bits);
  } else {
    float clamped = 0;  // not a number
    if (value > 2)
      clamped = 2;
    else if (value < -2)
      clamped = -2;
    else if (value <= 2)
      clamped = static_cast<float>(value);
    return static_cast<std::int32_t>(clamped * 1e9F);
  }
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
constexpr std::uint32_t soc_quality(const estimator::Estimate<S>& e, bool observable) {
  using M = can::PackState;
  if ((e.flags & estimator::not_started) != 0) return M::soc_quality_not_started;
  if ((e.flags & (estimator::voltage_rejected | estimator::soc_contradicted)) != 0)
    return M::soc_quality_the_voltage_contradicts;
  if ((e.flags & estimator::soc_ambiguous) != 0) return M::soc_quality_more_than_one_state_of_charge_fits;
  return observable ? M::soc_quality_determined_by_the_voltage : M::soc_quality_carried_by_counting;
}

template <class Condition, class S>
constexpr can::PackState pack_state(const estimator::Estimate<S>& e, const Condition& condition) {
  can::PackState m;
  m.soc_quality = soc_quality(e, condition.quality().observable);
  if ((e.flags & estimator::not_started) != 0) return m;
  m.soc = percent(e.soc);
  m.soc_sigma = percent(e.soc_sigma);
  m.soc_display = percent(condition.display_soc());
  return m;
}

/// Converts a reading to volts. Missing and negative readings become "not known".
constexpr float volts(std::int32_t uv) { return uv >= 0 ? static_cast<float>(uv) * 1e-6F : can::unknown; }
/// Converts a reading to degrees Celsius. Impossible readings become "not known".
constexpr float degrees(std::int16_t cdegc) {
  return measurement::temperature_possible(cdegc) ? static_cast<float>(cdegc) * 0.01F : can::unknown;
}
/// Converts a reading to amperes. A missing reading becomes "not known".
constexpr float amperes(std::int32_t ua) {
  return ua != measurement::no_reading ? static_cast<float>(ua) * 1e-6F : can::unknown;
}

/// Packs of more cells have a voltage beyond the range of PackElectrical, and send PackVoltage.
inline constexpr std::size_t max_cells_of_pack_electrical = 16;

template <std::size_t Cells>
constexpr can::PackElectrical pack_electrical(const measurement::PackSample<Cells>& pack) {
  can::PackElectrical m;
  if constexpr (Cells <= max_cells_of_pack_electrical) m.voltage = volts(pack.pack_uv);
  m.current = amperes(pack.current_ua);
  m.temperature = degrees(pack.temperature_cdegc[0]);
  return m;
}

inline constexpr std::int32_t most_ua_of_pack_electrical = 655'340'000;

template <std::size_t Cells>
constexpr can::PackCurrent pack_current(const measurement::PackSample<Cells>& pack) {
  can::PackCurrent m;
  m.current =
      pack.current_ua == measurement::no_reading ? can::PackCurrent::current_layout.invalid : pack.current_ua / 1'000;
  return m;
}

template <std::size_t Cells>
constexpr can::PackVoltage pack_voltage(const measurement::PackSample<Cells>& pack) {
  can::PackVoltage m;
  m.voltage = volts(pack.pack_uv);
  return m;
}

/// Voltages of the cells From + 1 to From + 4. Cells that the pack does not have are "not known".
template <class Message, std::size_t From, std::size_t Cells>
constexpr Message cell_voltages(const measurement::PackSample<Cells>& pack) {
  Message m;
  std::size_t k = From;
  m.each([&](const char*, const char*, float& value, const can::SignalLayout&) {
    value = k < Cells ? volts(pack.cell_uv[k]) : can::unknown;
    ++k;
  });
  return m;
}

template <std::size_t Cells, class S>
constexpr can::CellExtremes cell_extremes(const measurement::PackSample<Cells>& pack,
                                          const estimator::PackCells<S, Cells>& cells) {
  can::CellExtremes m;
  constexpr std::uint32_t no_cell = 31;  // the signals' value for "not known"
  m.highest_cell = m.lowest_cell = no_cell;
  std::int32_t highest_uv = -1, lowest_uv = 2'147'483'647;
  float fullest = -1e9F, emptiest = 1e9F;
  for (std::size_t k = 0; k < Cells; ++k) {
    const float soc = number(cells[k].soc());
    if (soc > fullest) fullest = soc;
    if (soc < emptiest) emptiest = soc;
    if (pack.cell_uv[k] < 0) continue;
    if (pack.cell_uv[k] > highest_uv) {
      highest_uv = pack.cell_uv[k];
      m.highest_cell = static_cast<std::uint32_t>(k + 1);
    }
    if (pack.cell_uv[k] < lowest_uv) {
      lowest_uv = pack.cell_uv[k];
      m.lowest_cell = static_cast<std::uint32_t>(k + 1);
    }
  }
  m.highest_voltage = volts(highest_uv);
  m.lowest_voltage = m.lowest_cell == no_cell ? can::unknown : volts(lowest_uv);
  if constexpr (Cells >= no_cell) {  // the signals have no number for cells 31 and 32
    if (highest_uv >= 0) m.lowest_voltage = volts(lowest_uv);
    m.highest_cell = std::min(m.highest_cell, no_cell);
    m.lowest_cell = std::min(m.lowest_cell, no_cell);
  }
  m.soc_spread = 100.0F * (fullest - emptiest);
  return m;
}

template <std::size_t Cells>
constexpr can::Temperatures temperatures(const measurement::PackSample<Cells>& pack) {
  can::Temperatures m;
  std::size_t k = 0;
  m.each([&](const char*, const char*, float& value, const can::SignalLayout&) {
    value = degrees(pack.temperature_cdegc[k++]);
  });
  return m;
}

/// Returns true if the signals of one bit follow each other from bit 16 on.
template <class Message>
constexpr bool bits_follow_each_other() {
  unsigned next = 16;
  bool follow = true;
  Message{}.each([&](const char*, const char*, const auto&, const can::SignalLayout& s) {
    if (s.bits == 1) follow = follow && s.start == next++;
  });
  return follow;
}

/// A message whose signals of one bit are written as one word, which takes a tenth of the code.
template <class Message>
struct BitMessage {
  static_assert(bits_follow_each_other<Message>());
  std::uint64_t raw = 0;   ///< bits 16 to 63 of the frame
  std::uint8_t state = 0;  ///< bits 12 to 15

  constexpr can::Frame frame(std::uint8_t counter) const {
    can::Frame out{Message::id, 8, {}};
    can::set_bits(out, raw << 16 | std::uint64_t{state} << 12);
    can::protect(out, Message::data_id, counter);
    return out;
  }
};

constexpr BitMessage<can::Faults> faults(const protection::Decision& d) {
  static_assert(can::Faults::first_cause_layout.start == 48);
  const std::uint32_t first_cause = d.first.fault == protection::no_fault ? 0 : d.first.fault + 1U;
  return {std::uint64_t{first_cause} << 32 | static_cast<std::uint32_t>(d.faults)};
}
constexpr BitMessage<can::MoreFaults> more_faults(const protection::Decision& d) { return {d.faults >> 32}; }

/// The temperature as the signal DieTemperature: 2 degrees C a step, within its range. 0 is not known, as in the frames
/// of firmware that does not send it.
constexpr std::uint32_t die_temperature(std::int16_t cdegc) {
  constexpr std::int32_t zero_cdegc = -6'200, step_cdegc = 200, least = 1, most = 127;
  if (cdegc == measurement::no_temperature)
    return static_cast<std::uint32_t>(can::FrontEnd::die_temperature_layout.invalid);
  return static_cast<std::uint32_t>(std::clamp((cdegc - zero_cdegc + step_cdegc / 2) / step_cdegc, least, most));
}

/// trips: measurement::SecondLineTrip, in the order of the signals. Counters saturate.
constexpr BitMessage<can::FrontEnd> front_end(std::uint32_t trips, const hal::FrontEndHealth& health) {
  using M = can::FrontEnd;
  static_assert(M::state_layout.start == 12 && M::die_temperature_layout.start == 25 && M::lost_layout.start == 32 &&
                M::resets_layout.start == 40 && M::crc_errors_layout.start == 48);
  const std::uint32_t counters = std::min<std::uint32_t>(health.bad_crc, 65'535U) << 16 |
                                 std::min<std::uint32_t>(health.resets, 255U) << 8 |
                                 std::min<std::uint32_t>(health.lost, 255U);
  return {std::uint64_t{counters} << 16 | die_temperature(health.die_cdegc) << 9 | trips,
          static_cast<std::uint8_t>(health.state)};
}

constexpr can::ContactorState contactor_state(const protection::Decision& d) {
  can::ContactorState m;
  m.state = static_cast<std::uint32_t>(d.state);
  m.main_plus = d.outputs.main_plus ? 1 : 0;
  m.main_minus = d.outputs.main_minus ? 1 : 0;
  m.precharge = d.outputs.precharge ? 1 : 0;
  m.charge_enable = d.outputs.charge_enable ? 1 : 0;
  if ((d.faults & bit(protection::Fault::contactor_welded)) != 0)  // after a power cycle the pole is not known
    m.welded_pole =
        static_cast<std::uint32_t>(d.welded_pole == protection::Pole::none ? protection::Pole::unknown : d.welded_pole);
  m.auxiliary_fitted = d.auxiliary.fitted ? 1 : 0;
  m.auxiliary_plus = d.auxiliary.main_plus_closed ? 1 : 0;
  m.auxiliary_minus = d.auxiliary.main_minus_closed ? 1 : 0;
  if (d.first.fault != protection::no_fault)
    m.first_cause_time = static_cast<float>(static_cast<std::uint32_t>(d.first.time_us / 100'000)) * 0.1F;
  return m;
}

constexpr can::AllowedCurrent allowed_current(const protection::Decision& d) {
  can::AllowedCurrent m;
  m.discharge = amperes(d.allowed.discharge_ua);
  m.charge = amperes(d.allowed.charge_ua);
  return m;
}

constexpr can::Balancing balancing(const protection::Decision& d) {
  can::Balancing m;
  m.cells = d.bleed;
  m.time_left = static_cast<float>(d.bleed_left_s);
  return m;
}

template <class S>
constexpr can::ModelDetail model_detail(const estimator::Estimate<S>& e) {
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
  m.seconds_since_anchor = static_cast<float>(now.since_anchor_s);
  m.charge_since_anchor = percent(now.since_anchor_soc);
  return m;
}

inline std::uint32_t storing_state(const storage::Persistence& persistence) {
  if (!persistence.settings_stored()) return can::Storage::state_a_record_was_turned_down;
  return persistence.full() ? can::Storage::state_full : can::Storage::state_works;
}

inline can::Storage storage(const storage::Persistence& persistence) {
  using M = can::Storage;
  const auto& log = persistence.log();
  M m;
  if (log.sectors() == 0)
    m.state = M::state_no_flash;
  else
    m.state = log.operational() ? storing_state(persistence) : M::state_nothing_more_is_kept;
  m.broken_sectors = std::min<std::uint32_t>(log.broken(), 15U);
  m.newer_records = std::min<std::uint32_t>(persistence.newer_records(), 15U);
  m.erases = std::min<std::uint32_t>(log.erase_cycles(), 65'535U);
  m.starts = std::min<std::uint32_t>(persistence.events().starts, 0xFF'FFFFU);
  return m;
}

/// cell_file_changed: the stored data belong to another cell file. longest_sample_us: 0 means not known.
inline can::Board board(const hal::BoardState& state, bool cell_file_changed, std::uint32_t longest_sample_us) {
  can::Board m;
  m.ram_failed = state.ram_failed ? 1 : 0;
  m.image_failed = state.image_failed ? 1 : 0;
  m.stack_overrun = state.stack_overrun ? 1 : 0;
  m.cell_file_changed = cell_file_changed ? 1 : 0;
  m.supply_low = state.supply_low ? 1 : 0;
  m.brown_out_reset_low = state.brown_out_reset_low ? 1 : 0;
  m.clock_failed = state.clock_failed ? 1 : 0;
  m.calendar = static_cast<std::uint32_t>(state.calendar);
  const auto fault = hal::last_fault();
  m.last_exception = fault ? std::min<std::uint32_t>(fault->exception, 255U) : 0U;
  if (state.stack_free != 0xFFFF) m.stack_free = static_cast<float>(state.stack_free);
  if (longest_sample_us != 0) m.longest_sample = 0.001F * static_cast<float>(longest_sample_us);
  return m;
}

/// capacity_ah: the filter's unit of current is the capacity per hour.
template <class Result>
constexpr can::SensorErrors sensor_errors(const Result& e, float capacity_ah) {
  can::SensorErrors m;
  if constexpr (requires { e.extra; }) {
    m.voltage_error = number(e.extra[0]);
    m.current_offset = number(e.extra[1]) * capacity_ah;
    m.current_offset_sigma = number(e.extra[2]) * capacity_ah;
  }
  return m;
}

// The estimator's input, bit for bit.

constexpr can::SampleCurrent sample_current(const measurement::Sample& sample, std::uint16_t counter) {
  can::SampleCurrent m;
  m.current_ua = sample.current_ua;
  m.sample_counter = counter;
  return m;
}
constexpr can::SampleVoltage sample_voltage(const measurement::Sample& sample) {
  can::SampleVoltage m;
  m.voltage_uv = sample.voltage_uv;
  m.temperature_cdegc = sample.temperature_cdegc;
  return m;
}
constexpr can::SampleTime sample_time(const measurement::Sample& sample) {
  can::SampleTime m;
  m.time_low = static_cast<std::uint32_t>(sample.time_us);
  m.time_high = static_cast<std::uint32_t>(sample.time_us >> 32) & 0xFFFF;  // 48 bits: nine years
  return m;
}
constexpr can::StartingSoc starting_soc(const std::optional<measurement::StartingPoint>& start) {
  can::StartingSoc m;
  m.soc_ppb = start ? start->soc_ppb : 0;
  m.given = start ? can::StartingSoc::given_yes : can::StartingSoc::given_no;
  return m;
}
constexpr can::StartingSigma starting_sigma(const std::optional<measurement::StartingPoint>& start) {
  can::StartingSigma m;
  m.sigma_ppb = start ? start->soc_sigma_ppb : 0;
  return m;
}

}  // namespace bms::firmware::messages
