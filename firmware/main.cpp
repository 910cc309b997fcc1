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
  hal::watchdog_start(watchdog_ms);
  storage::Persistence persistence;
  persistence.start(hal::reset_cause(), hal::last_fault(), hal::calendar_s());  // erases, up to half a second a sector: before anything waits for an answer
  hal::can_start();
  const auto* sample = hal::next_sample();
  if (sample == nullptr) return 0;
  const auto told = hal::starting_point();
  static Application<BoardCell, BoardVehicleProfile> application(told ? told : persistence.starting_point(), identity(), capacity_ah(), persistence);
  for (; sample != nullptr; sample = hal::next_sample()) application.take(*sample);
  application.end();
  return 0;
}
