// When a battery that nobody uses switches itself off, so that no cell is damaged on a shelf: the lowest cell has
// rested below the release of *cell undervoltage* for a minute, with open contactors, no request, no charger and a
// silent bus. A cell that rests there is empty; what the battery needs when it is off is less than what cells lose by
// themselves (boards/stm32f405_forklift/README.md).
//
// A workshop's command (ship mode) does the same two seconds later, on any bus and with any voltage.
//
// The driver's key or the charger's plug switches it on again. Unless it is charged, the minute begins again.
#pragma once

#include <cstdint>

#include "measurement/sample.hpp"

namespace bms::firmware {

class Shelf {
 public:
  static constexpr std::uint64_t low_for_us = 60'000'000;

  static constexpr std::uint64_t answer_us = 2'000'000;  ///< of the command

  /// The battery is to be switched off, unless it is used before.
  constexpr void ship() {
    shipping_ = true;
    counting_ = false;
  }

  /// Returns true if the battery is to be switched off now. used: a contactor, a request, a charger or the key; silent:
  /// the bus.
  constexpr bool update(std::int32_t lowest_cell_uv, std::int32_t empty_uv, bool used, bool silent,
                        std::uint64_t now_us) {
    shipping_ = shipping_ && !used;
    const bool low = !used && silent && lowest_cell_uv != measurement::no_reading && lowest_cell_uv < empty_uv;
    if (!counting_) since_us_ = now_us;
    counting_ = low || shipping_;
    if (!counting_ || now_us - since_us_ < (shipping_ ? answer_us : low_for_us)) return false;
    shipping_ = false;
    return true;
  }

 private:
  std::uint64_t since_us_ = 0;
  bool counting_ = false, shipping_ = false;
};

}  // namespace bms::firmware
