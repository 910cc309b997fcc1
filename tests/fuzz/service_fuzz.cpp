// Any frames to service session and drive requests, 12 bytes each: kind, time, data. A holder of the key, whom the
// input moves too, is the only one who may open a session, command in it and drive; each of his frames counts once.
#include <vector>

#include "firmware/drive_requests.hpp"
#include "firmware/service_session.hpp"
#include "tests/fuzz/require.hpp"

namespace bms::hal {
std::uint32_t random_word() { return 0; }
}  // namespace bms::hal

namespace bms {
namespace {

using Challenge = can::ServiceChallenge;
using authentication::Role;

constexpr authentication::Key device{1, 2, 3};

template <class Message>
std::uint64_t challenge_of(const Message& m) {
  return m.challenge_low | static_cast<std::uint64_t>(m.challenge_high) << 32;
}

class Bench {
 public:
  explicit Bench(bool locked) : session_(authentication::role_key(device, Role::service), true, locked) {}

  void step(const std::uint8_t* data) {
    now_us_ += static_cast<std::uint64_t>(data[1]) << data[2] % 28;
    if (requests_.renew(now_us_, source_)) freshness_ = 0;
    can::Frame frame{0, 8, {}};
    for (std::size_t k = 0; k < 8; ++k) frame.data[k] = data[4 + k];
    act(data[0] % 8, data[3], frame);
    require(session_.state() >= Challenge::state_closed && session_.state() <= Challenge::state_locked);
    const Challenge now = session_.message();
    const bool shown = now.state == Challenge::state_challenge || now.state == Challenge::state_open;
    require(shown == ((now.challenge_low | now.challenge_high) != 0));
  }

 private:
  void act(int kind, std::uint8_t choice, const can::Frame& frame) {
    switch (kind) {
      case 0:
        return wrong_request(can::ServiceRequest::of(frame));
      case 1:
        return holder_answers(choice, frame.data[0]);
      case 2:
        return wrong_command(frame);
      case 3:
        return holder_commands(frame);
      case 4:
        return wrong_drive(can::DriveRequest::of(frame));
      case 5:
        return holder_drives(choice);
      case 6:  // a replay
        if (!honest_.empty()) require(!requests_.receive(can::DriveRequest::of(honest_[choice % honest_.size()])));
        return;
      default:
        session_.receive(can::ServiceRequest{}, now_us_, source_);
    }
  }

  /// Anything but the right code, which the fuzzer could read from comparisons.
  void wrong_request(const can::ServiceRequest& request) {
    const auto operator_number = static_cast<std::uint16_t>(request.operator_number);
    if (request.code == authentication::session_code(service_, challenge(), operator_number)) return;
    const std::uint32_t before = session_.state();
    const std::uint32_t after = session_.receive(request, now_us_, source_);
    require(after != Challenge::state_open || before == Challenge::state_open);
  }
  void holder_answers(std::uint8_t choice, std::uint8_t operator_number) {
    can::ServiceRequest request;
    request.kind = choice % 3;
    request.operator_number = operator_number;
    request.code = authentication::session_code(service_, challenge(), operator_number);
    const std::uint32_t before = session_.state();
    const std::uint32_t after = session_.receive(request, now_us_, source_);
    if (before == Challenge::state_open || after != Challenge::state_open) return;
    require(before == Challenge::state_challenge && session_.operator_number() == operator_number);
    sequence_ = 0;
  }
  void wrong_command(const can::Frame& frame) {
    const auto authority = can::CommandAuthority::of(frame);
    const auto sequence = static_cast<std::uint16_t>(authority.sequence);
    if (authority.code == authentication::command_code(service_, challenge(), sequence, frame.data)) return;
    session_.receive(authority);
    require(!session_.authorises(frame, now_us_));
  }
  /// The same two frames are not accepted again.
  void holder_commands(const can::Frame& frame) {
    can::CommandAuthority authority;
    authority.sequence = ++sequence_;
    authority.code = authentication::command_code(service_, challenge(), sequence_, frame.data);
    session_.receive(authority);
    session_.authorises(frame, now_us_);
    session_.receive(authority);
    require(!session_.authorises(frame, now_us_));
  }
  void wrong_drive(const can::DriveRequest& request) {
    const std::uint32_t right =
        authentication::drive_code(drive_, request_challenge(), static_cast<std::uint16_t>(request.freshness),
                                   static_cast<std::uint8_t>(request.request));
    if (request.code != right) require(!requests_.receive(request));
  }
  void holder_drives(std::uint8_t choice) {
    can::DriveRequest request;
    request.request = choice % 4;
    request.freshness = ++freshness_;
    request.code =
        authentication::drive_code(drive_, request_challenge(), freshness_, static_cast<std::uint8_t>(request.request));
    honest_.push_back(request.frame(0));
    const bool possible = request.request == 1 || request.request == 2;
    require(requests_.receive(request).has_value() == possible);
    require(!requests_.receive(request));
    if (!possible) --freshness_;
  }
  std::uint64_t challenge() const { return challenge_of(session_.message()); }
  std::uint64_t request_challenge() const { return challenge_of(requests_.message().value()); }

  authentication::Cmac service_{authentication::role_key(device, Role::service)};
  authentication::Cmac drive_{authentication::role_key(device, Role::drive)};
  firmware::ServiceSession session_;
  firmware::DriveRequests requests_{authentication::role_key(device, Role::drive), true};
  firmware::ChallengeSource source_{device, 1, 2};
  std::uint64_t now_us_ = 0;
  std::vector<can::Frame> honest_;  ///< drive requests that the holder has sent
  std::uint16_t sequence_ = 0, freshness_ = 0;
};

}  // namespace
}  // namespace bms

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  bms::Bench bench(size % 2 == 1);
  for (; size >= 12; data += 12, size -= 12) bench.step(data);
  return 0;
}
