// Bit timing of ST's bxCAN from its clock, at compile time (RM0090, 32.7.7; CAN_BTR, 32.9.2).
//
//   bit = 1 + ts1 + ts2 quanta, a quantum = brp / clock      sample point after 1 + ts1 quanta
//   brp 1..1024, ts1 1..16, ts2 1..8, sjw 1..4 and never above ts2, 8 to 25 quanta per bit (ISO 11898-1)
//
// bit_timing() accepts only the exact bit rate. It then selects the sample point nearest to 87.5 % (CiA 301, table of
// bit rates), then the most quanta, and the largest jump width. A bit rate that cannot be reached does not compile.
//
// 42 MHz, the clock of the STM32F405 at 168 MHz, gives 125 and 250 kbit/s at exactly 87.5 %. At 500 kbit/s a bit has 84
// cycles, hence 12, 14 or 21 quanta, and the best sample point is 85.7 %. That is outside `near_recommendation` but
// inside `cia301_allows`, which the caller then has to pass.
#pragma once

#include <cstdint>

namespace bms::hal::bxcan {

struct BitTiming {
  std::uint32_t brp = 0;                    ///< prescaler
  std::uint32_t ts1 = 0, ts2 = 0, sjw = 0;  ///< quanta

  constexpr std::uint32_t quanta() const { return 1 + ts1 + ts2; }
  constexpr std::uint32_t sample_point_ppm() const { return (1 + ts1) * 1'000'000 / quanta(); }
  /// Value of CAN_BTR, normal mode.
  constexpr std::uint32_t btr() const { return (sjw - 1) << 24 | (ts2 - 1) << 20 | (ts1 - 1) << 16 | (brp - 1); }
  constexpr bool operator==(const BitTiming&) const = default;
};

struct SamplePointRange {
  std::uint32_t from_ppm, to_ppm;
};
inline constexpr std::uint32_t recommended_ppm = 875'000;
inline constexpr SamplePointRange near_recommendation{recommended_ppm - recommended_ppm / 100,
                                                      recommended_ppm + recommended_ppm / 100};
inline constexpr SamplePointRange cia301_allows{850'000, 900'000};

// Not defined: a call stops the compilation, and the name gives the reason.
void bit_rate_not_supported();
void clock_not_divisible_to_bit_rate();
void no_sample_point_in_accepted_range();

consteval BitTiming bit_timing(std::uint32_t clock_hz, std::uint32_t bits_per_second,
                               SamplePointRange accepted = near_recommendation) {
  if (bits_per_second == 0 || bits_per_second > 1'000'000 || clock_hz == 0) bit_rate_not_supported();
  BitTiming best;
  std::uint32_t least_error = 1'000'000;
  for (std::uint32_t quanta = 25; quanta >= 8; --quanta) {
    const std::uint64_t per_step = std::uint64_t{bits_per_second} * quanta;
    if (clock_hz % per_step != 0 || clock_hz / per_step > 1024) continue;
    for (std::uint32_t ts2 = 1; ts2 <= 8; ++ts2) {
      const std::uint32_t ts1 = quanta - 1 - ts2;
      if (ts1 < 1 || ts1 > 16) continue;
      const BitTiming t{static_cast<std::uint32_t>(clock_hz / per_step), ts1, ts2, ts2 < 4 ? ts2 : 4};
      const std::uint32_t at = t.sample_point_ppm(),
                          error = at > recommended_ppm ? at - recommended_ppm : recommended_ppm - at;
      if (error < least_error) {
        best = t;
        least_error = error;
      }
    }
  }
  if (least_error == 1'000'000) clock_not_divisible_to_bit_rate();
  if (best.sample_point_ppm() < accepted.from_ppm || best.sample_point_ppm() > accepted.to_ppm)
    no_sample_point_in_accepted_range();
  return best;
}

/// Longest recovery after bus-off [us]: 128 sequences of 11 recessive bits (32.7.6). On a full bus there is one at the
/// end of each frame, and a frame has at most 160 bits (extended, 8 bytes, all stuff bits, intermission).
constexpr std::uint32_t longest_recovery_us(std::uint32_t bits_per_second) {
  return static_cast<std::uint32_t>(std::uint64_t{128 * 160} * 1'000'000 / bits_per_second);
}

}  // namespace bms::hal::bxcan
