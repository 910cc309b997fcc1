// Handles the commands that a vehicle or a workshop sends over CAN (Command in firmware/can/greybox_bms.dbc) and makes
// the answer to each.
//
// A frame with a wrong CRC, another identifier or the counter of the previous command is ignored. An invalid argument
// is answered "refused", an unknown code "no such command", one without the authority that it needs "not authorised";
// such a command changes nothing. Request 0 needs no authority.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>

#include "can_messages.hpp"  // generated from firmware/can/greybox_bms.dbc
#include "firmware/power_requests.hpp"
#include "hal/accepted_frames.hpp"
#include "protection/contactors.hpp"
#include "protection/fault_monitor.hpp"

namespace bms::firmware {

static_assert(can::Command::id == hal::command_frame_id && can::Stop::id == hal::stop_frame_id &&
                  can::ServiceRequest::id == hal::service_request_frame_id &&
                  can::CommandAuthority::id == hal::command_authority_frame_id &&
                  can::DriveRequest::id == hal::drive_request_frame_id,
              "the acceptance filter of a real bus would reject commands");
static_assert(can::Command::data_id == can::Command::id && can::Stop::data_id == can::Stop::id &&
                  can::ServiceRequest::data_id == can::ServiceRequest::id &&
                  can::CommandAuthority::data_id == can::CommandAuthority::id &&
                  can::DriveRequest::data_id == can::DriveRequest::id &&
                  can::Command::code_request == hal::request_code,
              "hal/request_queue.hpp checks the CRC with the identifier");

/// Parts of the stored data that are sent one by one: sixteen faults, then a reset cause each, with other counters,
/// then sixteen actions of service sessions.
inline constexpr std::uint32_t stored_parts = 16 + 7 + 16;

/// What a command may need beyond a right CRC.
enum class Privilege : std::uint8_t {
  drive,    ///< to close contactors
  service,  ///< to clear faults, calibrate, set the time or parameters
};

/// What the commands have requested so far.
struct Requested {
  bool log_samples = true;
  std::uint32_t unix_time_s = 0;  ///< new time of the calendar; 0: no change
  struct CalibrationChange {
    std::uint16_t which = 0;  ///< index into hal::SensorCalibration
    std::int32_t value = 0;   ///< ppm for gains, uV or uA for offsets
  };
  std::optional<CalibrationChange> calibration_change;  ///< reset when applied
  protection::Clear clear = protection::Clear::none;    ///< reset when applied
  std::uint8_t stored_next = 0, stored_end = 0;         ///< items of the stored data to be sent
  PowerRequests power;

  /// Returns the next item to be sent, if any: one with each sample.
  constexpr std::optional<std::uint8_t> next_stored_part() {
    if (stored_next >= stored_end) return std::nullopt;
    return stored_next++;
  }
};

struct NoOtherCommands {
  template <class May>
  constexpr std::uint32_t operator()(const can::Command&, May&&) const {
    return can::CommandAnswer::result_no_such_command;
  }
};

class Commands {
 public:
  /// Executes a command and returns the answer, or nothing if the frame is ignored. now_us: time of the sample.
  /// may(Privilege): whether this frame has that privilege; asked at most once.
  /// other(command, may): the result of a command that is not known here.
  template <class May, class Other = NoOtherCommands>
  constexpr std::optional<can::CommandAnswer> handle(const can::Frame& frame, std::uint64_t now_us,
                                                     Requested& requested, May&& may, Other&& other = {}) {
    if (frame.id != can::Command::id || frame.long_id || !can::intact(frame, can::Command::data_id))
      return std::nullopt;
    const std::uint8_t counter = can::counter_of(frame);
    if (counter >= can::counters) return std::nullopt;
    const auto command = can::Command::of(frame);
    // also with the counter of the last command: another node may have sent that one
    if (command.code == can::Command::code_request && command.argument == 0) requested.power.withdraw(now_us);
    if (counter == last_counter_) return std::nullopt;
    last_counter_ = counter;
    can::CommandAnswer answer;
    answer.code = command.code;
    answer.command_counter = counter;
    answer.result = execute(command, now_us, requested, may, other);
    return answer;
  }

 private:
  template <class May, class Other>
  static constexpr std::uint32_t execute(const can::Command& command, std::uint64_t now_us, Requested& requested,
                                         May&& may, Other&& other) {
    using A = can::CommandAnswer;
    switch (command.code) {
      case can::Command::code_clear_faults:
        if (command.argument > 1) return A::result_refused;
        if (!may(Privilege::service)) return A::result_not_authorised;
        requested.clear = command.argument == 1 ? protection::Clear::service : protection::Clear::user;
        return A::result_done;
      case can::Command::code_log_of_samples:
        if (command.argument > 1) return A::result_refused;
        requested.log_samples = command.argument == 1;
        return A::result_done;
      case can::Command::code_set_time:
        if (command.argument == 0) return A::result_refused;
        if (!may(Privilege::service)) return A::result_not_authorised;
        requested.unix_time_s = command.argument;
        return A::result_done;
      case can::Command::code_request:
        if (command.argument > static_cast<std::uint32_t>(protection::Request::charge)) return A::result_refused;
        if (command.argument == 0) return A::result_done;  // withdrawn above
        if (!may(Privilege::drive)) return A::result_not_authorised;
        return requested.power.ask(static_cast<protection::Request>(command.argument), now_us) ? A::result_done
                                                                                               : A::result_refused;
      case can::Command::code_stored_data: {
        const std::uint32_t first = command.argument & 0xFF, count = command.argument >> 8;
        if (first >= stored_parts || count > stored_parts) return A::result_refused;
        requested.stored_next = static_cast<std::uint8_t>(first);
        requested.stored_end =
            static_cast<std::uint8_t>(count == 0 ? stored_parts : std::min(first + count, stored_parts));
        return A::result_done;
      }
      case can::Command::code_voltage_gain:
      case can::Command::code_voltage_offset:
      case can::Command::code_current_gain:
      case can::Command::code_current_offset: {
        // ppm, uV, ppm, uA; a larger correction means a wrong part, not a tolerance
        constexpr std::int32_t most[] = {50'000, 100'000, 50'000, 5'000'000};
        const auto which = static_cast<std::uint16_t>(command.code - can::Command::code_voltage_gain);
        const auto value = static_cast<std::int32_t>(command.argument);
        if (value < -most[which] || value > most[which]) return A::result_refused;
        if (!may(Privilege::service)) return A::result_not_authorised;
        requested.calibration_change = Requested::CalibrationChange{which, value};
        return A::result_done;
      }
      default:
        return other(command, may);
    }
  }

  std::uint8_t last_counter_ = can::counters;  // no command has this one
};

}  // namespace bms::firmware
