#include "hal/bq76952/front_end.hpp"

#include <algorithm>
#include <cstring>
#include <limits>

#include "hal/bytes.hpp"
#include "hal/clock.hpp"
#include "hal/second_line.hpp"

namespace bms::hal::bq76952 {

namespace {

constexpr std::uint32_t first_rest_us = 100'000, longest_rest_us = 1'600'000;
constexpr std::size_t settings_per_sample = 11;
constexpr std::uint8_t max_wait_samples = 5;   // until a mode is entered or left
constexpr std::uint8_t max_failures = 2;       // samples in a row
constexpr std::uint8_t max_scan_age = 2;       // samples without a complete scan
constexpr std::uint8_t max_charge_still = 15;  // samples: 1.5 s of a counter of seconds
constexpr std::uint64_t refresh_interval_us = 5'000'000;
constexpr int max_move = 127;  // of a word between two samples; a torn word is off by 256

/// Waits until the chip has processed what was written.
void settle() {
  const std::uint64_t since = now_us();
  while (now_us() - since < 2'000) wait_for_interrupt();
}

std::int32_t cell_uv(std::int16_t mv) {
  return mv == std::numeric_limits<std::int16_t>::min() ? measurement::no_reading : mv * 1'000;
}

/// Of any reading, possible or not.
std::int16_t cdegc_of(std::int16_t tenth_k) {
  const int value = tenth_k * 10 - 27'315;
  return static_cast<std::int16_t>(
      std::clamp<int>(value, std::numeric_limits<std::int16_t>::min(), std::numeric_limits<std::int16_t>::max()));
}

std::int16_t cdegc(std::int16_t tenth_k) {
  const std::int16_t narrow = cdegc_of(tenth_k);
  if (measurement::temperature_possible(narrow)) return narrow;
  return narrow > 0 ? measurement::shorted_thermistor : measurement::no_temperature;
}

}  // namespace

void FrontEnd::read(measurement::PackSample<cell_inputs>& into) {
  const std::uint64_t time_us = into.time_us;
  into = {};
  into.time_us = time_us;
  dc_link_uv_ = measurement::no_reading;
  die_cdegc_ = measurement::no_temperature;
  trips_ = 0;
  interrupted_ = interrupted_ || silent();
  const bool measuring = state_ == State::measure;
  bool complete = false;
  if (measuring) {
    complete = measure(into);
    if (complete)
      failures_ = 0;
    else if (state_ == State::measure && ++failures_ >= max_failures)
      reset_measurement();
    if (into.current_ua == measurement::no_reading) mean_current_.reset();
  } else if (state_ != State::absent || now_us() >= next_try_us_) {
    complete = advance();
    if (!complete) rest();
  }
  if (complete) answered_us_ = now_us();
  if (interrupted_) trips_ |= host_silence;
  if (measuring && complete) interrupted_ = false;
  if (trips_ != 0) ++counters_.trips;
}

/// A chip that is held on keeps its outputs off until it is reset. Its settings are those of before, so only POR shows
/// that it was.
FrontEnd::AfterShutdown FrontEnd::after_shut_down() {
  std::uint16_t status = 0;
  if (!wire_.detect(status)) return AfterShutdown::off;
  if ((status & was_reset) != 0) return AfterShutdown::restarted;
  static_cast<void>(wire_.select(reset));
  return AfterShutdown::held_on;
}

/// One step towards measuring. Returns false if the chip is missing or not as expected.
bool FrontEnd::advance() {
  switch (state_) {
    case State::absent:
      return detect();
    case State::compare:
      return compare();
    case State::enter:
      return enter();
    case State::write:
      return write();
    default:
      return leave();
  }
}

/// Tries again later, after twice the last rest.
void FrontEnd::rest() {
  state_ = State::absent;
  rest_us_ = rest_us_ == 0 ? first_rest_us : std::min(2 * rest_us_, longest_rest_us);
  next_try_us_ = now_us() + rest_us_;
}

void FrontEnd::reset_measurement() {
  ++counters_.lost;
  state_ = State::absent;
  rest_us_ = 0;
  next_try_us_ = 0;
  failures_ = 0;
  clear_latch_ = false;
}

bool FrontEnd::detect() {
  std::uint16_t status = 0;
  if (!wire_.detect(status)) return false;
  std::array<std::uint8_t, 2> number{};
  if (!wire_.select(get_device_number)) return false;
  settle();
  if (!wire_.fetch(get_device_number, number)) return false;
  if (get_bytes<std::uint16_t>(number, 0) != device_number) {
    ++counters_.wrong_device;
    return false;
  }
  if ((status & security) == sealed) {
    ++counters_.sealed;
    return false;
  }
  std::uint16_t control = 0;
  if (!wire_.read_word(control_status, control)) return false;
  if ((control & in_deep_sleep) != 0) {
    static_cast<void>(wire_.select(exit_deep_sleep));
    return false;
  }
  ++counters_.found;
  state_ = State::compare;
  return wire_.select(sleep_disable);
}

/// Compares the data memory, block by block, with the settings. Returns false if it could not be read.
bool FrontEnd::compare_memory(bool& matches) {
  matches = true;
  const std::span<const Setting> settings = configuration_->settings;
  for (std::size_t k = 0; k < settings.size();) {
    const std::uint16_t begin = settings[k].address;
    std::array<std::uint8_t, buffer_bytes> block{};
    if (!wire_.select(begin)) return false;
    settle();
    if (!wire_.fetch(begin, block)) return false;
    for (; k < settings.size() && settings[k].address + settings[k].bytes <= begin + buffer_bytes; ++k) {
      if (get_bytes<std::uint32_t>(block, static_cast<std::size_t>(settings[k].address - begin), settings[k].bytes) !=
          settings[k].value)
        matches = false;
    }
  }
  return true;
}

bool FrontEnd::compare() {
  std::uint16_t status = 0;
  bool matches = false;
  // Balancing of a former run ends here: it is not certain that the chip ends it by itself.
  constexpr std::array<std::uint8_t, 2> none{};
  if (!wire_.detect(status) || !wire_.send(balance_cells, none) || !compare_memory(matches)) return false;
  waited_ = 0;
  swapped_ = false;
  next_setting_ = 0;
  if (matches && (status & (was_reset | in_config_update)) == 0) {
    state_ = State::leave;
    return true;
  }
  state_ = State::enter;
  interrupted_ = ran_;  // its pins are low until it is configured
  return wire_.select(set_config_update);
}

bool FrontEnd::enter() {
  std::uint16_t status = 0;
  if (!wire_.detect(status)) return false;
  if ((status & in_config_update) == 0) return ++waited_ < max_wait_samples;
  state_ = State::write;
  return write();
}

bool FrontEnd::write() {
  const std::span<const Setting> settings = configuration_->settings;
  for (std::size_t k = 0; k < settings_per_sample && next_setting_ < settings.size(); ++k, ++next_setting_) {
    const Setting& s = settings[next_setting_];
    std::array<std::uint8_t, 4> bytes{};
    put_bytes(bytes, 0, s.value);
    if (!wire_.send(s.address, std::span(bytes).first(s.bytes))) return false;
    settle();
  }
  if (next_setting_ < settings.size()) return true;
  bool matches = false;
  if (!compare_memory(matches)) return false;
  if (!matches) {
    ++counters_.wrong_setting;
    return false;
  }
  ++counters_.configured;
  waited_ = 0;
  state_ = State::leave;
  return wire_.select(exit_config_update);
}

bool FrontEnd::leave() {
  std::uint16_t status = 0;
  if (!wire_.detect(status)) return false;
  if ((status & in_config_update) != 0) return ++waited_ < max_wait_samples;
  if (wire_.check == Check::plain) {
    if (swapped_) return false;
    swapped_ = true;
    return wire_.select(swap_comm_mode);
  }
  // After Alarm Raw Status comes Alarm Enable, whose content is known.
  std::array<std::uint8_t, 4> raw_and_enable{};
  wire_.by_words = false;
  if (!wire_.read(alarm_raw_status, raw_and_enable)) return false;
  wire_.by_words = get_bytes<std::uint16_t>(raw_and_enable, 2) != default_alarm_mask;
  state_ = State::measure;
  failures_ = 0;
  rest_us_ = 0;
  scan_age_ = max_scan_age;
  charge_still_ = 0;
  sent_bleed_ = static_cast<std::uint16_t>(~bleed_);  // unknown, so send it
  return true;
}

/// Returns true if the chip was not reset and is not in CONFIG_UPDATE mode.
bool FrontEnd::no_reset() {
  std::uint16_t status = 0;
  if (!wire_.read_word(battery_status, status)) return false;
  failed_permanently_ = (status & failed_permanently) != 0;
  if ((status & (was_reset | in_config_update)) == 0) return true;
  ++counters_.resets;
  interrupted_ = ran_;
  reset_measurement();
  return false;
}

/// Reads in the order of importance; ends at the first failed transfer.
bool FrontEnd::measure(measurement::PackSample<cell_inputs>& into) {
  if (!no_reset()) return false;
  if (!wire_.select(get_currents)) return false;
  if (!read_scan(into)) return false;
  if (!read_current(into)) return false;
  if (!read_second_line()) return false;
  if (clear_latch_ && !wire_.select(recover_short_circuit_latch)) return false;
  clear_latch_ = false;
  return refresh_balancing();
}

/// Reads words at `command`. The high byte of a word can be newer than its low byte (E2E 1328137). So if one from byte
/// `from` on differs much from `last`, all are read again; the chip has not updated the same word twice meanwhile.
bool FrontEnd::read_words(std::uint8_t command, std::span<std::uint8_t> into, std::span<std::uint8_t> last,
                          std::size_t from) {
  if (!wire_.read(command, into)) return false;
  for (std::size_t k = from; k < into.size(); k += 2) {
    const int move = get_bytes<std::int16_t>(into, k) - get_bytes<std::int16_t>(last, k);
    if (move <= max_move && move >= -max_move) continue;
    if (!wire_.read(command, into)) return false;
    break;
  }
  std::memcpy(last.data(), into.data(), into.size());
  return true;
}

bool FrontEnd::read_scan(measurement::PackSample<cell_inputs>& into) {
  // The alarm bits come first, so the values read after them are at least as fresh as they state.
  std::array<std::uint8_t, hdq_temperature + 2 - alarm_status> alarm_and_temperatures;
  if (!read_words(alarm_status, alarm_and_temperatures, temperatures_, die_temperature - alarm_status)) return false;
  // Trips stay until read_second_line() has seen them, also if a transfer before it fails.
  alarm_ = static_cast<std::uint16_t>((alarm_ & (tripped_a | tripped_bc)) |
                                      get_bytes<std::uint16_t>(alarm_and_temperatures, 0));
  std::array<std::uint8_t, 2> seen{};
  put_bytes(seen, 0, static_cast<std::uint16_t>(alarm_ & (cells_scanned | all_scanned | tripped_a | tripped_bc)));
  if (!wire_.write(alarm_status, seen)) return false;
  std::array<std::uint8_t, ld_voltage + 2 - first_cell> voltages;
  if (!read_words(first_cell, voltages, voltages_, 0)) return false;

  scan_age_ = (alarm_ & all_scanned) != 0 ? std::uint8_t{0}
                                          : static_cast<std::uint8_t>(std::min(scan_age_ + 1, int{max_scan_age}));
  fresh_ = (alarm_ & cells_scanned) != 0;
  if (!fresh_) {
    ++counters_.not_fresh;
    return true;
  }
  for (std::size_t n = 0; n < configuration_->cells; ++n) {
    const std::size_t k = configuration_->input_of_cell[n];
    into.cell_uv[k] = cell_uv(get_bytes<std::int16_t>(voltages, 2 * k));
  }
  if (scan_age_ >= max_scan_age) return true;
  into.pack_uv = get_bytes<std::int16_t>(voltages, stack_voltage - first_cell) * voltage_step_uv;
  dc_link_uv_ = get_bytes<std::int16_t>(voltages, ld_voltage - first_cell) * voltage_step_uv;
  const std::int16_t die = cdegc_of(get_bytes<std::int16_t>(alarm_and_temperatures, die_temperature - alarm_status));
  if (measurement::temperature_possible(die)) die_cdegc_ = die;
  constexpr std::array<std::uint8_t, measurement::max_temperatures> sensors{ts1_temperature, ts3_temperature,
                                                                            hdq_temperature, cfetoff_temperature};
  for (std::size_t k = 0; k < sensors.size(); ++k)
    into.temperature_cdegc[k] =
        cdegc(get_bytes<std::int16_t>(alarm_and_temperatures, static_cast<std::size_t>(sensors[k] - alarm_status)));
  return true;
}

/// Current of CC3 in its two forms, limited to the range; no_reading if they contradict each other. `steps` is not
/// defined outside of 16 bits.
std::int32_t FrontEnd::current_ua(std::int32_t counts, std::int16_t steps) {
  const std::int32_t end = configuration_->current_end_ua;
  const std::int64_t ua = std::int64_t{counts} * configuration_->current_na_per_count / 1'000;
  if (ua >= end) return end;
  if (ua <= -end) return -end;
  const auto current = static_cast<std::int32_t>(ua);
  const std::int32_t off = current / configuration_->current_step_ua - steps,
                     most = 2 + (steps < 0 ? -steps : steps) / 256;
  if (off >= -most && off <= most) return current;
  ++counters_.current_differs;
  return measurement::no_reading;
}

bool FrontEnd::read_current(measurement::PackSample<cell_inputs>& into) {
  std::array<std::uint8_t, cc3_counts_at + 4> currents;
  std::array<std::uint8_t, charge_time_at + 4> charge;
  if (!wire_.fetch(get_currents, currents) || !wire_.select(get_charge) || !wire_.fetch(get_charge, charge))
    return false;
  const auto time_s = get_bytes<std::uint32_t>(charge, charge_time_at);
  if (time_s != charge_time_s_)
    charge_still_ = 0;
  else if (fresh_ && charge_still_ < max_charge_still)
    ++charge_still_;
  charge_time_s_ = time_s;
  if (!fresh_ || charge_still_ >= max_charge_still) return true;
  const std::int32_t cc3 =
      current_ua(get_bytes<std::int32_t>(currents, cc3_counts_at), get_bytes<std::int16_t>(currents, cc3_current_at));
  const std::int32_t end = configuration_->current_end_ua;
  into.current_ua = cc3;
  if (cc3 == measurement::no_reading) return true;
  if (cc3 >= end || cc3 <= -end) {
    mean_current_.reset();
    return true;
  }
  const auto counted =
      static_cast<std::int64_t>(static_cast<std::uint64_t>(get_bytes<std::uint32_t>(charge, charge_at)) << 32 |
                                get_bytes<std::uint32_t>(charge, charge_fraction_at));
  const std::int64_t counted_uas = MeanCurrent::charge_uas(counted, configuration_->current_step_ua);
  into.current_ua = std::clamp(mean_current_.update(cc3, counted_uas, into.time_us, end), -end, end);
  return true;
}

bool FrontEnd::refresh_balancing() {
  if (bleed_ == sent_bleed_ && (bleed_ == 0 || now_us() - sent_bleed_us_ < refresh_interval_us)) return true;
  std::array<std::uint8_t, 2> cells{};
  put_bytes(cells, 0, bleed_);
  if (!wire_.send(balance_cells, cells)) return false;
  settle();
  if (!wire_.select(balance_cells)) return false;
  settle();
  std::array<std::uint8_t, 2> bled{};
  if (!wire_.fetch(balance_cells, bled)) return false;
  if (bled != cells) {
    ++counters_.bleed_wrong;
    return true;  // sent again with the next sample
  }
  sent_bleed_ = bleed_;
  sent_bleed_us_ = now_us();
  return true;
}

}  // namespace bms::hal::bq76952
