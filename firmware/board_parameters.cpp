#include "firmware/board_parameters.hpp"

#include "firmware/board_pack.hpp"

namespace bms::firmware {

namespace {

constexpr parameters::BuildDefaults build{
    .bit_rate_kbit_s = hal::can_bit_rate / 1'000,
    .can_base = hal::can_base,
    .can_stop = hal::can_stop,
    .canopen_node = hal::canopen_node,
    .canopen_charger = hal::canopen_charger,
    .shunt_nohm = 100'000,
    .inputs_fitted = parameters::auxiliary_contacts_fitted | parameters::second_current_fitted |
                     static_cast<std::int32_t>(hal::fitted_inputs) * parameters::first_truck_input};
constexpr parameters::Ranges ranges = parameters::ranges_of(board_pack, build);
constexpr auto sample_us = static_cast<std::uint32_t>(1e6 * hal::sample_period_s + 0.5);
constexpr protection::ProtectionPlan plan_of_build = protection::protection_plan(board_pack);

static_assert(parameters::possible(parameters::initial_values(ranges), ranges),
              "BMS_CAN_BASE, BMS_CAN_STOP, BMS_CANOPEN_NODE or BMS_CANOPEN_CHARGER is out of range, or two messages "
              "have the same identifier");
static_assert(parameters::proved(plan_of_build, ranges, sample_us),
              "the limits of this cell are too close to each other for the ranges of the parameters");
static_assert([] {
  protection::ProtectionPlan plan = plan_of_build;
  tighten(plan, parameters::initial_values(ranges), ranges, sample_us);
  return plan.rules[0].threshold == plan_of_build.rules[0].threshold && parameters::sound(plan);
}());

parameters::ParameterBlock block{ranges};
parameters::ActivePlan active;
bool built = false;

}  // namespace

parameters::ParameterBlock& ParametersOfBoard<true>::parameters() { return block; }

void ParametersOfBoard<true>::apply_parameters() {
  active.build(plan_of_build, block.active(), ranges, sample_us);
  built = true;
}

const protection::ProtectionPlan& ParametersOfBoard<true>::active_plan() {
  if (!built) apply_parameters();
  return active.plan();
}

bool ParametersOfBoard<true>::plan_intact() { return active.intact(); }

}  // namespace bms::firmware
