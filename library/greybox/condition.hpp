// What follows from the estimates of a cell: quality and display of the state of charge, limits of the current, state
// of health.
#pragma once

#include "estimator/condition.hpp"

namespace greybox {

using bms::estimator::Condition;

}  // namespace greybox
