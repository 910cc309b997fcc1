// The fourth argument of the emulator's command line says why the chip started: "power" or "reset".
#include "hal/start_image.hpp"

#include <array>
#include <cstring>

#include "hal/cortex_m/fault_record.hpp"
#include "hal/cortex_m/jump.hpp"
#include "hal/emulated/semihosting.hpp"

namespace bms::hal {

bool started_by_power() {
  std::array<char, 512> text{};
  std::array<const char*, 4> words{};
  return semihosting::arguments(text, words) == words.size() && std::strcmp(words[3], "power") == 0;
}

void start_image(std::uint32_t vectors) {
  cortex_m::silence_core();
  cortex_m::jump(vectors);
}

void restart() { cortex_m::system_reset(); }

}  // namespace bms::hal
