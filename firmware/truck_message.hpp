// The message TruckInputs: inputs and outputs of the truck, its insulation, and the state of the charger's own bus.
#pragma once

#include "can_messages.hpp"  // generated from firmware/can/greybox_bms.dbc
#include "hal/can.hpp"
#include "hal/insulation.hpp"
#include "hal/truck_inputs.hpp"

namespace bms::firmware::messages {

/// wrong_sensor: can::TruckInputs::wrong_current_sensor_*.
constexpr can::TruckInputs truck_inputs(const hal::TruckInputs& truck, const hal::Insulation& insulation,
                                        std::uint32_t outputs, std::uint32_t wrong_sensor) {
  using Output = hal::TruckOutput;
  using Input = hal::TruckInput;
  can::TruckInputs m;
  const auto on = [outputs](Output o) { return (outputs & static_cast<std::uint32_t>(o)) != 0 ? 1U : 0U; };
  const auto state = [&](Input i) {
    const std::uint32_t level = truck.is_on(i) ? can::TruckInputs::key_on : can::TruckInputs::key_off;
    return truck.has(i) ? level : can::TruckInputs::key_not_known;
  };
  m.heater = on(Output::heater);
  m.fan = on(Output::fan);
  m.soc_lamp = on(Output::soc_lamp);
  m.wrong_current_sensor = wrong_sensor;
  m.key = state(Input::key);
  m.charger_plug = state(Input::charger_plug);
  m.coil_supply = state(Input::coil_supply);
  m.interlock = state(Input::interlock);
  m.crash_sensor = state(Input::crash);
  if (insulation.ohm != measurement::no_reading) m.insulation = 0.1F * static_cast<float>(insulation.ohm / 100);
  return m;
}

/// health: of the charger's own bus.
constexpr can::TruckInputs with_charger_bus(can::TruckInputs m, const hal::CanHealth& health) {
  static_assert(static_cast<std::uint32_t>(hal::CanState::bus_off) == can::TruckInputs::charger_bus_bus_off);
  m.charger_bus = static_cast<std::uint32_t>(health.state);
  m.charger_bus_offs = health.bus_offs & 0xFF;
  return m;
}

}  // namespace bms::firmware::messages
