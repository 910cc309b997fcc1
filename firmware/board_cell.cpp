// Functions of the board other than the estimator step. They are compiled for size, not for speed.
#include "firmware/board_cell.hpp"

#include "firmware/board_design.hpp"

namespace bms::firmware {

void BoardCell::update_condition(estimator::Condition<Estimator>& condition, const Estimator& estimator,
                                 const measurement::Sample& sample, const Estimator::Result& estimate,
                                 bool limits_wanted) {
  condition.update(generated::cell<BoardScalar>, sample, estimate, estimator.state(), limits_wanted);
}

void BoardCell::update_cells(estimator::PackCells<BoardScalar, cells>& differences,
                             const measurement::PackSample<cells>& pack, const Estimator::Result& estimate) {
  differences.update(generated::cell<BoardScalar>, pack, estimate);
}

const model::PlausibleRange& BoardCell::plausible() { return generated::cell<BoardScalar>.plausible; }

const protection::ProtectionPlan& BoardCell::plan() {
  constexpr auto design = board_design();
  static_assert(protection::current_sensor_suffices(design),
                "the current sensor of the board (BMS_CURRENT_RANGE_A) ends below a short circuit of this cell");
  static constexpr auto plan = protection::protection_plan(design);
  static_assert(protection::consistent(plan.rules), "limits of the cell contradict each other");
  return plan;
}

}  // namespace bms::firmware
