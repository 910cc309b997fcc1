#include "tests/firmware/bxcan_model.hpp"

#include <algorithm>
#include <utility>

namespace bms::firmware {

namespace {

constexpr unsigned stuff_error = 1, acknowledge_error = 3, bit_dominant_error = 5, crc_error = 6;  // CAN_ESR, LEC
constexpr unsigned error_frame_bits = 6 + 8 + 3,
                   suspend_bits = 8;  // flag, delimiter, intermission; ISO 11898-1, 10.4.4 and 10.9

can::Frame to_can_frame(const WireFrame& f) { return {f.id, f.length, f.data, f.extended}; }

/// The lower value wins: identifier, RTR and IDE in the order of the bits.
std::uint64_t arbitration_field(const WireFrame& f) {
  if (!f.extended) return static_cast<std::uint64_t>(f.id) << 21 | (f.remote ? 1ULL << 20 : 0);
  return static_cast<std::uint64_t>(f.id >> 18) << 21 | 3ULL << 19 | static_cast<std::uint64_t>(f.id & 0x3FFFF) << 1 |
         (f.remote ? 1 : 0);
}

}  // namespace

WireFrame wire_frame(const can::Frame& frame) { return {frame.id, frame.long_id, false, frame.length, frame.data}; }

unsigned bits_on_the_wire(const WireFrame& f) {
  std::vector<int> bits;
  const auto put = [&](std::uint64_t value, int count) {
    for (int k = count - 1; k >= 0; --k) bits.push_back(static_cast<int>(value >> k & 1));
  };
  put(0, 1);
  if (f.extended) {
    put(f.id >> 18, 11);
    put(3, 2);
    put(f.id & 0x3FFFF, 18);
  } else {
    put(f.id, 11);
  }
  put(f.remote ? 1 : 0, 1);
  put(0, 2);
  put(f.length, 4);
  for (unsigned k = 0; !f.remote && k < std::min<unsigned>(f.length, 8); ++k) put(f.data[k], 8);
  unsigned crc = 0;  // x^15 + x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1
  for (const int b : bits) crc = ((crc << 1) ^ ((static_cast<unsigned>(b) ^ (crc >> 14)) & 1 ? 0x4599U : 0U)) & 0x7FFF;
  put(crc, 15);
  unsigned stuffed = 0, run = 0;
  int last = -1;
  for (const int b : bits) {
    run = b == last ? run + 1 : 1;
    last = b;
    if (run < 5) continue;
    ++stuffed;
    last = 1 - b;
    run = 1;
  }
  return static_cast<unsigned>(bits.size()) + stuffed + 1 + 2 + 7 +
         3;  // CRC delimiter, acknowledge, end of frame, intermission
}

void BxcanModel::reset() {
  mode_ = Mode::sleep;
  mcr_ = 0x00010002;
  ier_ = 0;
  btr_ = 0x01230000;
  mailboxes_ = {};
  fifo_.clear();
  overrun_ = full_ = bus_off_ = recovering_ = false;
  tec_ = rec_ = lec_ = 0;
  sending_ = -1;
}

bool BxcanModel::timing_fits(std::uint32_t clock_hz) const {
  const std::uint64_t quanta = 3 + (btr_ >> 16 & 15) + (btr_ >> 20 & 7);
  return static_cast<std::uint64_t>(bits_per_second) * quanta * ((btr_ & 1023) + 1) == clock_hz;
}

std::uint32_t BxcanModel::mailbox_status() const {
  std::uint32_t status = 0;
  int lowest = -1;
  for (std::uint32_t k = 0; k < 3; ++k) {
    const Mailbox& m = mailboxes_[k];
    status |=
        ((m.completed ? 1U : 0U) | (m.ok ? 2U : 0U) | (m.lost ? 4U : 0U) | (m.error ? 8U : 0U) | (m.abort ? 0x80U : 0U))
        << (8 * k);
    if (!m.requested) {
      status |= 1U << (26 + k);
      if (lowest < 0) lowest = static_cast<int>(k);
    }
  }
  return status | static_cast<std::uint32_t>(std::max(lowest, 0)) << 24;
}

std::uint32_t BxcanModel::read(std::uint32_t at) const {
  switch (at) {
    case 0x00:
      return mcr_;
    case 0x04:
      return (mode_ == Mode::initialisation || mode_ == Mode::joining ? 1U : 0U) | (mode_ == Mode::sleep ? 2U : 0U) |
             (sending_ >= 0 ? 1U << 8 : 0U) | (stuck_dominant ? 0U : 3U << 10);
    case 0x08:
      return mailbox_status();
    case 0x0C:
      return static_cast<std::uint32_t>(fifo_.size()) | (full_ ? 8U : 0U) | (overrun_ ? 16U : 0U);
    case 0x10:
      return 0;
    case 0x14:
      return ier_;
    case 0x18:
      return (tec_ >= 96 || rec_ >= 96 ? 1U : 0U) | (tec_ >= 128 || rec_ >= 128 ? 2U : 0U) | (bus_off_ ? 4U : 0U) |
             lec_ << 4 | std::min(tec_, 255U) << 16 | std::min(rec_, 255U) << 24;
    case 0x1C:
      return btr_;
    case 0x200:
      return fmr_;
    case 0x204:
      return fm1r_;
    case 0x20C:
      return fs1r_;
    case 0x214:
      return ffa1r_;
    case 0x21C:
      return fa1r_;
    default:
      break;
  }
  if (at >= 0x180 && at < 0x1B0) {
    const Mailbox& m = mailboxes_[(at - 0x180) / 16];
    const std::array<std::uint32_t, 4> words{m.tir | (m.requested ? 1U : 0U), m.tdtr, m.tdlr, m.tdhr};
    return words[at / 4 % 4];
  }
  if (at >= 0x1B0 && at < 0x1C0) {
    if (fifo_.empty()) return 0;
    const Received& r = fifo_.front();
    const std::array<std::uint32_t, 4> words{r.rir, r.rdtr, r.rdlr, r.rdhr};
    return words[at / 4 % 4];
  }
  if (at >= 0x240 && at < 0x240 + 4 * banks_.size()) return banks_[(at - 0x240) / 4];
  return 0;
}

void BxcanModel::write(std::uint32_t at, std::uint32_t value) {
  const bool filters_open = (fmr_ & 1) != 0;
  switch (at) {
    case 0x00:
      return write_mcr(value);
    case 0x08:
      return write_tsr(value);
    case 0x0C:
      if ((value & 16) != 0) overrun_ = false;
      if ((value & 8) != 0) full_ = false;
      if ((value & 32) == 0 || fifo_.empty()) return;
      fifo_.pop_front();
      full_ = false;
      return;
    case 0x14:
      ier_ = value;
      return;
    case 0x18:
      lec_ = value >> 4 & 7;
      return;
    case 0x1C:
      if (mode_ != Mode::initialisation)
        violations.push_back("CAN_BTR is written outside initialisation");
      else
        btr_ = value;
      return;
    case 0x200:
      fmr_ = value;
      return;
    case 0x204:
    case 0x20C:
    case 0x214:
      if (!filters_open) violations.push_back("filters are set up without FINIT");
      if (at == 0x204) fm1r_ = value;
      if (at == 0x20C) fs1r_ = value;
      if (at == 0x214) ffa1r_ = value;
      return;
    case 0x21C:
      fa1r_ = value;
      return;
    default:
      break;
  }
  if (at >= 0x180 && at < 0x1B0) return write_mailbox((at - 0x180) / 16, at / 4 % 4, value);
  if (at >= 0x240 && at < 0x240 + 4 * banks_.size()) {
    const std::size_t word = (at - 0x240) / 4;
    if ((fa1r_ >> (word / 2) & 1) != 0 && !filters_open) violations.push_back("a filter is written while active");
    banks_[word] = value;
  }
}

void BxcanModel::write_mcr(std::uint32_t value) {
  if ((value & 1U << 15) != 0) return reset();
  mcr_ = value;
  const bool initialise = (value & 1) != 0, sleep = (value & 2) != 0;
  // from normal mode the hardware first waits for the end of the current frame (32.4.1): bit()
  if (initialise && !sleep && (mode_ == Mode::sleep || mode_ == Mode::joining || bus_off_))
    mode_ = Mode::initialisation;
  if (!initialise && !sleep && mode_ == Mode::initialisation) {
    mode_ = Mode::joining;
    recessive_run_ = 0;
    if (bus_off_) {
      recovering_ = true;
      sequences_ = 0;
    }
  }
}

void BxcanModel::write_tsr(std::uint32_t value) {
  for (std::uint32_t k = 0; k < 3; ++k) {
    Mailbox& m = mailboxes_[k];
    if ((value >> (8 * k) & 1) != 0) m.completed = m.ok = m.lost = m.error = false;
    if ((value >> (8 * k) & 0x80) == 0 || !m.requested) continue;
    m.abort = true;
    if (sending_ != static_cast<int>(k)) complete(m, false);
  }
}

/// A failed attempt is the last one if an abort was requested, or without automatic retransmission (NART).
void BxcanModel::given_up(Mailbox& m) {
  if (m.abort || (mcr_ & 16) != 0) complete(m, false);
}

void BxcanModel::complete(Mailbox& m, bool ok) {
  if (!ok) ++aborts;
  m.requested = m.abort = false;
  m.completed = true;
  m.ok = ok;
}

void BxcanModel::write_mailbox(std::size_t box, unsigned word, std::uint32_t value) {
  Mailbox& m = mailboxes_[box];
  if (m.requested) {
    violations.push_back("transmit mailbox " + std::to_string(box) + " is written while it is pending");
    return;
  }
  if (word == 1) m.tdtr = value;
  if (word == 2) m.tdlr = value;
  if (word == 3) m.tdhr = value;
  if (word != 0) return;
  m.tir = value & ~1U;
  if ((value & 1) == 0) return;
  m.requested = true;
  m.completed = m.ok = m.lost = m.error = false;
  m.order = orders_++;
}

bool BxcanModel::transmit_interrupt() const {
  return (ier_ & 1) != 0 && (mailboxes_[0].completed || mailboxes_[1].completed || mailboxes_[2].completed);
}
bool BxcanModel::receive_interrupt() const {
  return ((ier_ & 2) != 0 && !fifo_.empty()) || ((ier_ & 4) != 0 && full_) || ((ier_ & 8) != 0 && overrun_);
}

/// 32.7.1: by identifier, then by mailbox; with TXFP by the order of requests.
int BxcanModel::scheduled() const {
  int best = -1;
  const auto key = [&](std::size_t k) -> std::uint64_t {
    return (mcr_ & 4) != 0 ? mailboxes_[k].order : mailboxes_[k].tir >> 3;
  };
  for (std::size_t k = 0; k < 3; ++k) {
    if (mailboxes_[k].requested && (best < 0 || key(k) < key(static_cast<std::size_t>(best))))
      best = static_cast<int>(k);
  }
  return best;
}

void BxcanModel::bit(std::uint32_t clock_hz) {
  ++now_bit;
  clock_hz_ = clock_hz;
  if (stuck_dominant) return dominant_bit();
  was_stuck_ = false;
  dominant_run_ = 0;
  if (busy_bits_ > 0) {
    recessive_run_ = 0;
    if (--busy_bits_ == 0) end_frame();
    return;
  }
  recessive_bit();
}

std::uint64_t BxcanModel::quiet_bits() const {
  constexpr std::uint64_t long_time = 1U << 20;
  if (stuck_dominant || was_stuck_) return 0;
  if (busy_bits_ > 0) return busy_bits_ - 1;
  const bool changes = mode_ == Mode::joining || recovering_ || suspended_bits_ > 0 || (mcr_ & 3) == 1;
  return changes || !others.empty() || (on_the_bus() && scheduled() >= 0) ? 0 : long_time;
}

void BxcanModel::pass_quiet(std::uint64_t count) {
  if (count == 0) return;
  now_bit += count;
  dominant_run_ = 0;
  if (busy_bits_ > 0) {
    busy_bits_ -= static_cast<unsigned>(count);
    recessive_run_ = 0;
  } else {
    recessive_run_ += static_cast<unsigned>(count);
  }
}

void BxcanModel::recessive_bit() {
  ++recessive_run_;
  if ((mcr_ & 3) == 1 && mode_ == Mode::normal) mode_ = Mode::initialisation;
  if (mode_ == Mode::joining && recessive_run_ >= 11) mode_ = Mode::normal;
  if (recovering_ && mode_ == Mode::normal && recessive_run_ % 11 == 0 && ++sequences_ >= 128) {
    bus_off_ = recovering_ = false;
    tec_ = rec_ = 0;
    back_at_bit = now_bit;
  }
  if (suspended_bits_ > 0) --suspended_bits_;
  start_frame();
}

std::deque<BxcanModel::Other>::iterator BxcanModel::most_urgent_other() {
  auto best = others.end();
  bool one_in_front = false;
  for (auto o = others.begin(); o != others.end(); ++o) {
    if (o->in_order && std::exchange(one_in_front, true)) continue;
    if (o->from_bit <= now_bit &&
        (best == others.end() || arbitration_field(o->frame) < arbitration_field(best->frame)))
      best = o;
  }
  return best;
}

void BxcanModel::start_frame() {
  const int box = on_the_bus() && suspended_bits_ == 0 ? scheduled() : -1;
  const auto other = most_urgent_other();
  if (box < 0 && other == others.end()) return;
  begun_bit_ = now_bit;
  outcome_ = 0;
  WireFrame ours{};
  if (box >= 0) {
    const Mailbox& m = mailboxes_[static_cast<std::size_t>(box)];
    ours = {(m.tir & 4) != 0 ? m.tir >> 3 : m.tir >> 21,
            (m.tir & 4) != 0,
            (m.tir & 2) != 0,
            static_cast<std::uint8_t>(m.tdtr & 15),
            {}};
    for (unsigned k = 0; k < 8; ++k)
      ours.data[k] = static_cast<std::uint8_t>((k < 4 ? m.tdlr : m.tdhr) >> (8 * (k % 4)));
  }
  const bool board_wins =
      box >= 0 && (other == others.end() || arbitration_field(ours) < arbitration_field(other->frame));
  if (board_wins) {
    sending_ = box;
    other_ = {ours};
    busy_bits_ = bits_on_the_wire(ours);
    if (!timing_fits(clock_hz_)) {
      outcome_ = bit_dominant_error;
      busy_bits_ = 20 + error_frame_bits;
    } else if (corrupt_sent > 0) {
      --corrupt_sent;
      outcome_ = bit_dominant_error;
      busy_bits_ = 40 + error_frame_bits;
    } else if (!others_acknowledge) {
      outcome_ = acknowledge_error;
      busy_bits_ += error_frame_bits - 11;
    }
    return;
  }
  if (box >= 0) {
    mailboxes_[static_cast<std::size_t>(box)].lost = true;
    ++arbitrations_lost;
    given_up(mailboxes_[static_cast<std::size_t>(box)]);
  }
  other_sends_ = true;
  other_ = *other;
  others.erase(other);
  busy_bits_ = bits_on_the_wire(other_.frame);
  if (mode_ == Mode::normal && !timing_fits(clock_hz_)) {
    outcome_ = stuff_error;
    busy_bits_ = 20 + error_frame_bits;
  } else if (corrupt_received > 0) {
    --corrupt_received;
    outcome_ = crc_error;
    busy_bits_ += error_frame_bits - 11;
  }
}

void BxcanModel::end_frame() {
  recessive_run_ = 10;  // acknowledge delimiter, end of frame, intermission; the next bit makes eleven
  if (sending_ >= 0) {
    Mailbox& m = mailboxes_[static_cast<std::size_t>(sending_)];
    sending_ = -1;
    if (outcome_ != 0) {
      m.error = true;
      transmit_error(outcome_, outcome_ != acknowledge_error || tec_ < 128);
      given_up(m);
      return;
    }
    complete(m, true);
    if (tec_ > 0) --tec_;
    lec_ = 0;
    if (tec_ >= 128) suspended_bits_ = suspend_bits;
    seen.push_back({to_can_frame(other_.frame), true, begun_bit_, now_bit});
    return;
  }
  if (!other_sends_) return;
  other_sends_ = false;
  if (outcome_ != 0) {
    if (on_the_bus()) {
      lec_ = outcome_;
      ++rec_;
    }
    others.push_front(other_);  // its sender repeats it
    return;
  }
  seen.push_back({to_can_frame(other_.frame), false, begun_bit_, now_bit});
  if (!on_the_bus()) return;
  lec_ = 0;
  if (rec_ > 127)
    rec_ = 120;
  else if (rec_ > 0)
    --rec_;
  if (accepted(other_.frame)) receive(other_.frame);
}

void BxcanModel::transmit_error(unsigned code, bool counts) {
  ++attempts_failed;
  lec_ = code;
  if (counts) tec_ += 8;
  if (tec_ >= 128) suspended_bits_ = suspend_bits;
  if (tec_ <= 255 || bus_off_) return;
  bus_off_ = true;
  ++times_off;
  off_since_bit = now_bit;
  if ((mcr_ & 64) != 0) {  // ABOM
    recovering_ = true;
    sequences_ = 0;
  }
}

/// The wire is held low. A sender detects it at once, a receiver by the missing stuff bit. After that every eight bits
/// count as an error (ISO 11898-1, 12.1.4).
void BxcanModel::dominant_bit() {
  recessive_run_ = 0;
  ++dominant_run_;
  if (!was_stuck_) {
    was_stuck_ = true;
    stuck_sender_ = sending_ >= 0;
    busy_bits_ = 0;
    if (other_sends_) others.push_front(other_);
    other_sends_ = false;
    const int box = sending_;
    sending_ = -1;
    if (!on_the_bus()) return;
    if (box >= 0) {
      Mailbox& m = mailboxes_[static_cast<std::size_t>(box)];
      m.error = true;
      transmit_error(bit_dominant_error, true);
      given_up(m);
    } else {
      ++rec_;
      lec_ = stuff_error;
    }
    return;
  }
  if (!on_the_bus() || dominant_run_ < 14 || dominant_run_ % 8 != 0) return;
  if (stuck_sender_)
    transmit_error(bit_dominant_error, true);
  else
    rec_ = std::min(rec_ + 8, 255U);
}

void BxcanModel::receive(const WireFrame& f) {
  const auto word = [&](unsigned from) {
    std::uint32_t w = 0;
    for (unsigned k = 0; k < 4; ++k) w |= static_cast<std::uint32_t>(f.data[from + k]) << (8 * k);
    return w;
  };
  const std::uint32_t rir = (f.extended ? f.id << 3 | 4U : f.id << 21) | (f.remote ? 2U : 0U);
  const Received r{rir, f.length, word(0), word(4)};
  if (fifo_.size() == 3) {
    overrun_ = true;
    if ((mcr_ & 8) == 0) fifo_.back() = r;
    return;
  }
  fifo_.push_back(r);
  full_ = fifo_.size() == 3;
}

/// Acceptance filters, 32.7.4, figure 342. Active only outside FINIT.
bool BxcanModel::accepted(const WireFrame& f) const {
  const BxcanModel& filters = filters_of != nullptr ? *filters_of : *this;
  if ((filters.fmr_ & 1) != 0) return false;
  const std::uint32_t base_id = f.extended ? f.id >> 18 : f.id;
  const std::uint32_t wide = base_id << 21 | (f.extended ? (f.id & 0x3FFFF) << 3 | 4U : 0U) | (f.remote ? 2U : 0U);
  const std::uint32_t narrow = base_id << 5 | (f.remote ? 16U : 0U) | (f.extended ? 8U | (f.id >> 15 & 7) : 0U);
  const std::uint32_t first_of_can2 = filters.fmr_ >> 8 & 63;  // CAN2SB
  const std::uint32_t from = filters_of != nullptr ? first_of_can2 : 0, to = filters_of != nullptr ? 28 : first_of_can2;
  for (std::uint32_t k = from; k < to; ++k) {
    if ((filters.fa1r_ >> k & 1) == 0 || (filters.ffa1r_ >> k & 1) != 0) continue;
    const bool list = (filters.fm1r_ >> k & 1) != 0, single = (filters.fs1r_ >> k & 1) != 0;
    const std::uint32_t a = filters.banks_[2 * k], b = filters.banks_[2 * k + 1];
    if (single && (list ? wide == (a & ~1U) || wide == (b & ~1U) : (wide & b & ~1U) == (a & b & ~1U))) return true;
    if (single) continue;
    for (const std::uint32_t pair : {a, b}) {
      const std::uint32_t low = pair & 0xFFFF, high = pair >> 16;
      if (list ? narrow == low || narrow == high : (narrow & high) == (low & high)) return true;
    }
  }
  return false;
}

}  // namespace bms::firmware
