// A service session: a node that clears faults, calibrates or sets the time first proves that it has this pack's
// service key, then proves it again with every command (firmware/authentication/codes.hpp).
//
//   closed --challenge wanted--> challenge --right response--> open --close, or 60 s without a command--> closed
//                                          --third wrong one--> locked for ten minutes, then one attempt each
//
// A challenge is used once and lasts ten seconds. A command is preceded by its authority, whose sequence number must be
// above that of the command before; so nothing that was recorded is accepted again. Sixteen wrong authorities end the
// session as wrong responses do. A guess therefore succeeds once in 2^32 attempts, at one attempt in ten minutes.
//
// An image for development without a device key needs no session.
#pragma once

#include <cstdint>
#include <optional>

#include "authentication/codes.hpp"
#include "can_messages.hpp"  // generated from firmware/can/greybox_bms.dbc
#include "firmware/challenge_source.hpp"

namespace bms::firmware {

class ServiceSession {
 public:
  using Challenge = can::ServiceChallenge;
  static constexpr std::uint64_t challenge_us = 10'000'000, idle_us = 60'000'000, locked_us = 600'000'000;
  static constexpr unsigned most_wrong_responses = 3, most_wrong_commands = 16;

  /// service_key: nothing if the battery has no key. needed: commands need a session. locked: the last run ended
  /// locked.
  constexpr ServiceSession(const std::optional<authentication::Key>& service_key, bool needed, bool locked)
      : has_key_(service_key.has_value()),
        needed_(needed),
        state_(locked ? Challenge::state_locked : Challenge::state_closed),
        wrong_(locked ? most_wrong_responses - 1 : 0) {
    if (service_key) key_ = *service_key;
  }

  /// Handles a ServiceRequest with the right CRC. Returns what the session has become: one of Challenge::state_*.
  std::uint32_t receive(const can::ServiceRequest& request, std::uint64_t now_us, ChallengeSource& source) {
    expire(now_us);
    if (!needed_ || !has_key_) return state();
    using R = can::ServiceRequest;
    if (request.kind == R::kind_challenge && state_ == Challenge::state_closed) {
      challenge_ = source.next(now_us);
      enter(Challenge::state_challenge, now_us);
    } else if (request.kind == R::kind_response && state_ == Challenge::state_challenge) {
      if (right(request))
        open(request, now_us);
      else
        wrong(most_wrong_responses, now_us);
    } else if (request.kind == R::kind_close && state_ == Challenge::state_open && right(request)) {
      enter(Challenge::state_closed, now_us);
    }
    return state();
  }

  /// Keeps the authority for the command that follows; the newest one counts.
  constexpr void receive(const can::CommandAuthority& authority) { authority_ = authority; }

  /// Whether this frame Command may do what needs a session. Uses up the authority. Counts as a sign of life.
  bool authorises(const can::Frame& command, std::uint64_t now_us) {
    if (!needed_) return true;
    expire(now_us);
    const auto authority = authority_;
    authority_.reset();
    if (state_ != Challenge::state_open || !authority || authority->sequence <= sequence_) return false;
    const auto sequence = static_cast<std::uint16_t>(authority->sequence);
    if (!authentication::equal_codes(
            authentication::command_code(authentication::Cmac(key_), challenge_, sequence, command.data),
            authority->code)) {
      wrong(most_wrong_commands, now_us);
      return false;
    }
    sequence_ = sequence;
    wrong_ = 0;
    since_us_ = now_us;
    return true;
  }

  /// The message with state and challenge.
  constexpr Challenge message() const {
    Challenge m;
    m.state = state();
    const bool shown = m.state == Challenge::state_challenge || m.state == Challenge::state_open;
    m.challenge_low = shown ? static_cast<std::uint32_t>(challenge_) : 0;
    m.challenge_high = shown ? static_cast<std::uint32_t>(challenge_ >> 32) : 0;
    return m;
  }
  constexpr std::uint32_t state() const {
    if (!needed_) return Challenge::state_not_needed;
    return has_key_ ? state_ : Challenge::state_no_key;
  }
  constexpr std::uint16_t operator_number() const { return operator_; }  ///< of the open session, or of the last one

 private:
  bool right(const can::ServiceRequest& request) const {
    return authentication::equal_codes(
        authentication::session_code(authentication::Cmac(key_), challenge_,
                                     static_cast<std::uint16_t>(request.operator_number)),
        request.code);
  }
  constexpr void open(const can::ServiceRequest& request, std::uint64_t now_us) {
    operator_ = static_cast<std::uint16_t>(request.operator_number);
    sequence_ = 0;
    wrong_ = 0;
    authority_.reset();
    enter(Challenge::state_open, now_us);
  }
  /// A wrong code: the challenge is used up, or the session counts it.
  constexpr void wrong(unsigned most, std::uint64_t now_us) {
    if (++wrong_ >= most)
      enter(Challenge::state_locked, now_us);
    else if (state_ == Challenge::state_challenge)
      enter(Challenge::state_closed, now_us);
  }
  constexpr void expire(std::uint64_t now_us) {
    if (!timed_) {  // the lock of the last run begins with the first frame
      timed_ = true;
      since_us_ = now_us;
    }
    const std::uint64_t elapsed_us = now_us - since_us_;
    const bool over = (state_ == Challenge::state_challenge && elapsed_us >= challenge_us) ||
                      (state_ == Challenge::state_open && elapsed_us >= idle_us);
    if (over) enter(Challenge::state_closed, now_us);
    if (state_ == Challenge::state_locked && elapsed_us >= locked_us) {
      wrong_ = most_wrong_responses - 1;
      enter(Challenge::state_closed, now_us);
    }
  }
  constexpr void enter(std::uint32_t state, std::uint64_t now_us) {
    state_ = state;
    since_us_ = now_us;
    timed_ = true;
  }

  authentication::Key key_{};
  bool has_key_, needed_, timed_ = false;
  std::uint32_t state_;
  unsigned wrong_;
  std::uint64_t challenge_ = 0, since_us_ = 0;
  std::uint16_t sequence_ = 0, operator_ = 0;
  std::optional<can::CommandAuthority> authority_;
};

}  // namespace bms::firmware
