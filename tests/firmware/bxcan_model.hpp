// Register model of ST's bxCAN on a bus with other nodes. Written only from RM0090, 32, and ISO 11898-1; it shares no
// code with hal/.
//
// Time counts in bits of the bus. Frames are whole: their length is exact (CRC and stuff bits are computed),
// arbitration is decided at their start, errors occur within them. The test controls the other nodes: what they send,
// whether they acknowledge, which errors occur. `violations` lists driver errors: a write to a pending mailbox, to the
// bit timing on the bus, or to an active filter.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <string>
#include <vector>

#include "hal/can.hpp"

namespace bms::firmware {

/// A frame on the wire, also with 29 bits or as a remote request.
struct WireFrame {
  std::uint32_t id = 0;
  bool extended = false, remote = false;
  std::uint8_t length = 0;
  std::array<std::uint8_t, 8> data{};
};
WireFrame wire_frame(const can::Frame& frame);

/// Bits from the start of frame to the end of the intermission, with the stuff bits that its content needs.
unsigned bits_on_the_wire(const WireFrame& frame);

struct SeenFrame {
  can::Frame frame;
  bool from_board = false;
  std::uint64_t begin_bit = 0, end_bit = 0;
};

class BxcanModel {
 public:
  static constexpr std::uint32_t base = 0x40006400;

  /// offset from `base`.
  std::uint32_t read(std::uint32_t offset) const;
  void write(std::uint32_t offset, std::uint32_t value);
  /// One bit time of the wire passes. clock_hz: of the peripheral.
  void bit(std::uint32_t clock_hz);

  /// Number of bits from now on in which nothing changes but counters: the rest of a frame, or an idle bus.
  std::uint64_t quiet_bits() const;
  /// As many calls of bit(). count: at most quiet_bits()
  void pass_quiet(std::uint64_t count);

  bool transmit_interrupt() const;
  bool receive_interrupt() const;

  /// CAN2 has no filters of its own: those of CAN1 from the bank that CAN2SB names. nullptr: this is CAN1.
  const BxcanModel* filters_of = nullptr;

  // the wire and the other nodes
  std::uint32_t bits_per_second = 250'000;
  bool others_acknowledge = true;
  bool stuck_dominant = false;
  unsigned corrupt_sent = 0;      ///< number of the board's next attempts that fail
  unsigned corrupt_received = 0;  ///< number of the other nodes' next frames that fail
  struct Other {
    WireFrame frame;
    std::uint64_t from_bit = 0;  ///< earliest time
    bool in_order = false;       ///< sent after earlier frames that have this set, too (FIFO of one node)
  };
  std::deque<Other> others;
  /// Puts a frame into the receive FIFO without the bus.
  void deliver(const can::Frame& frame) { receive(wire_frame(frame)); }

  // what a test checks
  std::uint64_t now_bit = 0;
  std::vector<SeenFrame> seen;
  std::vector<std::string> violations;
  unsigned arbitrations_lost = 0, attempts_failed = 0, aborts = 0, times_off = 0;
  std::uint64_t off_since_bit = 0, back_at_bit = 0;
  unsigned transmit_errors() const { return tec_; }
  unsigned receive_errors() const { return rec_; }
  bool bus_off() const { return bus_off_; }
  bool wire_busy() const { return busy_bits_ > 0 || stuck_dominant; }
  bool on_the_bus() const { return mode_ == Mode::normal && !bus_off_; }

 private:
  enum class Mode { sleep, initialisation, joining, normal };
  struct Mailbox {
    std::uint32_t tir = 0, tdtr = 0, tdlr = 0, tdhr = 0;
    bool requested = false, abort = false, completed = false, ok = false, lost = false, error = false;
    std::uint64_t order = 0;
  };
  struct Received {
    std::uint32_t rir, rdtr, rdlr, rdhr;
  };

  void reset();
  void write_mcr(std::uint32_t value);
  void write_tsr(std::uint32_t value);
  void write_mailbox(std::size_t box, unsigned word, std::uint32_t value);
  void complete(Mailbox& box, bool ok);
  void given_up(Mailbox& box);
  std::uint32_t mailbox_status() const;
  int scheduled() const;
  std::deque<Other>::iterator most_urgent_other();
  void start_frame();
  void end_frame();
  void dominant_bit();
  void recessive_bit();
  void transmit_error(unsigned code, bool counts);
  void receive(const WireFrame& frame);
  bool accepted(const WireFrame& frame) const;
  bool timing_fits(std::uint32_t clock_hz) const;

  Mode mode_ = Mode::sleep;
  std::uint32_t mcr_ = 0x00010002, ier_ = 0, btr_ = 0x01230000, fmr_ = 0x2A1C0E01, fm1r_ = 0, fs1r_ = 0, ffa1r_ = 0,
                fa1r_ = 0;
  std::array<std::uint32_t, 56> banks_{};
  std::array<Mailbox, 3> mailboxes_{};
  std::deque<Received> fifo_;
  bool overrun_ = false, full_ = false, bus_off_ = false, recovering_ = false, was_stuck_ = false,
       stuck_sender_ = false;
  unsigned tec_ = 0, rec_ = 0, lec_ = 0;
  unsigned recessive_run_ = 0, dominant_run_ = 0, sequences_ = 0;
  std::uint64_t orders_ = 0;

  // the frame that is on the wire
  unsigned busy_bits_ = 0, suspended_bits_ = 0;
  int sending_ = -1;  ///< mailbox
  bool other_sends_ = false;
  Other other_{};
  std::uint64_t begun_bit_ = 0;
  unsigned outcome_ = 0;  ///< 0: arrives; otherwise the last error code
  std::uint32_t clock_hz_ = 0;
};

}  // namespace bms::firmware
