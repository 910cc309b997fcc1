// The commands that read and set the parameters (firmware/parameters/). Reading needs no key; setting and applying need
// a service session, and applying open contactors. A command that is refused discards the new set.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>

#include "can_messages.hpp"  // generated from firmware/can/greybox_bms.dbc
#include "firmware/commands.hpp"
#include "parameters/parameter_block.hpp"

namespace bms::firmware {

class ParameterCommands {
 public:
  /// Returns CommandAnswer::result_*. closed: a contactor is closed. may: as Commands::handle().
  template <class May>
  std::uint32_t execute(const can::Command& command, bool closed, parameters::ParameterBlock& block,
                        storage::Persistence& persistence, May&& may) {
    using A = can::CommandAnswer;
    switch (command.code) {
      case can::Command::code_read_parameters: {
        const std::uint32_t first = command.argument & 0xFF, count = command.argument >> 8;
        if (first >= parts || count > parts) return A::result_refused;
        next_ = static_cast<std::uint8_t>(first);
        end_ = static_cast<std::uint8_t>(count == 0 ? parts : std::min<std::uint32_t>(first + count, parts));
        return A::result_done;
      }
      case can::Command::code_set_parameter:
        if (!may(Privilege::service)) return A::result_not_authorised;
        if (command.parameter == 0) {
          block.begin();
          return A::result_done;
        }
        return block.set(command.parameter, static_cast<std::int32_t>(command.argument)) ? A::result_done
                                                                                         : A::result_refused;
      case can::Command::code_apply_parameters:
        if (!may(Privilege::service)) return A::result_not_authorised;
        return !closed && block.apply(command.argument, persistence) ? A::result_done : A::result_refused;
      default:
        return A::result_no_such_command;
    }
  }

  /// The number to be sent with this sample, if any: 0 for the block, then the parameters.
  std::optional<std::uint8_t> next_part() {
    if (next_ >= end_) return std::nullopt;
    return next_++;
  }

 private:
  static constexpr std::uint32_t parts = parameters::parameter_count + 1;

  std::uint8_t next_ = 0, end_ = 0;
};

/// The four values of ParameterValue for a number: value, lowest, highest, initial.
inline std::array<std::int32_t, 4> values_to_send(const parameters::ParameterBlock& block, std::uint8_t number) {
  if (number == 0)
    return {static_cast<std::int32_t>(parameters::check_code(block.active())), block.revision(),
            parameters::parameter_count, static_cast<std::int32_t>(block.state())};
  const parameters::Range& range = block.ranges()[number - 1U];
  return {block.active()[number - 1U], range.lowest, range.highest, range.initial};
}

}  // namespace bms::firmware
