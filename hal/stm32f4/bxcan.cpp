// CAN1 on PB8 (RX) and PB9 (TX), alternate function 9 (datasheet, table 9). Registers: RM0090, 32.9.
//
// An image with two buses has this file twice: with BMS_CHARGER_BUS or BMS_GROUP_BUS it is CAN2 on PB12 (RX) and PB13
// (TX), and the functions are those of hal/charger_bus.hpp or hal/group_bus.hpp. Nothing is common but the filters.
//
// Transmission: three mailboxes, which the controller sends by identifier (TXFP = 0), and a queue of 32 frames in the
// same order. If a more urgent frame finds all mailboxes taken, the least urgent one is aborted and returns to the
// queue. Two frames with the same identifier are never in mailboxes together, because the controller would send them by
// mailbox number instead of age.
// Reception: filters for accepted_ids() (11 bits) and long_ids (29 bits), a FIFO of three, an interrupt, a ring of 64.
//
// Going on the bus (32.4) and recovery after bus-off (32.7.6) are phases that service() checks. Each has a timeout
// after which it is tried again later; no function waits in a loop for the bus.
//   bus-off         drops the waiting frames. After a rest of 100 ms the controller starts its recovery, which takes
//                   128 times 11 recessive bits. The rest doubles each time up to 1.6 s; a sent frame resets it to 100
//                   ms.
//   no progress     frames wait and none was sent for 100 ms (no acknowledge, stuck wire, full bus): drops the waiting
//                   frames. can_listening() is false for a second or until a frame arrives; then sending starts again.
//   no idle bus     100 ms after the request (longer below 250 kbit/s, where a recovery on a full bus needs it): counts
//                   a failed start and tries again after the rest
//   no crystal      never on the bus: the internal oscillator errs by up to 8 % (datasheet, HSI), a bit allows 0.5 %
#include <algorithm>
#include <array>
#include <atomic>
#include <span>
#include <utility>

#include "hal/bxcan/transmit_queue.hpp"
#include "hal/can.hpp"
#include "hal/can_suspend.hpp"
#include "hal/clock.hpp"
#include "hal/stm32f4/can_controller.hpp"
#include "hal/stm32f4/clock_tree.hpp"

namespace bms::hal {

namespace {

using namespace stm32f4;

const Rate* chosen_rate = &rates[0];
const Rate& timing() { return rates.size() == 1 ? rates[0] : *chosen_rate; }
IdentifiersOfBus identifiers{settings_of_bus};

constexpr std::uint64_t no_progress_us = 100'000, pause_us = 1'000'000;
constexpr std::uint32_t first_rest_us = 100'000, longest_rest_us = 1'600'000;

// ---- transmission: shared with the interrupt ----

struct Mailbox {
  bxcan::WaitingFrame waiting;
  bool taken = false, unwanted = false;
};
std::array<Mailbox, 3> mailboxes;
bxcan::TransmitQueue<queue_frames> queue;
std::uint32_t next_number = 0;
std::atomic<std::uint32_t> sent{0}, dropped{0};

void count(std::atomic<std::uint32_t>& counter, std::uint32_t more = 1) {
  counter.store(counter.load(std::memory_order_relaxed) + more, std::memory_order_relaxed);
}

/// Disables the transmit interrupt while an object exists.
class TransmitInterruptLock {
 public:
  TransmitInterruptLock() {
    nvic_icer<tx_interrupt>() = bit_of(tx_interrupt);
    asm volatile("dsb\n isb" ::: "memory");
  }
  ~TransmitInterruptLock() {
    asm volatile("" ::: "memory");
    nvic_iser<tx_interrupt>() = bit_of(tx_interrupt);
  }
  TransmitInterruptLock(const TransmitInterruptLock&) = delete;
  TransmitInterruptLock& operator=(const TransmitInterruptLock&) = delete;
};

void take_back_finished() {
  for (std::uint32_t k = 0; k < mailboxes.size(); ++k) {
    const std::uint32_t status = can_tsr();
    if ((status & finished(k)) == 0) continue;
    can_tsr() = finished(k);
    Mailbox& box = mailboxes[k];
    if (!box.taken) continue;
    if ((status & succeeded(k)) != 0)
      count(sent);
    else if (box.unwanted || !queue.insert(box.waiting))
      count(dropped);
    box.taken = box.unwanted = false;
  }
}

bool in_a_mailbox(const can::Frame& frame) {
  for (const Mailbox& box : mailboxes) {
    if (box.taken && bxcan::arbitration(box.waiting.frame) == bxcan::arbitration(frame)) return true;
  }
  return false;
}

void load(std::uint32_t k, const bxcan::WaitingFrame& waiting) {
  mailboxes[k] = {waiting, true, false};
  CanMailbox& box = can_transmit_mailbox(k);
  const can::Frame& frame = waiting.frame;
  box.length_and_time = frame.length < 8 ? frame.length : 8;
  box.data_low = get_bytes<std::uint32_t>(frame.data, 0);
  box.data_high = get_bytes<std::uint32_t>(frame.data, 4);
  box.identifier = (frame.long_id ? frame.id << 3 | extended : frame.id << 21) | transmit_request;
}

/// Call when all mailboxes are taken. If the least urgent frame in them is less urgent than `waiting`, aborts it: at
/// once, or after its transmission has failed.
void make_room_for(const bxcan::WaitingFrame& waiting) {
  std::uint32_t least = 0;
  for (std::uint32_t k = 1; k < mailboxes.size(); ++k) {
    if (bxcan::arbitration(mailboxes[k].waiting.frame) > bxcan::arbitration(mailboxes[least].waiting.frame)) least = k;
  }
  if (bxcan::arbitration(mailboxes[least].waiting.frame) <= bxcan::arbitration(waiting.frame)) return;
  can_tsr() = abort_request(least);
}

void refill() {
  take_back_finished();
  const auto not_in_mailbox = [](const bxcan::WaitingFrame& w) { return !in_a_mailbox(w.frame); };
  for (std::uint32_t k = 0; k < mailboxes.size(); ++k) {
    bxcan::WaitingFrame next;
    if (mailboxes[k].taken) continue;
    if (!queue.pop(next, not_in_mailbox)) return;
    load(k, next);
  }
  if (const bxcan::WaitingFrame* next = queue.most_urgent(not_in_mailbox)) make_room_for(*next);
}

void drop_waiting_frames() {
  const TransmitInterruptLock lock;
  count(dropped, static_cast<std::uint32_t>(queue.size()));
  queue.clear();
  for (std::uint32_t k = 0; k < mailboxes.size(); ++k) {
    if (!mailboxes[k].taken) continue;
    mailboxes[k].unwanted = true;
    can_tsr() = abort_request(k);
  }
}

bool frames_waiting() {
  const TransmitInterruptLock lock;
  return queue.size() > 0 || mailboxes[0].taken || mailboxes[1].taken || mailboxes[2].taken;
}

// ---- reception: one writer (the interrupt), one reader ----

std::array<can::Frame, ring_frames> ring;
std::atomic<std::uint32_t> received{0}, taken{0}, lost{0}, overruns{0};

// ---- state of the bus ----

enum class Phase : std::uint8_t { off, resting, entering, joining, on };
Phase phase = Phase::off;
std::uint64_t phase_since_us = 0, progress_us = 0, paused_since_us = 0, active_us = 0;
std::uint32_t rest_us = first_rest_us, bus_offs = 0, failed_starts = 0, seen_sent = 0, seen_received = 0;
bool paused = false, suspended = false;
[[maybe_unused]] bool filters_set = false;

void enter(Phase next) {
  phase = next;
  phase_since_us = now_us();
}

/// Of two buses those of this one, and once: FINIT stops the reception of both.
void set_filters() {
  if (has_second_bus && std::exchange(filters_set, true)) return;
  can_fmr() = can_fmr() | 1U;
  const auto accepted = ids_of_bus();
  std::array<std::uint16_t, bxcan::max_ids> on_the_bus;
  for (std::size_t k = 0; k < accepted.size(); ++k) on_the_bus[k] = identifiers.on_the_bus(accepted[k]);
  const auto ids = std::span<const std::uint16_t>(on_the_bus).first(accepted.size());
  const std::size_t banks = bxcan::bank_count(ids);
  const std::uint32_t lists = (1U << banks) - 1, masks = ((1U << long_ids_of_bus.size()) - 1) << banks;
  set_own_banks(can_fa1r(), 0);
  set_own_banks(can_fs1r(), masks);  // 32 bits; the others 16
  set_own_banks(can_fm1r(), lists);
  set_own_banks(can_ffa1r(), 0);  // FIFO 0
  const auto set = [](std::size_t k, const bxcan::FilterBank& bank) {
    can_filter_bank(first_bank + static_cast<std::uint32_t>(k)).fr1 = bank.fr1;
    can_filter_bank(first_bank + static_cast<std::uint32_t>(k)).fr2 = bank.fr2;
  };
  for (std::size_t k = 0; k < banks; ++k) set(k, bxcan::filter_bank(ids, k));
  for (std::size_t k = 0; k < long_ids_of_bus.size(); ++k)
    set(banks + k, bxcan::long_filter_bank(long_ids_of_bus[k].id, long_ids_of_bus[k].mask));
  set_own_banks(can_fa1r(), lists | masks);
  can_fmr() = can_fmr() & ~1U;
}

void configure() {
  can_mcr() = mcr_inrq | mcr_rflm;  // a full FIFO discards new frames instead of old ones
  can_btr() = timing().btr;
  set_filters();
  can_ier() = ier_tme | ier_fmp0 | ier_fov0;
}

void ask_for_initialisation() {
  can_mcr() = mcr_inrq | mcr_rflm;  // also leaves sleep mode
  enter(Phase::entering);
}

/// The phase took too long.
void abandon_phase() {
  ++failed_starts;
  if (phase == Phase::entering) {
    const TransmitInterruptLock lock;
    can_mcr() = mcr_reset;
    for (Mailbox& box : mailboxes) count(dropped, box.taken ? 1 : 0);
    mailboxes = {};
  } else {
    can_mcr() = mcr_inrq | mcr_rflm;
  }
  enter(Phase::resting);
}

void watch_transmission() {
  const std::uint32_t out = sent.load(std::memory_order_relaxed), in = received.load(std::memory_order_relaxed);
  const std::uint64_t now = now_us();
  if (out != seen_sent) rest_us = first_rest_us;
  if (out != seen_sent || in != seen_received) active_us = now;
  if (paused && (in != seen_received || now - paused_since_us >= pause_us)) {
    paused = false;
    progress_us = now;
  }
  if (out != seen_sent || !frames_waiting()) progress_us = now;
  seen_sent = out;
  seen_received = in;
  if (paused || now - progress_us < no_progress_us) return;
  paused = true;
  paused_since_us = now;
  drop_waiting_frames();
}

void service() {
  const std::uint64_t elapsed = now_us() - phase_since_us;
  const bool initialising = (can_msr() & msr_inak) != 0, bus_off = (can_esr() & esr_bus_off) != 0;
  switch (phase) {
    case Phase::off:
      return;
    case Phase::resting:
      if (elapsed < rest_us) return;
      rest_us = rest_us < longest_rest_us ? 2 * rest_us : longest_rest_us;
      return ask_for_initialisation();
    case Phase::entering:
      if (!initialising) {
        if (elapsed >= timing().phase_timeout_us) abandon_phase();
        return;
      }
      configure();
      can_mcr() = mcr_rflm;
      return enter(Phase::joining);
    case Phase::joining:
      if (!initialising && !bus_off) {
        paused = std::exchange(suspended, false);
        paused_since_us = progress_us = now_us();
        return enter(Phase::on);
      }
      if (elapsed >= timing().phase_timeout_us) abandon_phase();
      return;
    case Phase::on:
      if (!bus_off) return watch_transmission();
      ++bus_offs;
      drop_waiting_frames();
      return enter(Phase::resting);
  }
}

[[gnu::always_inline]] inline bool quiet(std::uint64_t quiet_us) {
  return phase == Phase::on && paused && now_us() - active_us >= quiet_us;
}

bool on_the_bus() { return phase == Phase::on && (can_esr() & esr_bus_off) == 0; }

}  // namespace

void BMS_OF_BUS(can_start)(const CanSettings& settings) {
  identifiers = IdentifiersOfBus(settings);
  for (const Rate& r : rates) {
    if (r.bit_rate == settings.bit_rate) chosen_rate = &r;
  }
  if (clocks().core_hz != crystal_core_hz) return;
  rcc_ahb1enr() = rcc_ahb1enr() | 1U << 1;
  rcc_apb1enr() = rcc_apb1enr() | can_clocks;
  gpiob_pupdr() = (gpiob_pupdr() & ~(3U << two_pins)) | 1U << two_pins;  // recessive if there is no transceiver
  gpiob_afrh() = (gpiob_afrh() & ~(255U << four_bits)) | 0x99U << four_bits;
  gpiob_moder() = (gpiob_moder() & ~(15U << two_pins)) | 10U << two_pins;
  nvic_priority(tx_interrupt) = communication_priority;
  nvic_priority(rx0_interrupt) = communication_priority;
  enable_interrupts();
  ask_for_initialisation();
}

bool BMS_OF_BUS(can_listening)() {
  service();
  return on_the_bus() && !paused;
}

bool BMS_OF_BUS(can_quiet)(std::uint64_t quiet_us) { return quiet(quiet_us); }
bool BMS_OF_BUS(can_suspend)(std::uint64_t quiet_us) {
  if (!quiet(quiet_us)) return false;
  ask_for_initialisation();
  suspended = true;
  while ((can_msr() & msr_inak) == 0 && now_us() - phase_since_us < 50) continue;
  const bool idle = (can_msr() & msr_inak) != 0;
  if (!idle) BMS_OF_BUS(can_active)();  // a frame is on the wire
  return idle;
}

void BMS_OF_BUS(can_active)() { active_us = now_us(); }

bool BMS_OF_BUS(can_send)(const can::Frame& frame) {
  const TransmitInterruptLock lock;
  if (!on_the_bus() || paused) {
    count(dropped);
    return false;
  }
  const bool kept = queue.insert({identifiers.on_the_bus(frame), next_number++});
  if (!kept) count(dropped);
  refill();
  return kept;
}

bool BMS_OF_BUS(can_receive)(can::Frame& frame) {
  service();
  for (std::uint32_t at = taken.load(std::memory_order_relaxed); at != received.load(std::memory_order_acquire);) {
    frame = ring[at % ring.size()];
    taken.store(++at, std::memory_order_release);
    if (identifiers.from_the_bus(frame)) return true;
  }
  return false;
}

CanHealth BMS_OF_BUS(can_health)() {
  const std::uint32_t esr = can_esr();
  const auto state = [&] {
    if ((esr & esr_bus_off) != 0) return CanState::bus_off;
    if (phase != Phase::on) return CanState::starting;
    if ((esr & esr_passive) != 0) return CanState::passive;
    return (esr & esr_warning) != 0 ? CanState::warning : CanState::active;
  };
  return {.state = state(),
          .transmit_errors = static_cast<std::uint8_t>(esr >> 16),
          .receive_errors = static_cast<std::uint8_t>(esr >> 24),
          .sent = sent,
          .received = received,
          .dropped = dropped,
          .lost = lost,
          .overruns = overruns,
          .bus_offs = bus_offs,
          .failed_starts = failed_starts};
}

}  // namespace bms::hal

extern "C" void BMS_INTERRUPT_OF_BUS(tx_interrupt)() { bms::hal::refill(); }

extern "C" void BMS_INTERRUPT_OF_BUS(rx0_interrupt)() {
  using namespace bms::hal;
  const std::uint32_t status = stm32f4::can_rf0r();
  if ((status & rf_overrun) != 0) {
    stm32f4::can_rf0r() = rf_overrun;
    count(overruns);
  }
  if ((status & rf_pending) == 0) return;
  const stm32f4::CanMailbox& box = stm32f4::can_receive_fifo_0();
  const std::uint32_t length = box.length_and_time & 15U;
  const bool is_long = (box.identifier & extended) != 0;
  bms::can::Frame frame{is_long ? box.identifier >> 3 : box.identifier >> 21,
                        static_cast<std::uint8_t>(length < 8 ? length : 8),
                        {},
                        is_long};
  put_bytes<std::uint32_t>(frame.data, 0, box.data_low);
  put_bytes<std::uint32_t>(frame.data, 4, box.data_high);
  stm32f4::can_rf0r() = rf_release;
  for (int patience = 0; patience < 16 && (stm32f4::can_rf0r() & rf_release) != 0; ++patience) {
  }
  const std::uint32_t at = received.load(std::memory_order_relaxed);
  if (at - taken.load(std::memory_order_acquire) == ring.size()) {
    count(lost);
    return;
  }
  ring[at % ring.size()] = frame;
  received.store(at + 1, std::memory_order_release);
}
