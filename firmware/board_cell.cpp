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
  static constexpr auto plan = protection::protection_plan(board_design());
  return plan;
}

}  // namespace bms::firmware
