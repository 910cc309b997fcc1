// The truck around the battery: its inputs, its heater, fan and lamp, its insulation, its second current sensor.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>

#include "firmware/commands.hpp"
#include "firmware/current_referee.hpp"
#include "firmware/hardware_inputs.hpp"
#include "firmware/insulation_monitor.hpp"
#include "firmware/shelf.hpp"
#include "firmware/truck_outputs.hpp"
#include "hal/can.hpp"
#include "hal/sleep.hpp"

namespace bms::firmware {

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
    if (command.argument != 0) return A::result_refused;
    if (!may(Privilege::service)) return A::result_not_authorised;
    if (closed) return A::result_refused;
    shelf_.ship();
    return A::result_done;
  }

  /// The battery rests between samples while nobody uses it. An insulation monitor that measures is being used. Returns
  /// true if it is to be switched off (firmware/shelf.hpp).
  template <std::size_t Cells>
  bool park(const measurement::PackSample<Cells>& pack, const protection::ExternalInputs& inputs,
            const ChargerState& charger, const protection::Decision& decision, const BoardStatus& board,
            const protection::ProtectionPlan& plan) {
    const bool used = inputs.request != protection::Request::none || charger.present || decision.outputs.any_closed() ||
                      board.truck.is_on(hal::TruckInput::key) || board.insulation.ohm != measurement::no_reading;
    hal::set_parked(!used);
    const std::int32_t lowest_uv = *std::ranges::min_element(pack.cell_uv);  // no_reading is the lowest value
    return shelf_.update(lowest_uv, plan.rule(protection::Fault::cell_undervoltage).release, used,
                         !hal::can_listening(), pack.time_us);
  }

 private:
  InsulationMonitor<hal::insulation_monitor> insulation_;
  TruckOutputs outputs_;
  CurrentReferee referee_;
  Shelf shelf_;
};

}  // namespace bms::firmware
