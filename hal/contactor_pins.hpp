// Outputs that close the contactors. Back ends: stm32f4/ (PC6 to PC9).
#pragma once

#include <cstdint>

#include "hal/power_path.hpp"

namespace bms::hal {

/// Before the first call, in reset and after it, pull-downs at the drivers keep all contactors open. Outputs stay off
/// while the supply is low, after a fall of it, after the loss of a contact and of the coil supply until each is
/// acknowledged.
void contactor_pins_set(const PowerPath& wanted);

/// Returns true if the last call closes a contactor.
bool contactor_pins_on();

/// AuxiliaryContacts::losses, without reading the contacts. Back ends: those of auxiliary_contacts().
std::uint32_t contact_losses();

/// TruckInputs::coil_losses, without reading the inputs. Back ends: those of truck_inputs().
std::uint32_t coil_losses();

}  // namespace bms::hal
