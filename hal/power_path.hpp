// Contactors and balancing resistors, the voltages of the DC link, and the auxiliary contacts of the main contactors.
// Back ends of the first two: remote/ and emulated/samples_can (the load is on the bus and sends CAN frames), absent/
// (nothing to switch), adc/samples (hal/contactor_pins.hpp; no DC link), bq76952/samples with adc/dc_link (outputs and
// converter of the chip). Auxiliary contacts: stm32f4/auxiliary_contacts, absent/auxiliary_contacts.
#pragma once

#include <cstdint>

#include "measurement/sample.hpp"

namespace bms::hal {

struct PowerPath {
  bool main_plus = false, main_minus = false, precharge = false, charge_enable = false;
  std::uint32_t bleed = 0;  ///< one bit per cell: its balancing resistor is on
};

/// Call with every sample. Before the first call and after a reset, all contactors are open.
void power_path_set(const PowerPath& wanted);

/// Load side of main plus and of main minus against the negative end of the cells [uV]; no_reading: not measured.
struct LinkVoltages {
  std::int32_t plus_uv = measurement::no_reading, minus_uv = measurement::no_reading;
};

/// Call once per sample. Takes 0.2 ms where the chip's own converter measures.
LinkVoltages link_voltages();

struct AuxiliaryContacts {
  bool fitted = false, main_plus_closed = false, main_minus_closed = false;
  /// Times that a main contact opened while its output was on, and that have not been acknowledged. The interrupt of
  /// the contact has then opened all outputs, and they stay open until they are acknowledged.
  std::uint32_t losses = 0;
};

/// Call once per sample, before power_path_set().
AuxiliaryContacts auxiliary_contacts();

/// Allows outputs to close again. Call with AuxiliaryContacts::losses, after all outputs were opened.
void acknowledge_contact_losses(std::uint32_t losses);

}  // namespace bms::hal
