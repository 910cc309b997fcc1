#include "tests/firmware/host_hal.hpp"

namespace bms {

void host_hal::begin() {
  listening = true;
  sent.clear();
  requests.clear();
  recorded.clear();
  switched = {};
  dc_link_reading_uv = 0;
  cause = hal::ResetCause::power_on;
  fault.reset();
  fed = 0;
  board_state = {};
  supply_falls = supply_acknowledged = 0;
  calendar.reset();
  backup = {};
  backup_supplied = true;
  can_health = {};
  calendar_was_set_to = 0;
  calendar_accepts = true;
  calibrated = {};
}

namespace hal {

bool can_listening() { return host_hal::listening; }
bool can_send(const can::Frame& frame) {
  host_hal::sent.push_back(frame);
  return true;
}
bool next_request(can::Frame& frame) {
  if (host_hal::requests.empty()) return false;
  frame = host_hal::requests.front();
  host_hal::requests.pop_front();
  return true;
}
void record_estimate(std::span<const std::uint32_t> words) {
  host_hal::recorded.emplace_back(words.begin(), words.end());
}
void power_path_set(const PowerPath& wanted) { host_hal::switched = wanted; }
std::int32_t dc_link_uv() { return host_hal::dc_link_reading_uv; }
ResetCause reset_cause() { return host_hal::cause; }
std::optional<FaultRecord> last_fault() { return host_hal::fault; }
std::optional<std::uint32_t> calendar_s() { return host_hal::calendar; }
std::uint32_t backup_word(std::size_t k) { return host_hal::backup[k]; }
void set_backup_word(std::size_t k, std::uint32_t value) {
  if (host_hal::backup_supplied) host_hal::backup[k] = value;
}
CanHealth can_health() { return host_hal::can_health; }
void watchdog_feed() { ++host_hal::fed; }
std::uint32_t supply_falls() { return host_hal::supply_falls; }
void supply_acknowledge(std::uint32_t falls) {
  host_hal::supply_falls -= falls;
  host_hal::supply_acknowledged += falls;
}
BoardState board_state() { return host_hal::board_state; }
std::uint64_t now_us() { return 0; }
bool calendar_set(std::uint32_t unix_s) {
  host_hal::calendar_was_set_to = unix_s;
  return host_hal::calendar_accepts;
}
void calibrate(const SensorCalibration& c) { host_hal::calibrated = c; }

}  // namespace hal
}  // namespace bms
