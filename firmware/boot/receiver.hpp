// Receives a container into the slot that does not run. The header is checked before a word is written, each block
// before it is written, and the whole slot, read back from the flash, at the end.
#pragma once

#include <cstdint>
#include <span>

#include "boot/slots.hpp"

namespace bms::boot {

/// What is received into.
struct ReceiverTarget {
  SlotFlash* flash;
  const Battery* battery;
  std::uint8_t running;  ///< the slot that may not be written; 2 if none runs
  std::uint8_t slot() const { return running == 0 ? 1 : 0; }
};

class Receiver {
 public:
  /// running: the slot that may not be written; 2 if none runs. check: check_header, or check_fields_and_key in an
  /// image that leaves the signature to the loader.
  Receiver(SlotFlash& flash, const Battery& battery, std::uint8_t running, HeaderCheck* check = check_header)
      : to_{&flash, &battery, running}, check_(check) {}

  /// Receives into other slots from now on. A transfer that was under way is over.
  void aim_at(const ReceiverTarget& target) {
    to_ = target;
    active_ = false;
  }
  Kind kind() const { return to_.battery->kind; }
  std::uint8_t target() const { return to_.slot(); }
  /// Erases the target, which takes seconds, or asks the loader for it: erase_at_restart. A slot that is erased already
  /// stays as it is. Refuses while the running image is on trial.
  Refusal prepare();
  /// Begins a transfer of container bytes from the start. Refuses a slot that is not erased.
  Refusal begin(std::uint32_t container_bytes);
  /// Takes the next bytes, at most to the announced end. After a refusal the transfer is over.
  Refusal take(std::span<const std::uint8_t> bytes);
  /// Ends the transfer and checks the slot; the next reset starts it on trial.
  Refusal finish();
  /// A connection was lost: bytes that arrived so far, if they belong to the container with this header digest; else 0.
  std::uint32_t resume(const Digest& header_digest) const;

  bool active() const { return active_; }
  std::uint32_t received() const { return received_; }
  const Battery& battery() const { return *to_.battery; }
  /// Room of a block, for anyone while no transfer is active.
  std::span<std::uint8_t, block_bytes> room() { return block_room_; }

 private:
  Refusal refuse(Refusal why) {
    active_ = false;
    return why;
  }
  Refusal header_complete();
  Refusal block_complete();
  bool write(std::uint32_t at, std::span<const std::uint8_t> bytes);

  SlotFlash& flash() { return *to_.flash; }

  ReceiverTarget to_;
  HeaderCheck* check_;
  bool active_ = false;
  std::uint32_t expected_ = 0, received_ = 0;
  Header header_{};
  Digest header_digest_{};
  HeaderBytes header_room_{};
  std::array<std::uint8_t, block_bytes> block_room_{};
};

}  // namespace bms::boot
