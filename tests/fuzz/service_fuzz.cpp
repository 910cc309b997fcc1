// Any frames to service session and drive requests, 12 bytes each: kind, time, data. A holder of the key, whom the input
// moves too, is the only one who may open a session, command in it and drive; each of his frames counts once.
#include <vector>

#include "firmware/drive_requests.hpp"
#include "firmware/service_session.hpp"
#include "tests/fuzz/require.hpp"

namespace bms::hal {
std::uint32_t random_word() { return 0; }
}  // namespace bms::hal

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace bms;
  using Challenge = can::ServiceChallenge;
  const authentication::Key device{1, 2, 3}, service = authentication::role_key(device, authentication::Role::service),
                            drive = authentication::role_key(device, authentication::Role::drive);
  const authentication::Cmac service_mac(service), drive_mac(drive);
  firmware::ServiceSession session(service, true, size % 2 == 1);
  firmware::DriveRequests requests(drive, true);
  firmware::ChallengeSource source(device, 1, 2);
  std::uint64_t now_us = 0;
  std::vector<can::Frame> honest;  // that were sent by the holder
  std::uint16_t sequence = 0, freshness = 0;
  for (; size >= 12; data += 12, size -= 12) {
    now_us += static_cast<std::uint64_t>(data[1]) << data[2] % 28;
    if (requests.renew(now_us, source)) freshness = 0;
    can::Frame frame{0, 8, {}};
    for (std::size_t k = 0; k < 8; ++k) frame.data[k] = data[4 + k];
    const Challenge shown = session.message();
    const std::uint64_t challenge = shown.challenge_low | static_cast<std::uint64_t>(shown.challenge_high) << 32;
    const can::RequestChallenge of_requests = requests.message().value();
    const std::uint64_t request_challenge =
        of_requests.challenge_low | static_cast<std::uint64_t>(of_requests.challenge_high) << 32;
    switch (data[0] % 8) {
      case 0: {  // anything to the session but the right code, which the fuzzer can read from comparisons
        const auto request = can::ServiceRequest::of(frame);
        if (request.code == authentication::session_code(service_mac, challenge,
                                                         static_cast<std::uint16_t>(request.operator_number)))
          break;
        const std::uint32_t before = session.state();
        const std::uint32_t after = session.receive(request, now_us, source);
        require(after != Challenge::state_open || before == Challenge::state_open);
        break;
      }
      case 1: {  // the holder answers
        can::ServiceRequest request;
        request.kind = data[3] % 3;
        request.operator_number = data[4];
        request.code = authentication::session_code(service_mac, challenge, data[4]);
        const std::uint32_t before = session.state();
        const std::uint32_t after = session.receive(request, now_us, source);
        if (before != Challenge::state_open && after == Challenge::state_open) {
          require(before == Challenge::state_challenge && session.operator_number() == data[4]);
          sequence = 0;
        }
        break;
      }
      case 2: {  // any wrong authority
        const auto authority = can::CommandAuthority::of(frame);
        if (authority.code == authentication::command_code(service_mac, challenge,
                                                           static_cast<std::uint16_t>(authority.sequence), frame.data))
          break;
        session.receive(authority);
        require(!session.authorises(frame, now_us));
        break;
      }
      case 3: {  // the holder commands; the same two frames are not accepted again
        can::CommandAuthority authority;
        authority.sequence = ++sequence;
        authority.code = authentication::command_code(service_mac, challenge, sequence, frame.data);
        session.receive(authority);
        session.authorises(frame, now_us);
        session.receive(authority);
        require(!session.authorises(frame, now_us));
        break;
      }
      case 4: {  // any wrong drive request
        const auto request = can::DriveRequest::of(frame);
        if (request.code == authentication::drive_code(drive_mac, request_challenge,
                                                       static_cast<std::uint16_t>(request.freshness),
                                                       static_cast<std::uint8_t>(request.request)))
          break;
        require(!requests.receive(request));
        break;
      }
      case 5: {  // the holder drives, once each
        can::DriveRequest request;
        request.request = data[3] % 4;
        request.freshness = ++freshness;
        request.code = authentication::drive_code(drive_mac, request_challenge, freshness,
                                                  static_cast<std::uint8_t>(request.request));
        honest.push_back(request.frame(0));
        const auto wanted = requests.receive(request);
        require(wanted.has_value() == (request.request == 1 || request.request == 2));
        require(!requests.receive(request));
        break;
      }
      case 6:  // a replay
        if (!honest.empty()) require(!requests.receive(can::DriveRequest::of(honest[data[3] % honest.size()])));
        break;
      default:
        session.receive(can::ServiceRequest{}, now_us, source);
    }
    require(session.state() >= Challenge::state_closed && session.state() <= Challenge::state_locked);
    const Challenge now = session.message();
    const bool is_shown = now.state == Challenge::state_challenge || now.state == Challenge::state_open;
    require(is_shown == ((now.challenge_low | now.challenge_high) != 0));
  }
  return 0;
}
