// The firmware: start what the board has, then sample after sample.
#include "firmware/application.hpp"
#include "firmware/board_cell.hpp"
#include "hal/board_state.hpp"
#include "hal/clock.hpp"
#include "hal/samples.hpp"
#include "hal/supply.hpp"

namespace {

constexpr std::uint32_t watchdog_ms = 2'000;

using TheApplication = bms::firmware::Application<bms::firmware::BoardCell, bms::firmware::BoardVehicleProfile>;
TheApplication* running = nullptr;

}  // namespace

void bms::hal::supply_failing() {
  if (running != nullptr) running->supply_failing();
}

int main() {
  using namespace bms;
  hal::clock_start();
  hal::watchdog_start(watchdog_ms);
  hal::board_start();
  storage::Persistence persistence;
  persistence.start(hal::reset_cause(), hal::last_fault(),
                    hal::calendar_s());  // erases, up to half a second a sector: before anything waits for an answer
  hal::calibrate(stored_calibration(persistence));
  hal::can_start();
  const auto* sample = hal::next_sample();
  if (sample == nullptr) return 0;
  const auto given_start = hal::starting_point();
  static TheApplication application(
      given_start ? given_start : stored_starting_point(persistence, identity().cell_hash), identity(), capacity_ah(),
      persistence);
  running = &application;
  for (; sample != nullptr; sample = hal::next_sample()) application.process_sample(*sample);
  application.shut_down();
  return 0;
}
