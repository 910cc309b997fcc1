// Requests for power that a node without the pack's drive key can neither forge nor repeat: DriveRequest carries a
// freshness number and a code over it (firmware/authentication/codes.hpp). The challenge in that code is new at each
// start and when the numbers are used up, so a recorded request is never accepted again.
//
// A wrong code costs the sender nothing, because a lock would let anybody stop the truck. hal/request_queue.hpp passes
// at most 48 requests on with each sample. At 480 guesses a second, one is right in 100 days on average, and drives for
// five seconds at most; a stop ends it.
#pragma once

#include <cstdint>
#include <optional>

#include "authentication/codes.hpp"
#include "can_messages.hpp"  // generated from firmware/can/greybox_bms.dbc
#include "firmware/challenge_source.hpp"
#include "protection/contactors.hpp"

namespace bms::firmware {

class DriveRequests {
 public:
  static constexpr std::uint16_t last_freshness = 0xFF00;  ///< then a new challenge follows

  /// drive_key: nothing if the battery has no key. needed: plain requests for power are refused.
  DriveRequests(const std::optional<authentication::Key>& drive_key, bool needed) : needed_(needed) {
    if (drive_key) mac_.emplace(*drive_key);
  }

  bool needed() const { return needed_; }

  /// Returns what a DriveRequest with the right CRC asks for, or nothing if it is not accepted.
  std::optional<protection::Request> receive(const can::DriveRequest& request) {
    const bool possible = request.request >= 1 && request.request <= 2 && request.freshness > freshness_;
    if (!mac_ || challenge_ == 0 || !possible) return std::nullopt;
    const auto freshness = static_cast<std::uint16_t>(request.freshness);
    const std::uint32_t code =
        authentication::drive_code(*mac_, challenge_, freshness, static_cast<std::uint8_t>(request.request));
    if (!authentication::equal_codes(code, request.code)) return std::nullopt;
    freshness_ = freshness;
    return static_cast<protection::Request>(request.request);
  }

  /// Call with each sample. Returns true if the challenge is a new one.
  bool renew(std::uint64_t now_us, ChallengeSource& source) {
    if (!mac_ || (challenge_ != 0 && freshness_ < last_freshness)) return false;
    challenge_ = source.next(now_us);
    freshness_ = 0;
    return true;
  }

  /// Nothing if everybody's requests are followed.
  std::optional<can::RequestChallenge> message() const {
    if (!needed_) return std::nullopt;
    can::RequestChallenge m;
    m.state = mac_ ? can::RequestChallenge::state_drive_request : can::RequestChallenge::state_no_key;
    m.challenge_low = static_cast<std::uint32_t>(challenge_);
    m.challenge_high = static_cast<std::uint32_t>(challenge_ >> 32);
    return m;
  }

 private:
  std::optional<authentication::Cmac> mac_;
  bool needed_;
  std::uint64_t challenge_ = 0;
  std::uint16_t freshness_ = 0;
};

}  // namespace bms::firmware
