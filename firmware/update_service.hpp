// An image that a boot loader has started: it receives a new one into the other slot while it protects, confirms itself
// when it is on trial, and restarts on request.
//
//   receives   frames are answered when they arrive, between two samples. A block of 4 KiB takes 17 ms of programming.
//   signature  is left to the loader: its check would stop the samples for 0.2 s. The loader starts nothing without it.
//   erases     nothing: an erase stops the core for up to two seconds. It asks the loader for it by a restart.
//   restarts   only at rest, and only on request or when a trial has failed
//   cell       cell constants of an update act from the start on, if they are accepted (firmware/cell_of_update.hpp)
//   on trial   no contactor closes. So the reset that ends a failed trial opens none under load.
#pragma once

#include <cstdint>
#include <optional>

#include "boot/chip_slots.hpp"
#include "boot/handover.hpp"
#include "boot/update_server.hpp"
#include "cell_of_update.hpp"
#include "challenge_source.hpp"

namespace bms::firmware {

class UpdateService final : public boot::UpdateSurroundings {
 public:
  /// On trial: healthy for so long confirms; not confirmed after so long rejects.
  static constexpr std::uint64_t healthy_us = 5'000'000, longest_trial_us = 60'000'000;

  /// starts, operating_s: from storage, for the challenges.
  void start(std::uint32_t starts, std::uint32_t operating_s);
  void receive(const can::Frame& frame);

  struct Health {
    std::uint64_t now_us = 0;
    bool at_rest = false;   ///< contactors open, no request
    bool measured = false;  ///< voltages of all cells and the current
    bool fit = false;       ///< self-tests of the board, storage, an estimate that is a number
  };
  /// Call after each sample. Returns true if the battery is to store its state and restart now.
  bool restart_due(const Health& health);
  /// The image, or its cell constants, has not confirmed itself yet: no contactor may close.
  bool on_trial() const { return trial_ || cell_.trial; }
  /// This start has rejected a newer image, or newer cell constants, on trial.
  bool returned() const { return started_.returned || cell_.returned; }
  /// The newest cell constants were complete once, and are damaged now: others act.
  bool cell_damaged() const { return boot::says_damaged(cell_.refusal); }
  /// Call when that is stored: their slot is erased at the next start, so it is said once.
  void give_up_damaged_cell() { boot::give_up_damaged(cells_, cell_); }

  // UpdateSurroundings
  bool at_rest() override { return at_rest_; }
  std::uint64_t challenge() override;
  void restart() override { restart_wanted_ = true; }

 private:
  void use_cell();
  void send_waiting(std::uint64_t now_us);
  void judge_trial(const Health& health);

  boot::ChipSlots slots_{false}, cells_{false, boot::Kind::cell};
  std::optional<boot::KeyTable> keys_;
  boot::Battery battery_, cell_battery_;
  boot::Start started_, cell_;
  std::optional<ChallengeSource> challenges_;
  std::optional<boot::UpdateServer> server_;
  std::optional<boot::UpdateNode> node_;
  bool trial_ = false, at_rest_ = false, restart_wanted_ = false, timed_ = false, was_healthy_ = false;
  std::uint64_t first_us_ = 0, healthy_since_us_ = 0;
};

template <bool in_slot>
struct UpdateOfBoard {};

template <>
struct UpdateOfBoard<true> {
  static UpdateService& update();
  static std::uint32_t cell_hash_of_build() { return firmware::cell_hash_of_build(); }
  [[noreturn]] static void restart();
};

}  // namespace bms::firmware
