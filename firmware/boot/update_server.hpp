// The battery's side of an update: a UDS server (ISO 14229-1) with the services of a download. Needs no hardware; meant
// for the loader while no image runs, and for the application while it protects.
//
//   10 session            01 default, 02 programming; ends after 5 s without a request
//   27 security access    01: challenge of 6 bytes; 02: operator (2), session_code (4) of
//                         firmware/authentication/codes.hpp; a challenge of 0: no key, nothing to prove
//   22 read               F1A0 board, F1A1 state, F1A2 cell constants, F1A4 last refusal (1)
//   31 routine, 01 start  FF00 erase the target slot of the application, or with one more byte that of a kind of
//                         container (container.hpp); returns 0, or 1 if the battery restarts for it and the tool has
//                         to ask again; 0203 resume: digest of the header (32), returns the
//                         bytes received; FF01 check the slot and make it the next to start
//   34 request download   00 44 address (4) size (4): a target slot from its begin on, or from where it stopped
//   36 transfer data      sequence, at most 1,024 bytes
//   37 transfer exit
//   11 reset              01
//   3E tester present     00
//
// Numbers are big-endian, as UDS has them. What the battery refuses has the response code 70 or 22; the reason is a
// Refusal, read by 22 F1A4.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <utility>

#include "authentication/codes.hpp"
#include "boot/iso_tp.hpp"
#include "boot/receiver.hpp"

namespace bms::boot {

inline constexpr std::uint32_t update_request_id = 0x7B0, update_response_id = 0x7B8;

/// What the server needs of its surroundings.
class UpdateSurroundings {
 public:
  virtual bool at_rest() = 0;             ///< contactors open, no request for power
  virtual std::uint64_t challenge() = 0;  ///< never the same again; 48 bits, not 0
  virtual void restart() = 0;             ///< after the answer was sent

 protected:
  ~UpdateSurroundings() = default;
};

/// What runs, as 22 F1A1 sends it: running slot (0xFF: none), trial (1), last start returned (1), version (4), cell
/// hash (4), security counter (4), loader version (4), bytes received (4), development (1: the image, 2: the loader
/// accepts such images), time since this start in ms (4): less than before after a restart.
inline constexpr std::size_t state_record_bytes = 28;

/// Cell constants, as 22 F1A2 sends them: slot whose constants act (0xFF: those of the application's build), trial (1),
/// last start returned (1), version (4), hash of the cell file that acts (4), of the build's (4), security counter (4),
/// why the newest do not act (1).
inline constexpr std::size_t cell_record_bytes = 20;

/// Slots of cell constants, of an application that can use them.
struct CellSlots {
  SlotFlash& flash;
  const Battery& battery;
  Start started;  ///< found: they act
};

class UpdateServer {
 public:
  static constexpr std::uint64_t session_us = 5'000'000, locked_us = 600'000'000;
  static constexpr unsigned most_wrong_keys = 3;

  UpdateServer(SlotFlash& flash, const Battery& battery, const Start& started,
               const std::optional<authentication::Key>& service_key, UpdateSurroundings& surroundings,
               HeaderCheck* check = check_header, const std::optional<CellSlots>& cells = std::nullopt)
      : application_{&flash, &battery, running_slot(started)},
        receiver_(flash, battery, application_.running, check),
        battery_(battery),
        started_(started),
        key_(service_key),
        surroundings_(surroundings),
        refusal_(started.refusal),
        cells_(cells) {}

  /// Returns the answer, empty if none is to be sent. `room` has at least longest_answer bytes.
  static constexpr std::size_t longest_answer = 64;
  std::span<const std::uint8_t> answer(std::span<const std::uint8_t> request, std::span<std::uint8_t> room,
                                       std::uint64_t now_us);
  /// Returns true if the answer takes so long that "response pending" comes first.
  static bool takes_long(std::span<const std::uint8_t> request);
  /// Returns true once after an accepted reset; the caller has sent the answer and calls restart(). A restart that does
  /// not follow has to be asked for again.
  bool take_restart() { return std::exchange(restart_, false); }
  /// What was on trial has confirmed itself.
  void confirmed() {
    started_.trial = false;
    if (cells_) cells_->started.trial = false;
  }
  /// The application cannot use the cell constants that the loader has started: those of its build act. A trial goes on
  /// until the restart that ends it.
  void cell_refused(Refusal why) {
    cells_->started.found = false;
    cells_->started.refusal = why;
  }
  /// Of a block, for anyone while no transfer is active.
  std::span<std::uint8_t, block_bytes> room() { return receiver_.room(); }
  Refusal last_refusal() const { return refusal_; }
  const Receiver& receiver() const { return receiver_; }

 private:
  class Answer;
  void session(std::span<const std::uint8_t> request, Answer& answer, std::uint64_t now_us);
  void security(std::span<const std::uint8_t> request, Answer& answer, std::uint64_t now_us);
  void read(std::span<const std::uint8_t> request, Answer& answer) const;
  void routine(std::span<const std::uint8_t> request, Answer& answer);
  void request_download(std::span<const std::uint8_t> request, Answer& answer);
  void transfer(std::span<const std::uint8_t> request, Answer& answer);
  void refuse(Answer& answer, Refusal why);
  bool unlocked() const { return programming_ && (unlocked_ || !key_); }
  /// Neither slot is written while the other one returns if a trial fails.
  bool on_trial() const { return started_.trial || (cells_ && cells_->started.trial); }
  /// What was received completely starts on trial at the next reset. Nothing of the other kind begins before: of two
  /// that start on trial together nobody could say which one failed, and the tool would not know which one it waits
  /// for.
  bool may_not_begin(Kind kind) const { return on_trial() || (completed_ && *completed_ != kind); }
  std::optional<ReceiverTarget> target_of(Kind kind) const;
  Refusal erase(Kind kind);
  static constexpr std::uint8_t running_slot(const Start& started) { return started.found ? started.slot : 2; }

  ReceiverTarget application_;
  Receiver receiver_;
  const Battery& battery_;
  Start started_;
  std::optional<authentication::Key> key_;
  UpdateSurroundings& surroundings_;
  bool programming_ = false, unlocked_ = false, restart_ = false, download_ = false, exited_ = false;
  std::uint64_t since_us_ = 0, challenge_ = 0, locked_since_us_ = 0;
  unsigned wrong_ = 0;
  std::uint32_t blocks_ = 0;  ///< of this download
  Refusal refusal_;           ///< at first that of the start: why the newest image does not run
  std::optional<CellSlots> cells_;
  std::optional<Kind> completed_;  ///< received and checked since this start
};

/// Server and transport together: frames in, frames out.
class UpdateNode {
 public:
  UpdateNode(UpdateServer& server, UpdateSurroundings& surroundings) : server_(server), surroundings_(surroundings) {}
  void receive(const can::Frame& frame, std::uint64_t now_us) { transport_.receive(frame, now_us); }
  /// The next frame to send; works on what has arrived. Call it until it returns false.
  bool next_frame(can::Frame& frame, std::uint64_t now_us);

 private:
  UpdateServer& server_;
  UpdateSurroundings& surroundings_;
  IsoTp transport_{update_response_id, update_request_id};
  bool pending_sent_ = false;
};

}  // namespace bms::boot
