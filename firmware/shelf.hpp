// When a battery that nobody uses switches itself off, so that no cell is damaged on a shelf: the lowest cell has
// rested below the release of *cell undervoltage* for a minute, with open contactors, no request, no charger and a
// silent bus. A cell that rests there is empty; what the battery needs when it is off is less than what cells lose by
// themselves (boards/stm32f405_forklift/README.md).
//
// A workshop's command (ship mode) does the same two seconds later, on any bus and with any voltage. Both wait until
// the truck's DC link is empty, because the BQ76952 would not enter SHUTDOWN before.
//
// The driver's key or the charger's plug switches it on again. While its supply does not fall, the minute begins again.
//
// Only in a build with BMS_SWITCHES_OFF, because it takes a wiring that no firmware can check: without REG1 of the
// front end in the supply the core starts again and goes on without readings, and without TS2 at key and plug nothing
// ends SHUTDOWN. Key, plug and bus are read again right before the command. What comes in the microseconds after that
// reading holds the BQ76952 on, with its outputs off; then chip and core are reset (hal/sleep.hpp).
#pragma once

#include <cstdint>
#include <utility>

#include "measurement/sample.hpp"

namespace bms::firmware {

class Shelf {
 public:
  static constexpr std::uint64_t low_for_us = 60'000'000;

  static constexpr std::uint64_t answer_us = 2'000'000;  ///< of the command

  /// The battery is to be switched off, unless it is used before. Returns false if it is used now.
  [[nodiscard]] constexpr bool ship() {
    if (used_) return false;
    shipping_ = true;
    counting_ = false;
    return true;
  }

  /// Returns true if the battery is to be switched off now. used: anything but rest with open contactors; silent: the
  /// bus; ready: hal::load_side_discharged().
  constexpr bool update(std::int32_t lowest_cell_uv, std::int32_t empty_uv, bool used, bool silent, bool ready,
                        std::uint64_t now_us) {
    used_ = used;
    shipping_ = shipping_ && !used;
    const bool low = !used && silent && lowest_cell_uv != measurement::no_reading && lowest_cell_uv < empty_uv;
    if (!counting_) since_us_ = now_us;
    counting_ = low || shipping_;
    if (!counting_ || !ready || now_us - since_us_ < (shipping_ ? answer_us : low_for_us)) return false;
    commanded_ = std::exchange(shipping_, false);
    since_us_ = now_us;
    return true;
  }

  /// The last update() that returned true did so for the command.
  [[nodiscard]] constexpr bool commanded() const { return commanded_; }

 private:
  std::uint64_t since_us_ = 0;
  bool counting_ = false, shipping_ = false, used_ = true, commanded_ = false;
};

}  // namespace bms::firmware
