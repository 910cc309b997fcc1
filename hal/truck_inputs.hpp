// Inputs and outputs of a truck, besides contactors and their contacts. Which of them are fitted: BMS_INPUTS and
// BMS_OUTPUTS of board.cmake. Back ends: stm32f4/truck_pins, absent/truck_inputs (none is fitted).
#pragma once

#include <cstdint>

#include "board_config.hpp"  // generated from boards/<board>/board.cmake: TruckInput, TruckOutput, what is fitted

namespace bms::hal {

/// Bits of TruckInput. Every circuit gives a low level when its wire is broken; then the bit is 0, which is the safe
/// state: key off, plug out, coils without supply, interlock open, crash.
struct TruckInputs {
  std::uint32_t fitted = 0, on = 0;
  /// Times that the coil supply fell while an output was on, and that have not been acknowledged. The interrupt has
  /// then opened all outputs, and they stay open until they are acknowledged.
  std::uint32_t coil_losses = 0;

  constexpr bool has(TruckInput input) const { return (fitted & static_cast<std::uint32_t>(input)) != 0; }
  constexpr bool is_on(TruckInput input) const { return (fitted & on & static_cast<std::uint32_t>(input)) != 0; }
  constexpr bool is_off(TruckInput input) const { return has(input) && !is_on(input); }
};

/// Call once per sample, before power_path_set().
TruckInputs truck_inputs();

/// Allows outputs to close again. Call with TruckInputs::coil_losses, after all outputs were opened.
void acknowledge_coil_losses(std::uint32_t losses);

/// outputs: bits of TruckOutput; those that are not fitted are ignored. Before the first call and after a reset all are
/// off.
void truck_outputs_set(std::uint32_t outputs);

}  // namespace bms::hal
