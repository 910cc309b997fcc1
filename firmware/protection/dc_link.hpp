// What the voltages at both poles of the DC link say about the contacts.
//
// Ground is the negative end of the cells. Both poles are measured against it, also while they float. Two equal
// dividers with a bias (boards/stm32f405_forklift/README.md) then hold them around the middle of the DC-link voltage.
//
//   main plus or precharge relay closed   L+ = pack, L- = pack - DC link
//   main minus closed                     L- = 0, L+ = DC link
//   all open                              L+ half of the DC link and 2 V more, if nothing leaks to the frame
//
// L+ = pack: the plus pole may be closed. L- = 0: the minus pole may be closed. A leak to the frame moves open poles,
// too, so one set of readings proves nothing (weld_test.hpp).
//
// `=` is within a sixteenth of the pack for L+ and within 1 V for L-. Dividers of 0.1 % are good to 0.4 V, of 1 % to 2
// V and 0.8 V.
#pragma once

#include <cstdint>

#include "measurement/sample.hpp"
#include "protection/pack_design.hpp"

namespace bms::protection {

enum class Pole : std::uint8_t { none, plus, minus, unknown };

struct DcLink {
  static constexpr std::int32_t zero_uv = 1'000'000, decidable_uv = 6'000'000, most_uv = 200'000'000;

  std::int32_t pack_uv = measurement::no_reading, plus_uv = measurement::no_reading, minus_uv = measurement::no_reading;

  /// False if a reading is missing or impossible. The other functions may then not be called.
  constexpr bool known() const { return pack_uv > 0 && pack_uv <= most_uv && possible(plus_uv) && possible(minus_uv); }
  constexpr std::int32_t link_uv() const { return plus_uv - minus_uv; }
  /// Magnitude of the difference between pack and DC link: across main plus when it closes.
  constexpr std::int32_t gap_uv() const { return magnitude(pack_uv - link_uv()); }
  constexpr bool plus_at_pack() const { return magnitude(plus_uv - pack_uv) <= pack_uv / 16; }
  constexpr bool minus_at_zero() const { return magnitude(minus_uv) <= zero_uv; }

  /// Returns true if a pole is certainly open. Valid while both main contactors are commanded to close: a load or a
  /// stale reading of the pack does not cause such a difference.
  constexpr bool pole_lost() const { return plus_uv < pack_uv / 4 * 3 || magnitude(minus_uv) > pack_uv / 4; }
  /// Returns true if a pole differs from the pack by more than a sixteenth of it.
  constexpr bool pole_differs() const { return !plus_at_pack() || magnitude(minus_uv) > pack_uv / 16; }

 private:
  static constexpr bool possible(std::int32_t uv) { return uv >= -most_uv && uv <= most_uv; }
};

}  // namespace bms::protection
