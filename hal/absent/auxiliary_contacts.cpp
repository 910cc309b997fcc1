// No auxiliary contacts.
#include "hal/contactor_pins.hpp"

namespace bms::hal {

AuxiliaryContacts auxiliary_contacts() { return {}; }
void acknowledge_contact_losses(std::uint32_t) {}
std::uint32_t contact_losses() { return 0; }

}  // namespace bms::hal
