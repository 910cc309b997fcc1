// What the codes on the bus are made of: battery, truck and service tool compute them with the same functions.
//
//   key of a role     CMAC(device key, role): a truck gets the key `drive`, a workshop the key `service`; neither gives
//                     the other or the device key away
//   code              the first four bytes of CMAC(key of the role, message), as a little-endian number
//   session           message: 1, challenge (6 bytes), operator (2)
//   command           message: 2, challenge (6) of the session, sequence (2), the 8 data bytes of Command
//   drive             message: 3, challenge (6) of RequestChallenge, freshness (2), request (1)
//
// Numbers are little-endian. A code of 32 bits is guessed once in 2^32 attempts; what limits the attempts stands in
// firmware/service_session.hpp and firmware/drive_requests.hpp.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "authentication/cmac.hpp"

namespace bms::authentication {

/// Of images for development only; anybody can read it here. Firmware of a product treats it as no key.
inline constexpr Key development_key{'g', 'r', 'e', 'y', 'b', 'o', 'x', ' ', 'd', 'e', 'v', 'e', 'l', 'o', 'p', '.'};

enum class Role : std::uint8_t { service = 0x53, drive = 0x44 };

inline constexpr std::uint64_t challenge_mask = 0xFFFF'FFFF'FFFF;  ///< a challenge has 48 bits

constexpr Key role_key(const Key& device, Role role) {
  const std::array<std::uint8_t, 1> name{static_cast<std::uint8_t>(role)};
  return Cmac(device)(name);
}

namespace codes_detail {

enum class Kind : std::uint8_t { session = 1, command = 2, drive = 3 };

/// A message, number by number.
class Message {
 public:
  constexpr explicit Message(Kind kind) { put(static_cast<std::uint8_t>(kind), 1); }
  constexpr Message& put(std::uint64_t number, std::size_t bytes) {
    for (std::size_t k = 0; k < bytes; ++k) bytes_[size_++] = static_cast<std::uint8_t>(number >> (8 * k));
    return *this;
  }
  constexpr std::uint32_t code(const Cmac& key) const {
    const Block all = key(std::span(bytes_).first(size_));
    return all[0] | static_cast<std::uint32_t>(all[1]) << 8 | static_cast<std::uint32_t>(all[2]) << 16 |
           static_cast<std::uint32_t>(all[3]) << 24;
  }

 private:
  std::array<std::uint8_t, 17> bytes_{};
  std::size_t size_ = 0;
};

}  // namespace codes_detail

/// challenge: of ServiceChallenge. operator_number: 0 to 65,535, who answers for what the session does.
constexpr std::uint32_t session_code(const Cmac& service, std::uint64_t challenge, std::uint16_t operator_number) {
  using namespace codes_detail;
  return Message(Kind::session).put(challenge, 6).put(operator_number, 2).code(service);
}

/// sequence: above that of the last command of the session. command: the eight data bytes of the frame Command.
constexpr std::uint32_t command_code(const Cmac& service, std::uint64_t challenge, std::uint16_t sequence,
                                     const std::array<std::uint8_t, 8>& command) {
  using namespace codes_detail;
  std::uint64_t bytes = 0;
  for (std::size_t k = 0; k < command.size(); ++k) bytes |= static_cast<std::uint64_t>(command[k]) << (8 * k);
  return Message(Kind::command).put(challenge, 6).put(sequence, 2).put(bytes, 8).code(service);
}

/// challenge: of RequestChallenge. freshness: above that of the last request under this challenge. request: as in
/// DriveRequest.
constexpr std::uint32_t drive_code(const Cmac& drive, std::uint64_t challenge, std::uint16_t freshness,
                                   std::uint8_t request) {
  using namespace codes_detail;
  return Message(Kind::drive).put(challenge, 6).put(freshness, 2).put(request, 1).code(drive);
}

}  // namespace bms::authentication
