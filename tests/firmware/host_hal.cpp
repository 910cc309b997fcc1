#include "tests/firmware/host_hal.hpp"

#include "hal/random.hpp"
#include "hal/requests.hpp"
#include "hal/sleep.hpp"
#include "plant/link_poles.hpp"

namespace bms {

void host_hal::begin() {
  listening = true;
  sent.clear();
  requests.clear();
  queue = nullptr;
  recorded.clear();
  switched = {};
  link_readings = {0, 0};
  contacts = {};
  truck = {};
  insulation = {};
  truck_outputs = 0;
  second_line = 0;
  front_end = {};
  second_current_sensor = false;
  second_current_reading_ua = measurement::no_reading;
  parked = false;
  switched_off = 0;
  load_side_empty = true;
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
  calibration_accepts = true;
  second_line_cleared = 0;
  key.reset();
  development = true;
  random_seed = 1;
}

void host_hal::set_link(double pack_v, double dc_link_v) {
  const plant::LinkPoles poles =
      plant::link_poles(switched.main_plus || switched.precharge, switched.main_minus, pack_v, dc_link_v);
  link_readings = {static_cast<std::int32_t>(1e6 * poles.plus_v), static_cast<std::int32_t>(1e6 * poles.minus_v)};
}

namespace hal {

bool can_listening() { return host_hal::listening; }
bool can_send(const can::Frame& frame) {
  host_hal::sent.push_back(frame);
  return true;
}
bool next_request(can::Frame& frame) {
  if (host_hal::queue != nullptr) return host_hal::queue->pop(frame);
  if (host_hal::requests.empty()) return false;
  frame = host_hal::requests.front();
  host_hal::requests.pop_front();
  return true;
}
bool next_network_frame(can::Frame&) { return false; }
std::optional<std::array<std::uint8_t, 16>> device_key() { return host_hal::key; }
bool development_image() { return host_hal::development; }
std::uint32_t random_word() {
  host_hal::random_seed = host_hal::random_seed * 1'664'525 + (host_hal::random_seed != 0 ? 1'013'904'223 : 0);
  return host_hal::random_seed;
}
void record_estimate(std::span<const std::uint32_t> words) {
  host_hal::recorded.emplace_back(words.begin(), words.end());
}
void power_path_set(const PowerPath& wanted) { host_hal::switched = wanted; }
LinkVoltages link_voltages() { return host_hal::link_readings; }
AuxiliaryContacts auxiliary_contacts() { return host_hal::contacts; }
void acknowledge_contact_losses(std::uint32_t losses) { host_hal::contacts.losses -= losses; }
std::uint32_t second_line_trips() { return host_hal::second_line; }
FrontEndHealth front_end_health() { return host_hal::front_end; }
bool second_current_fitted() { return host_hal::second_current_sensor; }
TruckInputs truck_inputs() { return host_hal::truck; }
void acknowledge_coil_losses(std::uint32_t losses) { host_hal::truck.coil_losses -= losses; }
void truck_outputs_set(std::uint32_t outputs) { host_hal::truck_outputs = outputs; }
Insulation insulation() { return host_hal::insulation; }
std::int32_t second_current_ua() { return host_hal::second_current_reading_ua; }
void set_parked(bool parked) { host_hal::parked = parked; }
bool load_side_discharged() { return host_hal::load_side_empty; }
bool bus_stirs() { return false; }
void switch_off() { ++host_hal::switched_off; }
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
bool calibrate(const SensorCalibration& c) {
  if (host_hal::calibration_accepts) host_hal::calibrated = c;
  return host_hal::calibration_accepts;
}
void second_line_clear() { ++host_hal::second_line_cleared; }

}  // namespace hal
}  // namespace bms
