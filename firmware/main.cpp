// The firmware: start what the board has, then sample after sample.
#include "firmware/application.hpp"
#include "firmware/board_cell.hpp"
#include "hal/clock.hpp"
#include "hal/samples.hpp"

namespace {

constexpr std::uint32_t watchdog_ms = 2'000;

}  // namespace

int main() {
  using namespace bms;
  hal::clock_start();
  hal::can_start();
  hal::watchdog_start(watchdog_ms);
  const auto* sample = hal::next_sample();
  if (sample == nullptr) return 0;
  static Application<BoardCell> application(hal::starting_point(), identity(), capacity_ah());
  for (; sample != nullptr; sample = hal::next_sample()) application.take(*sample);
  return 0;
}
