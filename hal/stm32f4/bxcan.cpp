// CAN1 on PB8 (RX) and PB9 (TX), alternate function 9 (datasheet, table 9). Registers: RM0090, 32.9.
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

#include "hal/accepted_frames.hpp"
#include "hal/bxcan/bit_timing.hpp"
#include "hal/bxcan/filter_banks.hpp"
#include "hal/bxcan/transmit_queue.hpp"
#include "hal/can.hpp"
#include "hal/can_suspend.hpp"
#include "hal/clock.hpp"
#include "hal/stm32f4/clock_tree.hpp"
#include "hal/stm32f4/registers.hpp"
#include "hal/update_frames.hpp"

namespace bms::hal {

namespace {

using namespace stm32f4;

static_assert(bxcan::fits(with_updates(request_ids), long_ids.size()) &&
                  bxcan::fits(with_updates(request_and_sample_ids), long_ids.size()),
              "too many identifiers for the acceptance filters of CAN1");

struct Rate {
  std::uint32_t bit_rate, btr, phase_timeout_us;
};
/// At 500 and 1,000 kbit/s the sample point is 85.7 %, the nearest one to 87.5 % that the clock allows.
consteval Rate rate(std::uint32_t bit_rate) {
  const std::uint32_t recovery_us = bxcan::longest_recovery_us(bit_rate), margin_us = recovery_us / 5;
  return {bit_rate, bxcan::bit_timing(crystal_apb1_hz, bit_rate, bxcan::cia301_allows).btr(),
          std::max<std::uint32_t>(100'000, recovery_us + margin_us)};
}
/// That of the build first: it is used if the settings have another one that is not here.
constexpr std::array rates{rate(can_bit_rate), rate(125'000), rate(250'000), rate(500'000), rate(1'000'000)};
const Rate* timing = &rates[0];
Identifiers identifiers{can_settings_of_build};

constexpr std::uint64_t no_progress_us = 100'000, pause_us = 1'000'000;
constexpr std::uint32_t first_rest_us = 100'000, longest_rest_us = 1'600'000;

constexpr std::uint32_t mcr_inrq = 1U << 0, mcr_rflm = 1U << 3, mcr_reset = 1U << 15, msr_inak = 1U << 0;
constexpr std::uint32_t rf_pending = 3U, rf_overrun = 1U << 4, rf_release = 1U << 5;
constexpr std::uint32_t ier_tme = 1U << 0, ier_fmp0 = 1U << 1, ier_fov0 = 1U << 3;
constexpr std::uint32_t esr_warning = 1U << 0, esr_passive = 1U << 1, esr_bus_off = 1U << 2;
constexpr std::uint32_t transmit_request = 1U, extended = 4U;
constexpr std::uint32_t finished(std::uint32_t box) { return 1U << (8 * box); }
constexpr std::uint32_t succeeded(std::uint32_t box) { return 2U << (8 * box); }
constexpr std::uint32_t abort_request(std::uint32_t box) { return 0x80U << (8 * box); }

// ---- transmission: shared with the interrupt ----

struct Mailbox {
  bxcan::WaitingFrame waiting;
  bool taken = false, unwanted = false;
};
std::array<Mailbox, 3> mailboxes;
bxcan::TransmitQueue<32> queue;
std::uint32_t next_number = 0;
std::atomic<std::uint32_t> sent{0}, dropped{0};

void count(std::atomic<std::uint32_t>& counter, std::uint32_t more = 1) {
  counter.store(counter.load(std::memory_order_relaxed) + more, std::memory_order_relaxed);
}

/// Disables the transmit interrupt while an object exists.
class TransmitInterruptLock {
 public:
  TransmitInterruptLock() {
    nvic_icer0() = 1U << can1_tx_interrupt;
    asm volatile("dsb\n isb" ::: "memory");
  }
  ~TransmitInterruptLock() {
    asm volatile("" ::: "memory");
    nvic_iser0() = 1U << can1_tx_interrupt;
  }
  TransmitInterruptLock(const TransmitInterruptLock&) = delete;
  TransmitInterruptLock& operator=(const TransmitInterruptLock&) = delete;
};

void take_back_finished() {
  for (std::uint32_t k = 0; k < mailboxes.size(); ++k) {
    const std::uint32_t status = can1_tsr();
    if ((status & finished(k)) == 0) continue;
    can1_tsr() = finished(k);
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
  CanMailbox& box = can1_transmit_mailbox(k);
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
  can1_tsr() = abort_request(least);
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
    can1_tsr() = abort_request(k);
  }
}

bool frames_waiting() {
  const TransmitInterruptLock lock;
  return queue.size() > 0 || mailboxes[0].taken || mailboxes[1].taken || mailboxes[2].taken;
}

// ---- reception: one writer (the interrupt), one reader ----

std::array<can::Frame, 64> ring;
std::atomic<std::uint32_t> received{0}, taken{0}, lost{0}, overruns{0};

// ---- state of the bus ----

enum class Phase : std::uint8_t { off, resting, entering, joining, on };
Phase phase = Phase::off;
std::uint64_t phase_since_us = 0, progress_us = 0, paused_since_us = 0, active_us = 0;
std::uint32_t rest_us = first_rest_us, bus_offs = 0, failed_starts = 0, seen_sent = 0, seen_received = 0;
bool paused = false, suspended = false;

void enter(Phase next) {
  phase = next;
  phase_since_us = now_us();
}

void configure() {
  can1_mcr() = mcr_inrq | mcr_rflm;  // a full FIFO discards new frames instead of old ones
  can1_btr() = timing->btr;
  can1_fmr() = can1_fmr() | 1U;
  const auto accepted = accepted_ids();
  std::array<std::uint16_t, bxcan::max_ids> on_the_bus;
  for (std::size_t k = 0; k < accepted.size(); ++k) on_the_bus[k] = identifiers.on_the_bus(accepted[k]);
  const auto ids = std::span<const std::uint16_t>(on_the_bus).first(accepted.size());
  const std::size_t banks = bxcan::bank_count(ids);
  const std::uint32_t lists = (1U << banks) - 1, masks = ((1U << long_ids.size()) - 1) << banks;
  can1_fa1r() = 0;
  can1_fs1r() = masks;  // 32 bits; the others 16
  can1_fm1r() = lists;
  can1_ffa1r() = 0;  // FIFO 0
  const auto set = [](std::size_t k, const bxcan::FilterBank& bank) {
    can1_filter_bank(static_cast<std::uint32_t>(k)).fr1 = bank.fr1;
    can1_filter_bank(static_cast<std::uint32_t>(k)).fr2 = bank.fr2;
  };
  for (std::size_t k = 0; k < banks; ++k) set(k, bxcan::filter_bank(ids, k));
  for (std::size_t k = 0; k < long_ids.size(); ++k)
    set(banks + k, bxcan::long_filter_bank(long_ids[k].id, long_ids[k].mask));
  can1_fa1r() = lists | masks;
  can1_fmr() = can1_fmr() & ~1U;
  can1_ier() = ier_tme | ier_fmp0 | ier_fov0;
}

void ask_for_initialisation() {
  can1_mcr() = mcr_inrq | mcr_rflm;  // also leaves sleep mode
  enter(Phase::entering);
}

/// The phase took too long.
void abandon_phase() {
  ++failed_starts;
  if (phase == Phase::entering) {
    const TransmitInterruptLock lock;
    can1_mcr() = mcr_reset;
    for (Mailbox& box : mailboxes) count(dropped, box.taken ? 1 : 0);
    mailboxes = {};
  } else {
    can1_mcr() = mcr_inrq | mcr_rflm;
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
  const bool initialising = (can1_msr() & msr_inak) != 0, bus_off = (can1_esr() & esr_bus_off) != 0;
  switch (phase) {
    case Phase::off:
      return;
    case Phase::resting:
      if (elapsed < rest_us) return;
      rest_us = rest_us < longest_rest_us ? 2 * rest_us : longest_rest_us;
      return ask_for_initialisation();
    case Phase::entering:
      if (!initialising) {
        if (elapsed >= timing->phase_timeout_us) abandon_phase();
        return;
      }
      configure();
      can1_mcr() = mcr_rflm;
      return enter(Phase::joining);
    case Phase::joining:
      if (!initialising && !bus_off) {
        paused = std::exchange(suspended, false);
        paused_since_us = progress_us = now_us();
        return enter(Phase::on);
      }
      if (elapsed >= timing->phase_timeout_us) abandon_phase();
      return;
    case Phase::on:
      if (!bus_off) return watch_transmission();
      ++bus_offs;
      drop_waiting_frames();
      return enter(Phase::resting);
  }
}

bool on_the_bus() { return phase == Phase::on && (can1_esr() & esr_bus_off) == 0; }

}  // namespace

void can_start(const CanSettings& settings) {
  identifiers = Identifiers(settings);
  for (const Rate& r : rates) {
    if (r.bit_rate == settings.bit_rate) timing = &r;
  }
  if (clocks().core_hz != crystal_core_hz) return;
  rcc_ahb1enr() = rcc_ahb1enr() | 1U << 1;
  rcc_apb1enr() = rcc_apb1enr() | 1U << 25;
  gpiob_pupdr() = (gpiob_pupdr() & ~(3U << 16)) | 1U << 16;  // recessive if there is no transceiver
  gpiob_afrh() = (gpiob_afrh() & ~255U) | 0x99U;
  gpiob_moder() = (gpiob_moder() & ~(15U << 16)) | 10U << 16;
  nvic_priority(can1_tx_interrupt) = communication_priority;
  nvic_priority(can1_rx0_interrupt) = communication_priority;
  nvic_iser0() = 1U << can1_tx_interrupt | 1U << can1_rx0_interrupt;
  ask_for_initialisation();
}

bool can_listening() {
  service();
  return on_the_bus() && !paused;
}

bool can_suspend(std::uint64_t quiet_us) {
  if (phase != Phase::on || !paused || now_us() - active_us < quiet_us) return false;
  ask_for_initialisation();
  suspended = true;
  while ((can1_msr() & msr_inak) == 0 && now_us() - phase_since_us < 50) continue;
  const bool idle = (can1_msr() & msr_inak) != 0;
  if (!idle) can_active();  // a frame is on the wire
  return idle;
}

void can_active() { active_us = now_us(); }

bool can_send(const can::Frame& frame) {
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

bool can_receive(can::Frame& frame) {
  service();
  for (std::uint32_t at = taken.load(std::memory_order_relaxed); at != received.load(std::memory_order_acquire);) {
    frame = ring[at % ring.size()];
    taken.store(++at, std::memory_order_release);
    if (identifiers.from_the_bus(frame)) return true;
  }
  return false;
}

CanHealth can_health() {
  const std::uint32_t esr = can1_esr();
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

extern "C" void can1_tx_interrupt() { bms::hal::refill(); }

extern "C" void can1_rx0_interrupt() {
  using namespace bms::hal;
  const std::uint32_t status = stm32f4::can1_rf0r();
  if ((status & rf_overrun) != 0) {
    stm32f4::can1_rf0r() = rf_overrun;
    count(overruns);
  }
  if ((status & rf_pending) == 0) return;
  const stm32f4::CanMailbox& box = stm32f4::can1_receive_fifo_0();
  const std::uint32_t length = box.length_and_time & 15U;
  const bool is_long = (box.identifier & extended) != 0;
  bms::can::Frame frame{is_long ? box.identifier >> 3 : box.identifier >> 21,
                        static_cast<std::uint8_t>(length < 8 ? length : 8),
                        {},
                        is_long};
  put_bytes<std::uint32_t>(frame.data, 0, box.data_low);
  put_bytes<std::uint32_t>(frame.data, 4, box.data_high);
  stm32f4::can1_rf0r() = rf_release;
  for (int patience = 0; patience < 16 && (stm32f4::can1_rf0r() & rf_release) != 0; ++patience) {
  }
  const std::uint32_t at = received.load(std::memory_order_relaxed);
  if (at - taken.load(std::memory_order_acquire) == ring.size()) {
    count(lost);
    return;
  }
  ring[at % ring.size()] = frame;
  received.store(at + 1, std::memory_order_release);
}
