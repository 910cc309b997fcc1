// What the protections receive with a sample, in addition to it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "measurement/pack_sample.hpp"
#include "protection/contactors.hpp"
#include "protection/fault_monitor.hpp"

namespace bms::protection {

/// Estimates that go with a sample; measurement::no_reading: unknown.
template <std::size_t Cells>
struct PackEstimate {
  std::int32_t soc_ppb = measurement::no_reading, soc_sigma_ppb = 0;  ///< of the mean cell, 1e-9
  std::int32_t model_charge_ua = measurement::no_reading,
               model_discharge_ua = measurement::no_reading;  ///< state of function, both >= 0
  bool voltage_rejected = false;                              ///< Flag::voltage_rejected
  /// soc of each cell minus the mean, 1e-9.
  std::array<std::int32_t, Cells> cell_soc_ppb = measurement::PackSample<Cells>{}.cell_uv;
  std::array<std::int32_t, Cells> cell_sigma_ppb{};
};

/// Requests and commands from the bus, and results of the board's self-tests.
struct ExternalInputs {
  Request request = Request::none;
  Clear clear = Clear::none;  ///< as long as the key is pressed
  /// L+ and L-, the load side of the contactors, against the negative end of the cells.
  std::int32_t link_plus_uv = measurement::no_reading, link_minus_uv = measurement::no_reading;
  AuxiliaryContacts auxiliary = {};
  bool contact_lost = false;  ///< a main contact has opened by itself, perhaps only for a moment
  bool board_fault = false;   ///< failed self-test; with the first sample, a watchdog reset
  bool storage_fault = false;
  bool supply_dip = false;        ///< the supply of the controller has fallen, perhaps only for a moment
  std::uint32_t second_line = 0;  ///< trips of the front end: measurement::SecondLineTrip
  std::int16_t front_end_cdegc = measurement::no_temperature;  ///< of its die, 0.01 degrees C
  bool second_current_fitted = false;
  std::int32_t second_current_ua = measurement::no_reading;
  // Of the truck; an input that is not fitted stays at its initial value.
  bool coils_dead = false;  ///< the coils have no supply, or had none for a moment: a state, and no fault
  bool interlock_open = false, crashed = false;
  bool insulation_monitored = false;
  std::int32_t insulation_ohm = measurement::no_reading;  ///< between battery and frame
#ifndef BMS_WITHOUT_GROUP
  bool group_incomplete = false;  ///< nothing arrives from a battery of the group
#endif
};

template <class Inputs>
concept HasGroupIncomplete = requires(const Inputs& inputs) {
  inputs.group_incomplete;
};
/// ExternalInputs::group_incomplete of an image that has it.
template <class Inputs>
constexpr bool group_incomplete(const Inputs& inputs) {
  if constexpr (HasGroupIncomplete<Inputs>)
    return inputs.group_incomplete;
  else
    return false;
}
template <class Inputs>
constexpr void set_group_incomplete(Inputs& inputs, bool incomplete) {
  if constexpr (HasGroupIncomplete<Inputs>) inputs.group_incomplete = incomplete;
}

}  // namespace bms::protection
