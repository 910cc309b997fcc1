// Compares the clock of a chip with that of this core: the seconds of its charge counter against now_us().
//
// A chip whose clock is wrong still answers, but its delays and the means of its current have other lengths than its
// settings say. Its oscillator may be off by 4 % (to be verified on silicon), and its seconds begin at an unknown
// phase. So the clock is wrong as soon as the two differ by more than 5 % and 1.3 s: one that stands still after 1.4 s,
// one that is 10 % wrong within a window of 60 s. It is right again after a whole window without that.
#pragma once

#include <cstdint>

namespace bms::hal::bq76952 {

class ChipClock {
 public:
  static constexpr std::int64_t window_us = 60'000'000, phase_us = 1'300'000, share = 20;

  /// Call with each sample of a chip that measures.
  constexpr void update(std::uint64_t time_us, std::uint32_t chip_s) {
    if (!running_ || chip_s < first_s_) {
      begin(time_us, chip_s);
      return;
    }
    const auto core_us = static_cast<std::int64_t>(time_us - since_us_);
    const std::int64_t off_us = std::int64_t{1'000'000} * (chip_s - first_s_) - core_us;
    const bool off = (off_us < 0 ? -off_us : off_us) > phase_us + core_us / share;
    if (!off && core_us < window_us) return;
    wrong_ = off;
    begin(time_us, chip_s);
  }
  /// Call if the chip does not measure: its counter may begin again. The verdict stays.
  constexpr void pause() { running_ = false; }
  constexpr bool wrong() const { return wrong_; }

 private:
  constexpr void begin(std::uint64_t time_us, std::uint32_t chip_s) {
    running_ = true;
    since_us_ = time_us;
    first_s_ = chip_s;
  }

  std::uint64_t since_us_ = 0;
  std::uint32_t first_s_ = 0;
  bool running_ = false, wrong_ = false;
};

}  // namespace bms::hal::bq76952
