// The truck around the battery: its inputs, its heater, fan and lamp, its insulation, its second current sensor.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <type_traits>

#include "firmware/commands.hpp"
#include "firmware/current_referee.hpp"
#include "firmware/hardware_inputs.hpp"
#include "firmware/insulation_monitor.hpp"
#include "firmware/shelf.hpp"
#include "firmware/truck_outputs.hpp"
#include "hal/can.hpp"
#include "hal/sleep.hpp"

namespace bms::firmware {

/// Board::switches_off: build option BMS_SWITCHES_OFF (firmware/shelf.hpp).
template <class Board>
inline constexpr bool has_ship_mode = requires {
  requires Board::switches_off;
};

/// ShipMode: has_ship_mode of the board.
template <bool ShipMode>
class TruckSide {
 public:
  /// Call once per sample. fitted: bits of parameters::Parameter::inputs_fitted.
  Losses read(std::int32_t fitted, std::uint64_t now_us, BoardStatus& board, protection::ExternalInputs& inputs) {
    const Losses losses = read_hardware(fitted, board, inputs);
    board.insulation = insulation_.now(now_us);
    inputs.insulation_monitored = board.insulation.fitted;
    inputs.insulation_ohm = board.insulation.ohm;
    return losses;
  }

  /// Returns false for a frame that is not the insulation monitor's.
  bool receive(const can::Frame& frame, std::uint64_t now_us) { return insulation_.receive(frame, now_us); }

  /// Names the wrong current sensor when they begin to contradict each other, before the contactors are open.
  void judge_sensors(const measurement::Sample& mean, std::int32_t second_ua, const protection::Decision& decision,
                     BoardStatus& board) {
    if constexpr (hal::may_have_second_current) {
      using M = can::TruckInputs;
      if (!has(decision.faults, protection::Fault::current_sensors_differ)) {
        referee_.update(mean, second_ua);
        board.wrong_current_sensor = M::wrong_current_sensor_none;
      } else if (board.wrong_current_sensor == M::wrong_current_sensor_none) {
        board.wrong_current_sensor = referee_.verdict();
      }
    }
  }

  void switch_outputs(const std::array<std::int16_t, measurement::max_temperatures>& cdegc, std::int32_t soc_ppb,
                      bool charger_present, std::uint64_t now_us, const protection::Decision& decision,
                      const protection::ProtectionPlan& plan, BoardStatus& board) {
    if constexpr (hal::fitted_outputs != 0) {
      board.truck_outputs = outputs_.update({.cdegc = cdegc,
                                             .soc_ppb = soc_ppb,
                                             .charger_present = charger_present,
                                             .requested = decision.state != protection::ContactorState::off,
                                             .opens = (decision.faults & (plan.open | plan.open_now)) != 0,
                                             .now_us = now_us},
                                            plan);
      hal::truck_outputs_set(board.truck_outputs);
    }
  }

  /// Returns the result of a command that is for the truck, if it is.
  template <class May>
  std::optional<std::uint32_t> command(const can::Command& command, bool closed, May&& may) {
    using A = can::CommandAnswer;
    if (command.code != can::Command::code_switch_off) return std::nullopt;
    if constexpr (!ShipMode) return A::result_refused;
    if (command.argument != 0) return A::result_refused;
    if (!may(Privilege::service)) return A::result_not_authorised;
    return !closed && shelf_.ship() ? A::result_done : A::result_refused;
  }

  /// The battery rests between samples while nobody uses it; an insulation monitor that measures is being used. Returns
  /// true if it is to be switched off (firmware/shelf.hpp), which the monitor does not prevent. A contactor that is not
  /// proven open, by its contact, a weld or the current, does.
  template <std::size_t Cells>
  bool park(const measurement::PackSample<Cells>& pack, const protection::ExternalInputs& inputs,
            const ChargerState& charger, const protection::Decision& decision, const BoardStatus& board,
            const protection::ProtectionPlan& plan) {
    const bool wanted = inputs.request != protection::Request::none || charger.present ||
                        decision.outputs.any_closed() || board.truck.is_on(hal::TruckInput::key);
    hal::set_parked(!wanted && board.insulation.ohm == measurement::no_reading);
    if constexpr (!ShipMode) {
      return false;
    } else {
      const std::int32_t rest_ua = plan.contactors.rest_ua;
      const bool rests =
          pack.current_ua != measurement::no_reading && pack.current_ua <= rest_ua && pack.current_ua >= -rest_ua;
      const bool closed = decision.welded_pole != protection::Pole::none || inputs.auxiliary.main_plus_closed ||
                          inputs.auxiliary.main_minus_closed;
      const std::int32_t lowest_uv = *std::ranges::min_element(pack.cell_uv);  // no_reading is the lowest value
      return shelf_.update(lowest_uv, plan.rule(protection::Fault::cell_undervoltage).release,
                           wanted || !rests || closed, !hal::can_listening(), hal::load_side_discharged(),
                           pack.time_us);
    }
  }

  /// Reads again what park() has read at the begin of its sample: storing the state has taken milliseconds. truck: the
  /// inputs of that sample. A node that has begun to talk counts as in park(), not for a workshop's command.
  bool still_parked(hal::TruckInputs truck) const {
    if constexpr (ShipMode) {
      truck.on = hal::truck_inputs().on;
      if (truck.is_on(hal::TruckInput::key) || truck.is_on(hal::TruckInput::charger_plug)) return false;
      return shelf_.commanded() || !(hal::can_listening() || hal::bus_stirs());
    }
    return false;
  }

 private:
  InsulationMonitor<hal::insulation_monitor> insulation_;
  TruckOutputs outputs_;
  CurrentReferee referee_;
  struct Never {
    bool ship() const { return false; }
  };
  [[no_unique_address]] std::conditional_t<ShipMode, Shelf, Never> shelf_;
};

}  // namespace bms::firmware
