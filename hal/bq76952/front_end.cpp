#include "hal/bq76952/front_end.hpp"

#include <algorithm>
#include <limits>

#include "hal/bq76952/registers.hpp"
#include "hal/bytes.hpp"
#include "hal/clock.hpp"

namespace bms::hal::bq76952 {

namespace {

constexpr std::uint32_t first_rest_us = 100'000, longest_rest_us = 1'600'000;
constexpr std::size_t settings_per_sample = 8;
constexpr std::uint8_t max_wait_samples = 5;   // until a mode is entered or left
constexpr std::uint8_t max_failures = 2;       // samples in a row
constexpr std::uint8_t max_scan_age = 2;       // samples without a complete scan
constexpr std::uint8_t max_charge_still = 15;  // samples: 1.5 s of a counter of seconds
constexpr std::uint64_t refresh_interval_us = 5'000'000;

/// Waits until the chip has processed what was written.
void settle() {
  const std::uint64_t since = now_us();
  while (now_us() - since < 2'000) wait_for_interrupt();
}

std::int32_t cell_uv(std::int16_t mv) {
  return mv == std::numeric_limits<std::int16_t>::min() ? measurement::no_reading : mv * 1'000;
}

std::int16_t cdegc(std::int16_t tenth_k) {
  const int value = tenth_k * 10 - 27'315;
  const auto narrow = static_cast<std::int16_t>(
      std::clamp<int>(value, std::numeric_limits<std::int16_t>::min(), std::numeric_limits<std::int16_t>::max()));
  return measurement::temperature_possible(narrow) ? narrow : measurement::no_temperature;  // open or shorted sensor
}

}  // namespace

void FrontEnd::read(measurement::PackSample<cell_inputs>& into) {
  const std::uint64_t time_us = into.time_us;
  into = {};
  into.time_us = time_us;
  dc_link_uv_ = measurement::no_reading;
  if (state_ == State::measure) {
    if (measure(into))
      failures_ = 0;
    else if (state_ == State::measure && ++failures_ >= max_failures)
      reset_measurement();
    if (into.current_ua == measurement::no_reading) mean_current_.reset();
    return;
  }
  if (state_ == State::absent && now_us() < next_try_us_) return;
  if (!advance()) rest();
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
  for (std::size_t k = 0; k < settings_.size();) {
    const std::uint16_t begin = settings_[k].address;
    std::array<std::uint8_t, buffer_bytes> block{};
    if (!wire_.select(begin)) return false;
    settle();
    if (!wire_.fetch(begin, block)) return false;
    for (; k < settings_.size() && settings_[k].address + settings_[k].bytes <= begin + buffer_bytes; ++k) {
      if (get_bytes<std::uint32_t>(block, static_cast<std::size_t>(settings_[k].address - begin), settings_[k].bytes) !=
          settings_[k].value)
        matches = false;
    }
  }
  return true;
}

bool FrontEnd::compare() {
  std::uint16_t status = 0;
  bool matches = false;
  if (!wire_.detect(status) || !compare_memory(matches)) return false;
  waited_ = 0;
  swapped_ = false;
  next_setting_ = 0;
  if (matches && (status & (was_reset | in_config_update)) == 0) {
    state_ = State::leave;
    return true;
  }
  state_ = State::enter;
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
  for (std::size_t k = 0; k < settings_per_sample && next_setting_ < settings_.size(); ++k, ++next_setting_) {
    const Setting& s = settings_[next_setting_];
    std::array<std::uint8_t, 4> bytes{};
    put_bytes(bytes, 0, s.value);
    if (!wire_.send(s.address, std::span(bytes).first(s.bytes))) return false;
    settle();
  }
  if (next_setting_ < settings_.size()) return true;
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
  if ((status & (was_reset | in_config_update)) == 0) return true;
  ++counters_.resets;
  reset_measurement();
  return false;
}

/// Reads in the order of importance; ends at the first failed transfer.
bool FrontEnd::measure(measurement::PackSample<cell_inputs>& into) {
  if (!no_reset()) return false;
  if (!wire_.select(get_currents)) return false;
  if (!read_scan(into)) return false;
  if (!read_current(into)) return false;
  std::array<std::uint8_t, 5> safety{};  // status A, alert B, status B, alert C, status C
  if (!wire_.read(safety_status_a, safety)) return false;
  if ((safety[0] | safety[2] | safety[4]) != 0) ++counters_.trips;
  return refresh_balancing();
}

bool FrontEnd::read_scan(measurement::PackSample<cell_inputs>& into) {
  // The alarm bits come first, so the values read after them are at least as fresh as they state.
  std::array<std::uint8_t, hdq_temperature + 2 - alarm_status> alarm_and_temperatures;
  if (!wire_.read(alarm_status, alarm_and_temperatures)) return false;
  const auto alarm = get_bytes<std::uint16_t>(alarm_and_temperatures, 0);
  std::array<std::uint8_t, 2> seen{};
  put_bytes(seen, 0, static_cast<std::uint16_t>(alarm & (cells_scanned | all_scanned)));
  if (!wire_.write(alarm_status, seen)) return false;
  std::array<std::uint8_t, ld_voltage + 2 - first_cell> voltages;
  if (!wire_.read(first_cell, voltages)) return false;

  scan_age_ = (alarm & all_scanned) != 0 ? std::uint8_t{0}
                                         : static_cast<std::uint8_t>(std::min(scan_age_ + 1, int{max_scan_age}));
  fresh_ = (alarm & cells_scanned) != 0;
  if (!fresh_) {
    ++counters_.not_fresh;
    return true;
  }
  for (std::size_t k = 0; k < cell_inputs; ++k) into.cell_uv[k] = cell_uv(get_bytes<std::int16_t>(voltages, 2 * k));
  if (scan_age_ >= max_scan_age) return true;
  into.pack_uv = get_bytes<std::int16_t>(voltages, stack_voltage - first_cell) * voltage_step_uv;
  dc_link_uv_ = get_bytes<std::int16_t>(voltages, ld_voltage - first_cell) * voltage_step_uv;
  constexpr std::array<std::uint8_t, measurement::max_temperatures> sensors{ts1_temperature, ts3_temperature,
                                                                            hdq_temperature, cfetoff_temperature};
  for (std::size_t k = 0; k < sensors.size(); ++k)
    into.temperature_cdegc[k] =
        cdegc(get_bytes<std::int16_t>(alarm_and_temperatures, static_cast<std::size_t>(sensors[k] - alarm_status)));
  return true;
}

bool FrontEnd::read_current(measurement::PackSample<cell_inputs>& into) {
  std::array<std::uint8_t, cc3_current_at + 2> currents;
  std::array<std::uint8_t, charge_time_at + 4> charge;
  if (!wire_.fetch(get_currents, currents) || !wire_.select(get_charge) || !wire_.fetch(get_charge, charge))
    return false;
  const auto time_s = get_bytes<std::uint32_t>(charge, charge_time_at);
  if (time_s != charge_time_s_)
    charge_still_ = 0;
  else if (fresh_ && charge_still_ < max_charge_still)
    ++charge_still_;
  charge_time_s_ = time_s;
  const auto steps = get_bytes<std::int16_t>(currents, cc3_current_at);
  constexpr auto limits = std::numeric_limits<std::int16_t>{};
  if (!fresh_ || charge_still_ >= max_charge_still || steps == limits.min() || steps == limits.max())
    return true;  // no conversion, or outside its range
  const auto counted =
      static_cast<std::int64_t>(static_cast<std::uint64_t>(get_bytes<std::uint32_t>(charge, charge_at)) << 32 |
                                get_bytes<std::uint32_t>(charge, charge_fraction_at));
  into.current_ua = mean_current_.update(steps * current_step_ua, counted, into.time_us);
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
