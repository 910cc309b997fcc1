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

#include <cstdint>

#include "measurement/sample.hpp"
#include "protection/dc_link.hpp"

namespace bms::protection {

class WeldTest {
 public:
  /// With every new state of the contactors, and with the self-test.
  constexpr void restart() {
    held_ = 0;
    gap_uv_ = minus_uv_ = 0;  // else the walk over all states would count each by what no longer matters
  }
  /// at_rest: main plus and main minus are off, and the contactors at rest. relay: the precharge relay is closed. A
  /// missing reading changes nothing but the answer.
  constexpr void update(bool at_rest, bool relay, const DcLink& link) {
    proven_ = at_rest && link.known() ? unmoved(relay, link) : 0;
  }
  /// Pole that is closed. Unknown: at least one.
  constexpr Pole pole() const { return static_cast<Pole>(proven_); }

 private:
  static_assert(static_cast<int>(Pole::plus) == 1 && static_cast<int>(Pole::minus) == 2 &&
                static_cast<int>(Pole::unknown) == 3);
  static constexpr unsigned poles(bool plus, bool minus) { return (plus ? 1U : 0U) | (minus ? 2U : 0U); }

  constexpr unsigned unmoved(bool relay, const DcLink& link) {
    const std::int32_t gap_uv = link.pack_uv - link.plus_uv, gap_moved_uv = gap_uv - gap_uv_,
                       minus_moved_uv = link.minus_uv - minus_uv_, least_uv = link.pack_uv >> 8;
    const unsigned same = held_ & poles(magnitude(gap_moved_uv) <= least_uv, magnitude(minus_moved_uv) <= least_uv);
    if (relay) {
      // of an empty DC link L- is near 0 if the relay is open
      return link.link_uv() > DcLink::decidable_uv ? same : same & 1U;
    }
    if (same == 0) {
      gap_uv_ = gap_uv;
      minus_uv_ = link.minus_uv;
      held_ = poles(link.plus_at_pack(), link.minus_at_zero());
    }
    return magnitude(gap_moved_uv + minus_moved_uv) >= link.pack_uv >> 1 ? same : 0;
  }

  std::int32_t gap_uv_ = 0, minus_uv_ = 0;  ///< B+ against L+, and L-, when a pole was at its contact first
  unsigned held_ = 0, proven_ = 0;          ///< poles: at their contacts then, closed
};

}  // namespace bms::protection
