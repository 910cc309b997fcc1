// What the vehicle or a workshop asks of the battery over CAN (Command in can/greybox_bms.dbc), and what it is
// answered.
//
// A command is heard once: a wrong CRC, a frame of another message or the counter of the command before are not. An
// argument that makes no sense is refused, a code that nobody knows answered as such; neither changes anything.
#pragma once

#include <cstdint>
#include <optional>

#include "can_messages.hpp"  // generated from can/greybox_bms.dbc
#include "hal/accepted_frames.hpp"
#include "protection/contactors.hpp"
#include "protection/fault_monitor.hpp"

namespace bms::firmware {

static_assert(can::Command::id == hal::command_frame_id, "a real bus would filter commands out");

/// What commands set.
struct Requested {
  static constexpr std::uint64_t request_timeout_us = 5'000'000;

  bool log_samples = true;
  std::uint32_t unix_time_s = 0;  ///< that the calendar is to be set to; 0: not
  struct CalibrationChange {
    std::uint16_t which = 0;  ///< of hal::Calibration, in its order
    std::int32_t value = 0;
  };
  std::optional<CalibrationChange> calibration_change;  ///< of the measuring chain, until it has been used
  protection::Clear clear = protection::Clear::none;    ///< until it has been used
  protection::Request power = protection::Request::none;
  std::uint64_t power_at_us = 0;

  /// What is still asked for: who does not repeat it has gone.
  constexpr protection::Request active_request(std::uint64_t now_us) const {
    return now_us - power_at_us < request_timeout_us ? power : protection::Request::none;
  }
};

class Commands {
 public:
  /// now_us: the samples' clock. Nothing: the frame is no command that is heard.
  constexpr std::optional<can::CommandAnswer> handle(const can::Frame& frame, std::uint64_t now_us,
                                                     Requested& requested) {
    if (frame.id != can::Command::id || frame.long_id || !can::intact(frame, can::Command::data_id))
      return std::nullopt;
    const std::uint8_t counter = can::counter_of(frame);
    if (counter >= can::counters || counter == last_counter_) return std::nullopt;
    last_counter_ = counter;
    const auto command = can::Command::of(frame);
    can::CommandAnswer answer;
    answer.code = command.code;
    answer.command_counter = counter;
    answer.result = execute(command, now_us, requested);
    return answer;
  }

 private:
  static constexpr std::uint32_t execute(const can::Command& command, std::uint64_t now_us, Requested& requested) {
    using A = can::CommandAnswer;
    switch (command.code) {
      case can::Command::code_clear_faults:
        if (command.argument > 1) return A::result_refused;
        requested.clear = command.argument == 1 ? protection::Clear::service : protection::Clear::user;
        return A::result_done;
      case can::Command::code_log_of_samples:
        if (command.argument > 1) return A::result_refused;
        requested.log_samples = command.argument == 1;
        return A::result_done;
      case can::Command::code_set_time:
        if (command.argument == 0) return A::result_refused;
        requested.unix_time_s = command.argument;
        return A::result_done;
      case can::Command::code_request:
        if (command.argument > static_cast<std::uint32_t>(protection::Request::charge)) return A::result_refused;
        requested.power = static_cast<protection::Request>(command.argument);
        requested.power_at_us = now_us;
        return A::result_done;
      case can::Command::code_voltage_gain:
      case can::Command::code_voltage_offset:
      case can::Command::code_current_gain:
      case can::Command::code_current_offset: {
        constexpr std::int32_t most[] = {50'000, 100'000, 50'000,
                                         5'000'000};  // ppm, uV, ppm, uA: more is no calibration, but a wrong part
        const auto which = static_cast<std::uint16_t>(command.code - can::Command::code_voltage_gain);
        const auto value = static_cast<std::int32_t>(command.argument);
        if (value < -most[which] || value > most[which]) return A::result_refused;
        requested.calibration_change = Requested::CalibrationChange{which, value};
        return A::result_done;
      }
      default:
        return A::result_no_such_command;
    }
  }

  std::uint8_t last_counter_ = can::counters;  // no command's
};

}  // namespace bms::firmware
