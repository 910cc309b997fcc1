#include "boot/slots.hpp"

#include <array>

namespace bms::boot {

namespace {

// Places of the marks, from the end of the slot. Values with as many zeros as ones: an erase or a programming that was
// interrupted does not produce them from erased or cleared words.
constexpr std::uint32_t erased_at = 64, sequence_at = 60, complete_at = 56, confirmed_at = 52, rejected_at = 48,
                        first_trial_at = 44, erase_asked_at = 28;
constexpr std::uint32_t erased_mark = 0x96A5'3C1E, complete_mark = 0xC35A'69E1, confirmed_mark = 0x5AC3'961E,
                        rejected_mark = 0x3CA5'69D2, trial_mark = 0xA53C'D296, erase_asked_mark = 0x69D2'A53C;

std::uint32_t word_at(SlotFlash& flash, std::uint8_t slot, std::uint32_t from_end) {
  std::array<std::uint8_t, 4> bytes{};
  flash.read(slot, flash.slot_bytes() - from_end, bytes);
  return hal::get_bytes<std::uint32_t>(bytes, 0);
}

bool set(SlotFlash& flash, std::uint8_t slot, std::uint32_t from_end, std::uint32_t word) {
  return flash.program(slot, flash.slot_bytes() - from_end, word);
}

bool set_trial(SlotFlash& flash, std::uint8_t slot, unsigned trial) {
  return set(flash, slot, first_trial_at - 4 * trial, trial_mark);
}

/// Why a complete slot may not run although nothing is wrong with its content; sets the mark.
bool trial_failed(SlotFlash& flash, std::uint8_t slot, const Marks& marks, bool power_on) {
  if (marks.confirmed || marks.trials == 0 || (power_on && marks.trials < most_trials)) return false;
  set(flash, slot, rejected_at, rejected_mark);
  return true;
}

std::uint8_t newest(const std::array<Marks, 2>& marks) {
  return marks[1].complete && (!marks[0].complete || marks[1].sequence > marks[0].sequence) ? 1 : 0;
}

void settle(SlotFlash& flash, std::uint8_t slot, const Marks& marks, const Header& header) {
  set(flash, slot, complete_at, complete_mark);
  if (marks.confirmed) confirm(flash, slot, header.security_version);
}

}  // namespace

Marks read_marks(SlotFlash& flash, std::uint8_t slot) {
  Marks m;
  m.sequence = word_at(flash, slot, sequence_at);
  m.erased = word_at(flash, slot, erased_at) == erased_mark;
  m.complete = word_at(flash, slot, complete_at) == complete_mark;
  m.confirmed = word_at(flash, slot, confirmed_at) == confirmed_mark;
  m.rejected = word_at(flash, slot, rejected_at) == rejected_mark;
  while (m.trials < most_trials && word_at(flash, slot, first_trial_at - 4 * m.trials) == trial_mark) ++m.trials;
  return m;
}

Refusal check_slot(SlotFlash& flash, const Battery& battery, std::uint8_t slot, Header& header, HeaderCheck* check) {
  HeaderBytes bytes{};
  flash.read(slot, 0, bytes);
  if (const Refusal r = check(bytes, battery, slot, header); r != Refusal::none) return r;
  std::array<std::uint8_t, 256> part{};
  for (std::uint32_t block = 0; block < header.blocks(); ++block) {
    Sha256 hash;
    for (std::uint32_t at = 0; at < header.block_size(block);) {
      const auto n = std::min<std::uint32_t>(part.size(), header.block_size(block) - at);
      flash.read(slot, header_bytes + block * block_bytes + at, std::span(part).first(n));
      hash.add(std::span(part).first(n));
      at += n;
    }
    if (hash.finish() != stated_hash(bytes, block)) return Refusal::block_damaged;
  }
  return Refusal::none;
}

Start choose(SlotFlash& flash, const Battery& battery, bool power_on, bool may_try) {
  Start start;
  const std::array<Marks, 2> marks{read_marks(flash, 0), read_marks(flash, 1)};
  const std::uint8_t first = newest(marks);
  for (const std::uint8_t slot : {first, static_cast<std::uint8_t>(1 - first)}) {
    const Marks& m = marks[slot];
    if (!m.complete || (!may_try && !m.confirmed)) continue;
    Refusal refusal = m.usable() ? Refusal::none : Refusal::trial_failed;
    if (m.usable() && trial_failed(flash, slot, m, power_on)) {
      start.returned = true;
      refusal = Refusal::trial_failed;
    }
    if (refusal == Refusal::none) refusal = check_slot(flash, battery, slot, start.header, check_header);
    // a trial that no mark counts would not end
    const bool counted = refusal != Refusal::none || m.confirmed || set_trial(flash, slot, m.trials);
    if (!counted) refusal = Refusal::flash_failed;
    if (refusal == Refusal::none) {
      settle(flash, slot, m, start.header);
      start.trial = !m.confirmed;
      start.slot = slot;
      start.found = true;
      return start;
    }
    if (start.refusal == Refusal::none) start.refusal = refusal;
  }
  return start;
}

Start choose_cell(SlotFlash& cells, const Battery& battery, const Start& application, bool power_on) {
  const Start start = choose(cells, battery, power_on, !application.trial);
  for (const std::uint8_t slot : {std::uint8_t{0}, std::uint8_t{1}}) {
    if (!start.found || slot != start.slot) erase_if_asked(cells, slot);
  }
  return start;
}

bool confirm(SlotFlash& flash, std::uint8_t slot, std::uint32_t security_version) {
  return set(flash, slot, confirmed_at, confirmed_mark) && raise_security_counter(flash, security_version);
}

bool prepare(SlotFlash& flash, std::uint8_t slot) {
  // 0 may be programmed over any word. An erase that is interrupted does not bring back what was cleared before.
  if (!set(flash, slot, complete_at, 0) || !set(flash, slot, erased_at, 0) || !flash.erase(slot)) return false;
  return set(flash, slot, erased_at, erased_mark);
}

bool ask_for_erase(SlotFlash& flash, std::uint8_t slot) {
  return set(flash, slot, complete_at, 0) && set(flash, slot, erased_at, 0) &&
         set(flash, slot, erase_asked_at, erase_asked_mark);
}

bool give_up_damaged(SlotFlash& flash, const Start& started) {
  const std::array<Marks, 2> marks{read_marks(flash, 0), read_marks(flash, 1)};
  const std::uint8_t slot = newest(marks);
  if (!marks[slot].complete || (started.found && started.slot == slot)) return false;
  return ask_for_erase(flash, slot);
}

bool erase_if_asked(SlotFlash& flash, std::uint8_t slot) {
  if (word_at(flash, slot, erase_asked_at) != erase_asked_mark || read_marks(flash, slot).complete) return false;
  prepare(flash, slot);
  return true;
}

bool begin_writing(SlotFlash& flash, std::uint8_t slot) { return set(flash, slot, erased_at, 0); }

bool complete(SlotFlash& flash, std::uint8_t slot) {
  const Marks other = read_marks(flash, static_cast<std::uint8_t>(1 - slot));
  const std::uint32_t sequence = other.complete ? other.sequence + 1 : 1;
  return set(flash, slot, sequence_at, sequence) && set(flash, slot, complete_at, complete_mark);
}

}  // namespace bms::boot
