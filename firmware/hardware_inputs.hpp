// What the protections read from the hardware besides the sample: contacts, DC link, second line, second current
// sensor, the inputs of the truck, supply.
#pragma once

#include "firmware/power_requests.hpp"
#include "firmware/snapshot.hpp"
#include "hal/power_path.hpp"
#include "hal/second_current.hpp"
#include "hal/second_line.hpp"
#include "hal/supply.hpp"
#include "hal/truck_inputs.hpp"
#include "parameters/parameter.hpp"
#include "protection/protection.hpp"

namespace bms::firmware {

/// Events that keep the outputs open until they are acknowledged.
struct Losses {
  std::uint32_t contacts = 0, coils = 0, supply = 0;

  void acknowledge() const {
    hal::supply_acknowledge(supply);
    hal::acknowledge_contact_losses(contacts);
    hal::acknowledge_coil_losses(coils);
  }
};

/// The charger of the profile, or one that is seen by its plug.
constexpr ChargerState with_plug(ChargerState charger, const hal::TruckInputs& truck) {
  const bool plugged = truck.is_on(hal::TruckInput::charger_plug);
  return {charger.present || plugged, charger.asks || (plugged && hal::closes_by_inputs)};
}

/// Call once per sample. fitted: bits of parameters::Parameter::inputs_fitted. Sets board.truck.
inline Losses read_hardware(std::int32_t fitted, BoardStatus& board, protection::ExternalInputs& inputs) {
  const auto has = [fitted](std::int32_t input) { return (fitted & input) != 0; };
  const hal::LinkVoltages link = hal::link_voltages();
  inputs.link_plus_uv = link.plus_uv;
  inputs.link_minus_uv = link.minus_uv;
  const hal::AuxiliaryContacts contacts = hal::auxiliary_contacts();
  if (has(parameters::auxiliary_contacts_fitted)) {
    inputs.auxiliary = {contacts.fitted, contacts.main_plus_closed, contacts.main_minus_closed};
    inputs.contact_lost = contacts.losses != 0;
  }
  inputs.second_line = hal::second_line_trips();
  inputs.front_end_cdegc = hal::front_end_health().die_cdegc;
  if (has(parameters::second_current_fitted)) {
    inputs.second_current_fitted = hal::second_current_fitted();
    inputs.second_current_ua = hal::second_current_ua();
  }
  hal::TruckInputs truck = hal::truck_inputs();
  truck.fitted &= static_cast<std::uint32_t>(fitted / parameters::first_truck_input);
  using enum hal::TruckInput;
  // A supply that is back already has opened the contactors, too: the bus says so.
  if (truck.coil_losses != 0) truck.on &= ~static_cast<std::uint32_t>(coil_supply);
  board.truck = truck;
  inputs.coils_dead = truck.is_off(coil_supply);
  inputs.interlock_open = truck.is_off(interlock);
  inputs.crashed = truck.is_off(crash);
  const Losses losses{contacts.losses, truck.coil_losses, hal::supply_falls()};
  inputs.supply_dip = board.state.supply_low || losses.supply != 0;
  return losses;
}

}  // namespace bms::firmware
