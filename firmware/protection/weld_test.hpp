// Which pole of the DC link is closed although its outputs are off, as far as the voltages at both poles prove it.
//
// The voltage of a pole alone proves nothing. A leak from the cells to the frame shifts both floating poles together,
// and while the DC link discharges they move: L+ of an open contactor then passes the voltage of the pack, or stays
// close to it, and L- passes 0. What differs is the resistance behind the voltage: milliohms of a closed contact,
// kiloohms of a leak. Two changes show it, each in readings of the same dividers, so that their gains do not matter:
//
//   while all are open   the DC link discharges. A closed contact holds its pole while the DC link loses half of the
//                        pack's voltage. An open pole moves with it, by a share that is at least that of the dividers
//   by the relay         the precharge relay pulls L+ to the pack. It moves L+ unless L+ was closed before, and L- with
//                        it unless that is closed
//
// A pole has moved when it has by more than 1/256 of the pack, 5 to 13 steps of the boards' converters. A DC link that
// does not discharge proves nothing while all are open; the next start does by its relay.
#pragma once

#include <algorithm>
#include <cstdint>

#include "measurement/sample.hpp"
#include "protection/dc_link.hpp"

namespace bms::protection {

/// While all are open.
class HeldPole {
 public:
  /// all_open: all outputs are off, and the contactors at rest. A missing reading changes nothing but the answer.
  constexpr void update(bool all_open, const DcLink& link) {
    if (!all_open) at_ = Pole::none;
    proven_ = all_open && link.known() && follow(link);
  }
  /// Pole that is closed.
  constexpr Pole pole() const { return proven_ ? at_ : Pole::none; }

 private:
  constexpr bool follow(const DcLink& link) {
    const Pole at = link.closed_pole();
    const std::int32_t held_uv = at == Pole::minus ? link.minus_uv : link.pack_uv - link.plus_uv;
    if (at != at_ || magnitude(held_uv - held_uv_) > link.least_move_uv()) {
      at_ = at;
      held_uv_ = held_uv;
      link_uv_ = link.link_uv();
      discharged_ = false;
    }
    if (at != Pole::plus && at != Pole::minus) return false;
    discharged_ = discharged_ || magnitude(link.link_uv() - link_uv_) >= link.pack_uv / 2;
    return discharged_;
  }

  std::int32_t held_uv_ = 0, link_uv_ = 0;  ///< when the pole was at its contact first
  Pole at_ = Pole::none;
  bool discharged_ = false, proven_ = false;
};

/// Around the closing of the precharge relay, in the first two parts of the self-test. The DC link is known() and the
/// contactors are at rest.
class RelayTest {
 public:
  constexpr void restart() {
    plus_ = minus_ = {};
    at_zero_ = 0;
    found_ = 0;
  }
  constexpr void before(const DcLink& link) {
    plus_.add(link.pack_uv - link.plus_uv);
    minus_.add(link.minus_uv);
    if (link.minus_at_zero()) at_zero_ = 1;
  }
  /// Returns the pole that the relay has not moved. One sample is enough, and the next ones do not change it. A DC link
  /// of less than 6 V shows that the relay has not closed.
  constexpr Pole after(const DcLink& link) {
    const std::int32_t move_uv = link.least_move_uv();
    if (link.plus_at_pack() && plus_.has(link.pack_uv - link.plus_uv, move_uv)) found_ |= 1U;
    if (at_zero_ != 0 && link.minus_at_zero() && minus_.has(link.minus_uv, move_uv) &&
        link.link_uv() > DcLink::decidable_uv)
      found_ |= 2U;
    return static_cast<Pole>(found_);
  }

 private:
  static_assert(static_cast<int>(Pole::plus) == 1 && static_cast<int>(Pole::minus) == 2 &&
                static_cast<int>(Pole::unknown) == 3);

  struct Range {
    std::int32_t least_uv = DcLink::most_uv, most_uv = -DcLink::most_uv;

    constexpr void add(std::int32_t uv) {
      least_uv = std::min(least_uv, uv);
      most_uv = std::max(most_uv, uv);
    }
    constexpr bool has(std::int32_t uv, std::int32_t within_uv) const {
      return uv >= least_uv - within_uv && uv <= most_uv + within_uv;
    }
  };

  Range plus_, minus_;  ///< B+ against L+; L-
  std::uint32_t at_zero_ : 1 = 0, found_ : 2 = 0;
};

}  // namespace bms::protection
