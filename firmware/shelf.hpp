// When a battery that nobody uses switches itself off, so that no cell is damaged on a shelf: the lowest cell has
// rested below the release of *cell undervoltage* for a minute, with open contactors, no request, no charger and a
// silent bus. A cell that rests there is empty; what the battery needs when it is off is less than what cells lose by
// themselves (boards/stm32f405_forklift/README.md).
//
// The driver's key or the charger's plug switches it on again. Unless it is charged, the minute begins again.
#pragma once

#include <cstdint>

#include "measurement/sample.hpp"

namespace bms::firmware {

class Shelf {
 public:
  static constexpr std::uint64_t low_for_us = 60'000'000;

  /// Returns true if the battery is to be switched off now. unused: as above, but for the voltage.
  constexpr bool update(std::int32_t lowest_cell_uv, std::int32_t empty_uv, bool unused, std::uint64_t now_us) {
    const bool low = unused && lowest_cell_uv != measurement::no_reading && lowest_cell_uv < empty_uv;
    if (!low || !counting_) since_us_ = now_us;
    counting_ = low;
    return low && now_us - since_us_ >= low_for_us;
  }

 private:
  std::uint64_t since_us_ = 0;
  bool counting_ = false;
};

}  // namespace bms::firmware
