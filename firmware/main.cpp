// Entry point of the firmware: starts the hardware, restores the stored state, then processes sample after sample.
#include "firmware/application.hpp"
#include "firmware/board_cell.hpp"
#include "hal/board_state.hpp"
#include "hal/charger_bus.hpp"
#include "hal/clock.hpp"
#include "hal/group_bus.hpp"
#include "hal/retained.hpp"
#include "hal/samples.hpp"
#include "hal/supply.hpp"

namespace {

constexpr std::uint32_t watchdog_ms = 2'000;

using bms::firmware::BoardCell;

template <class Board>
bms::hal::SensorCalibration start_parameters(bms::storage::Persistence& persistence) {
  const bms::hal::SensorCalibration stored = bms::firmware::stored_calibration(persistence);
  if constexpr (requires { Board::parameters(); }) {
    Board::parameters().start(persistence);
    Board::apply_parameters();
    return bms::firmware::limited(bms::firmware::with_shunt(stored, Board::parameters()));
  }
  return stored;
}

template <class Board>
bms::hal::CanSettings can_settings() {
  if constexpr (requires { Board::parameters(); }) {
    using bms::parameters::Parameter;
    const auto& active = Board::parameters().active();
    const auto id = [&](Parameter p) { return static_cast<std::uint16_t>(at(active, p)); };
    return {1'000 * static_cast<std::uint32_t>(at(active, Parameter::can_bit_rate)), id(Parameter::can_base),
            id(Parameter::can_stop)};
  }
  return bms::hal::can_settings_of_build;
}

/// On both buses. Each battery of a group has identifiers of its own on the one of the truck.
template <class Board>
void start_buses() {
  using namespace bms;
  if constexpr (hal::has_group_bus) {
    hal::CanSettings settings = can_settings<Board>();
    const std::int32_t node = at(Board::parameters().active(), parameters::Parameter::group_node);
    settings.base = static_cast<std::uint16_t>(parameters::base_of(settings.base, node));
    hal::can_start(settings);
    hal::group_can_start();
  } else {
    hal::can_start(can_settings<Board>());
    if constexpr (hal::has_charger_bus) hal::charger_can_start();
  }
}

template <class Board>
void start_updates(bms::storage::Persistence& persistence) {
  if constexpr (requires { Board::update(); }) {
    Board::update().start(persistence.events().starts, persistence.charge().operating_s);
    if (Board::update().returned())
      persistence.fault(bms::can::StoredFault::code_new_image_not_confirmed, bms::hal::calendar_s());
    if (Board::update().cell_damaged()) {
      persistence.fault(bms::can::Faults::first_cause_storage_fault, bms::hal::calendar_s());
      Board::update().give_up_damaged_cell();
    }
  }
}

using BoardApplication = bms::firmware::Application<BoardCell, bms::firmware::BoardVehicleProfile>;
BoardApplication* running = nullptr;

}  // namespace

void bms::hal::supply_failing() {
  if (running != nullptr) running->supply_failing();
}

int main() {
  using namespace bms;
  using namespace bms::firmware;
  hal::clock_start();
  hal::watchdog_start(watchdog_ms);
  hal::board_start();
  storage::Persistence persistence;
  // may erase, up to half a second per sector; so it comes before anything that must answer in time
  persistence.start(hal::reset_cause(), hal::last_fault(), hal::calendar_s(), hal::retained_ram());
  hal::calibrate(start_parameters<BoardCell>(persistence));
  start_buses<BoardCell>();
  start_updates<BoardCell>(persistence);
  const auto* sample = hal::next_sample();
  if (sample == nullptr) return 0;
  const auto given_start = hal::starting_point();
  static BoardApplication application(
      given_start ? given_start
                  : stored_starting_point(persistence, hash_of_stored_data<BoardCell>(identity().cell_hash)),
      identity(), capacity_ah(), persistence);
  running = &application;
  for (; sample != nullptr; sample = hal::next_sample()) application.process_sample(*sample, hal::acquisition_us());
  application.shut_down();
  return 0;
}
