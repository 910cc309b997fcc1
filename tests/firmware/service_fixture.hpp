// What a truck and a workshop with this pack's keys send, made from the frames that the battery has sent. Written from
// firmware/can/messages.md and firmware/authentication/codes.hpp.
#pragma once

#include "authentication/codes.hpp"
#include "tests/firmware/host_hal.hpp"

namespace bms::firmware {

/// Holds the keys of a device, or wrong ones.
class KeyHolder {
 public:
  explicit KeyHolder(const authentication::Key& device)
      : service_(authentication::role_key(device, authentication::Role::service)),
        drive_(authentication::role_key(device, authentication::Role::drive)) {}

  /// A request for power under the last RequestChallenge that was sent.
  can::Frame drive(std::uint32_t request = can::DriveRequest::request_drive) {
    const auto challenge = host_hal::last<can::RequestChallenge>().value_or(can::RequestChallenge{});
    const std::uint64_t number = of(challenge);
    if (number != drive_challenge_) freshness_ = 0;
    drive_challenge_ = number;
    can::DriveRequest m;
    m.request = request;
    m.freshness = ++freshness_;
    m.code = authentication::drive_code(drive_, number, freshness_, static_cast<std::uint8_t>(request));
    return m.frame(count());
  }

  can::Frame challenge() {
    can::ServiceRequest m;
    m.kind = can::ServiceRequest::kind_challenge;
    return m.frame(count());
  }
  /// Answers the last ServiceChallenge that was sent.
  can::Frame response(std::uint16_t operator_number, std::uint32_t kind = can::ServiceRequest::kind_response) {
    session_ = of(host_hal::last<can::ServiceChallenge>().value_or(can::ServiceChallenge{}));
    sequence_ = 0;
    can::ServiceRequest m;
    m.kind = kind;
    m.operator_number = operator_number;
    m.code = authentication::session_code(service_, session_, operator_number);
    return m.frame(count());
  }
  /// The two frames of a command in a session.
  std::array<can::Frame, 2> command(std::uint32_t code, std::uint32_t argument, std::uint8_t parameter = 0) {
    can::Command c;
    c.parameter = parameter;
    c.code = code;
    c.argument = argument;
    const can::Frame frame = c.frame(count());
    can::CommandAuthority a;
    a.sequence = ++sequence_;
    a.code = authentication::command_code(service_, session_, sequence_, frame.data);
    return {a.frame(count()), frame};
  }

 private:
  template <class Message>
  static std::uint64_t of(const Message& m) {
    return m.challenge_low | static_cast<std::uint64_t>(m.challenge_high) << 32;
  }
  std::uint8_t count() { return counter_ = can::next(counter_); }

  authentication::Cmac service_, drive_;
  std::uint64_t drive_challenge_ = 0, session_ = 0;
  std::uint16_t freshness_ = 0, sequence_ = 0;
  std::uint8_t counter_ = 0;
};

}  // namespace bms::firmware
