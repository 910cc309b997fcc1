// One service session with a battery (firmware/service_session.hpp): asks for a challenge, answers it, sends commands,
// each with its authority and after the answer to the one before, closes the session. A battery that needs no session
// gets the commands alone. Time is this computer's, in seconds from any origin.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "authentication/codes.hpp"
#include "can_messages.hpp"  // generated from firmware/can/greybox_bms.dbc

namespace bms::monitor {

class ServiceClient {
 public:
  enum class State { working, done, refused, not_authorised, locked, no_key, wrong_key, silent };

  ServiceClient(const authentication::Key& device, std::uint16_t operator_number, std::uint32_t code,
                std::uint32_t argument)
      : ServiceClient(device, operator_number, {command_of(code, argument)}) {}
  /// commands: at least one.
  ServiceClient(const authentication::Key& device, std::uint16_t operator_number, std::vector<can::Command> commands)
      : service_(authentication::role_key(device, authentication::Role::service)),
        operator_(operator_number),
        commands_(std::move(commands)) {}

  /// Returns the frames to be sent now, if any.
  std::vector<can::Frame> due(double now_s);
  /// A frame from the bus; those with a wrong length or CRC are ignored.
  void receive(const can::Frame& frame, double now_s);

  State state() const { return state_; }
  /// The command that was not done, or the last one.
  const can::Command& command() const { return commands_[std::min(done_, commands_.size() - 1)]; }

 private:
  static constexpr double patience_s = 2.5;  ///< more than the longest time between two samples
  static constexpr int most_tries = 3;
  enum class Step { challenge, response, command, close };

  void receive_challenge(const can::ServiceChallenge& m, double now_s);
  static can::Command command_of(std::uint32_t code, std::uint32_t argument) {
    can::Command c;
    c.code = code;
    c.argument = argument;
    return c;
  }
  void go_to(Step step, double now_s);
  std::vector<can::Frame> frames();
  std::uint8_t count() { return counter_ = can::next(counter_); }

  authentication::Cmac service_;
  std::uint16_t operator_;
  std::vector<can::Command> commands_;
  std::size_t done_ = 0;  ///< commands
  State state_ = State::working;
  Step step_ = Step::challenge;
  bool needs_session_ = true;
  std::uint64_t challenge_ = 0;
  std::uint16_t sequence_ = 0;
  std::uint8_t counter_ = 0, command_counter_ = 0;
  double next_s_ = 0;
  int tries_ = 0;
};

/// One line for a person.
std::string words_for(ServiceClient::State state);

}  // namespace bms::monitor
