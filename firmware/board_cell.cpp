// Functions of the board other than the estimator step. They are compiled for size, not for speed.
#include "firmware/board_cell.hpp"

#include "estimator/open_circuit_voltage.hpp"

#include "firmware/board_pack.hpp"
#include "firmware/board_tables.hpp"
#include "firmware/pulse_model.hpp"

namespace bms::firmware {

// hal/ has it from board_config.hpp, protection/ from a definition for all sources (cmake/firmware.cmake).
static_assert(
    protection::with_group == hal::has_group_bus &&
        protection::with_group == protection::HasGroupIncomplete<protection::ExternalInputs>,
    "fault and parameters of a group are in an image exactly if it has a bus between batteries (BMS_PARALLEL)");

void BoardCell::update_condition(estimator::Condition<Estimator>& condition, const Estimator& estimator,
                                 const measurement::Sample& sample, const Estimator::Result& estimate,
                                 bool limits_wanted) {
  condition.update(tables(), sample, estimate, estimator, limits_wanted);
}

void BoardCell::update_cells(estimator::PackCells<BoardScalar, cells>& differences,
                             const measurement::PackSample<cells>& pack, const Estimator::Result& estimate) {
  differences.update(tables(), pack, estimate);
}

std::int32_t BoardCell::open_circuit_uv(const Estimator& estimator, const measurement::Sample& mean,
                                        const Estimator::Result& estimate) {
  // Else the estimator takes the drop of an aged battery for a lower charge (firmware/parallel/README.md).
  static_assert(
      !hal::has_group_bus || generated::parameters.tolerance.resistance_fraction >= 0.5,
      "batteries of a group (BMS_PARALLEL) have up to twice the resistance of the cell file: cell_header needs "
      "`aged`");
  if constexpr (hal::has_group_bus) {
    const std::int32_t uv = estimator::open_circuit_uv(tables(), mean, estimate, estimator);
    if (uv != measurement::no_reading) return static_cast<std::int32_t>(cells) * uv;
  }
  return measurement::no_reading;
}

PulseModel BoardCell::pulse_model(const Estimator& estimator, const Snapshot<Estimator, cells>& now) {
  if constexpr (std::is_same_v<Pulses, PulsePublisher>) {
    static BoardTables with_limits_of_pulses = tables();  // too large for the stack
    with_limits_of_pulses = tables();
    return firmware::pulse_model(with_limits_of_pulses, estimator, now);
  }
  return {};
}

const model::PlausibleRange& BoardCell::plausible() { return tables().plausible; }

const protection::ProtectionPlan& BoardCell::plan() {
  static_assert(!hal::truck_stated || possible_truck(board_pack),
                "BMS_PRECHARGE_S, BMS_CLOSING_A or BMS_CLOSING_OHM is out of range");
  static_assert(protection::current_sensor_suffices(board_pack),
                "the current sensor of the board (BMS_CURRENT_RANGE_A) ends below a short circuit of this cell");
  static constexpr auto plan = protection::protection_plan(board_pack);
  static_assert(protection::consistent(plan.rules), "limits of the cell contradict each other");
  return active_plan_or<BoardCell>(plan);
}

}  // namespace bms::firmware
