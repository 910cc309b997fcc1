// Who may command this battery: the device key and what follows from it.
//
//   device key                 image for development     image for a product
//   none                       everybody, everything     nobody; no contactor closes
//   the one for development    its holders               as none
//   its own                    its holders               its holders
//
// A stop, the log of samples and reading stored data need no key. docs/safety/commands.md lists every command.
#pragma once

#include <optional>

#include "firmware/challenge_source.hpp"
#include "firmware/drive_requests.hpp"
#include "firmware/service_session.hpp"
#include "hal/device_key.hpp"
#include "storage/persistence.hpp"

namespace bms::firmware {

class Access {
 public:
  /// persistence: already started.
  explicit Access(const storage::Persistence& persistence) : Access(own_key(), persistence) {}

  ServiceSession session;
  DriveRequests drive;
  ChallengeSource source;

 private:
  using Key = std::optional<authentication::Key>;

  Access(const Key& device, const storage::Persistence& persistence)
      : session(role(device, authentication::Role::service), needed(device),
                persistence.actions().last(0).code == can::StoredAction::code_session_locked),
        drive(role(device, authentication::Role::drive), needed(device)),
        source(device.value_or(authentication::Key{}), persistence.events().starts, persistence.charge().operating_s) {}

  static Key own_key() {
    const Key key = hal::device_key();
    if (key == authentication::development_key && !hal::development_image()) return std::nullopt;
    return key;
  }
  static bool needed(const Key& device) { return device.has_value() || !hal::development_image(); }
  static Key role(const Key& device, authentication::Role which) {
    return device ? Key(authentication::role_key(*device, which)) : std::nullopt;
  }
};

}  // namespace bms::firmware
