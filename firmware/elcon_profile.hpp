// A charger of the protocol of Elcon and TC chargers, which many others have as well. Build option:
// BMS_VEHICLE_PROFILE=elcon.
//
//   0x1806E5F4  out  every half second: u16 highest voltage [0.1 V], u16 highest current [0.1 A], u8 control (0 charge,
//                    1 do not), three bytes 0. Numbers are big-endian
//   0x18FF50E5  in   every second: u16 output voltage [0.1 V], u16 output current [0.1 A], u8 status: bit 0 hardware
//                    failed, 1 too hot, 2 no or wrong input voltage, 3 no battery seen, 4 no message of the battery
//
// Two status frames in a row without a failure ask for a charge; the contactors close, and the control byte becomes 0
// with the charge enable. The charger stops by itself five seconds after the last message. The charge ends as
// charge_control.hpp says. The frames have no check code, so nothing that protects depends on them. Sources:
// firmware/can/messages.md. Cost: 0.2 % of a bus of 250 kbit/s.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "firmware/charge_control.hpp"
#include "firmware/cycle.hpp"
#include "firmware/power_requests.hpp"
#include "firmware/snapshot.hpp"
#include "hal/charger_bus.hpp"

namespace bms::firmware {

class ElconProfile {
 public:
  static constexpr std::uint32_t command_id = 0x1806'E5F4, status_id = 0x18FF'50E5, cycle_us = 500'000;
  static constexpr std::uint64_t timeout_us = 3'500'000;  ///< two of three status frames may be lost

  template <class Estimator, std::size_t Cells>
  void publish(const Snapshot<Estimator, Cells>& now) {
    control_.update(now, {.present = present(now.pack.time_us), .output_uv = output_uv_});
    if (control_.speaks() && hal::charger_listening() &&
        cycle_.due(static_cast<std::uint32_t>(now.pack.time_us), cycle_us))
      send();
  }

  void receive(const can::Frame& frame, std::uint64_t now_us) {
    if (!frame.long_id || frame.id != status_id || frame.length != 8) return;
    constexpr std::uint8_t failures = 0x07;
    repeated_ = present(now_us);
    healthy_ = (frame.data[4] & failures) == 0;
    // behind its diode or relay a charger that delivers nothing measures its own output
    const bool delivers = (frame.data[2] | frame.data[3]) != 0;
    output_uv_ = delivers ? (frame.data[0] << 8 | frame.data[1]) * 100'000 : measurement::no_reading;
    received_ = true;
    received_us_ = now_us;
  }

  ChargerState charger(std::uint64_t now_us) const {
    const bool here = present(now_us);
    return {here, here && repeated_ && healthy_ && control_.wanted()};
  }
  const ChargeControl& control() const { return control_; }
  ChargeControl& control() { return control_; }

 private:
  bool present(std::uint64_t now_us) const { return received_ && now_us - received_us_ < timeout_us; }

  void send() const {
    const auto tenths = [](std::int32_t micro) { return static_cast<std::uint32_t>(micro / 100'000); };
    const std::uint32_t volts = tenths(control_.target_uv()), amperes = tenths(control_.current_ua());
    const auto byte = [](std::uint32_t value) { return static_cast<std::uint8_t>(value & 0xFF); };
    const std::uint8_t control = amperes > 0 ? 0 : 1;
    hal::send_to_charger(
        {command_id, 8, {byte(volts >> 8), byte(volts), byte(amperes >> 8), byte(amperes), control, 0, 0, 0}, true});
  }

  ChargeControl control_;
  Cycle cycle_;
  std::uint64_t received_us_ = 0;
  std::int32_t output_uv_ = measurement::no_reading;
  bool received_ = false, repeated_ = false, healthy_ = false;
};

}  // namespace bms::firmware
