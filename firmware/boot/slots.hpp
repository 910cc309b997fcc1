// Which slot runs: marks at the end of each slot, and the decision at every reset.
//
//   erased --first block--> receiving --all checked--> complete --start--> on trial --confirm--> confirmed
//                                                                  |
//                                                                  +-- reset, or three losses of power --> rejected
//
// A mark is one word that is programmed once; anything but its value reads as "not set". So a loss of power leaves each
// mark set, not set, or wavering, and both readings must be safe: a wavering mark lets the loader run either the old
// image or the new one, each checked completely before its start. The loader programs the marks that it relied on
// again, after which they are stable.
#pragma once

#include <cstdint>

#include "boot/slot_flash.hpp"
#include "boot/verify.hpp"

namespace bms::boot {

/// Bytes at the end of a slot that no payload reaches.
inline constexpr std::uint32_t trailer_bytes = 1024;
inline constexpr unsigned most_trials = 3;  ///< starts on trial that a loss of power may end

struct Marks {
  std::uint32_t sequence = 0;  ///< of the installation; the higher one is newer
  bool erased = false, complete = false, confirmed = false, rejected = false;
  unsigned trials = 0;  ///< starts on trial so far

  /// An image whose rejection was interrupted, that then started once more and confirmed itself, stays: the old one may
  /// be below the counter by then.
  bool usable() const { return complete && (confirmed || !rejected); }
};

Marks read_marks(SlotFlash& flash, std::uint8_t slot);

/// Checks header, signature (with check_header) and every block of a slot, without its marks.
Refusal check_slot(SlotFlash& flash, const Battery& battery, std::uint8_t slot, Header& header, HeaderCheck* check);

struct Start {
  bool found = false;  ///< otherwise no image may run: the loader waits for a transfer
  std::uint8_t slot = 0;
  bool trial = false;
  bool returned = false;            ///< this start rejected an image on trial
  Refusal refusal = Refusal::none;  ///< of the newest complete image, if another one or none is started
  Header header{};
};

/// Decides after a reset and sets the marks for it. power_on: the reset was a loss of power; any other one ends a
/// trial, because a running image resets only by watchdog, fault or its own wish. may_try: false for cell constants
/// while the application is on trial, so that a reset says which of both has failed; then only confirmed ones start.
Start choose(SlotFlash& flash, const Battery& battery, bool power_on, bool may_try = true);

/// The battery as it sees cell constants. Their counter is their own: it never forbids the running application.
/// cell_hash: of the cell file that the application is built with.
inline Battery for_cells(const Battery& battery, SlotFlash& cells, std::uint32_t cell_hash) {
  Battery b = battery;
  b.security_counter = security_counter(cells);
  b.slot_bytes = cells.slot_bytes() - trailer_bytes;
  b.kind = Kind::cell;
  b.cell_hash = cell_hash;
  return b;
}
/// Decides which cell constants act, after an application was found, and erases the slots for which that was asked. If
/// none are found, those of the application's build act.
Start choose_cell(SlotFlash& cells, const Battery& battery, const Start& application, bool power_on);

/// Called by the image that runs, once it has confirmed itself. Raises the counter to its security
/// version. May be called again.
bool confirm(SlotFlash& flash, std::uint8_t slot, std::uint32_t security_version);

/// Erases a slot after its marks were cleared, and marks it as erased only when the erase has ended.
bool prepare(SlotFlash& flash, std::uint8_t slot);
/// Asks the loader to erase a slot at the next start: what an image does that cannot erase while it protects. The slot
/// is no longer usable.
bool ask_for_erase(SlotFlash& flash, std::uint8_t slot);
/// Asks for the erase of the newest complete slot if it is not the one that was started: its content was damaged since
/// it was checked. So that is found once, and what was started stays. Returns true if it asked.
bool give_up_damaged(SlotFlash& flash, const Start& started);
/// Called by the loader for the slot that it does not start. Returns true if an erase was asked for; it was then tried.
/// An interrupted erase has to be asked for again.
bool erase_if_asked(SlotFlash& flash, std::uint8_t slot);
/// Called before the first block is written: the slot no longer counts as erased.
bool begin_writing(SlotFlash& flash, std::uint8_t slot);
/// Called after the content was checked: the slot is the newer one from now on.
bool complete(SlotFlash& flash, std::uint8_t slot);

}  // namespace bms::boot
