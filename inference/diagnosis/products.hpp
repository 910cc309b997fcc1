// Products of long, narrow matrices with each other, the most frequent arithmetic of a fit.
#pragma once

#include <Eigen/Core>

#include "diagnosis/noise.hpp"

namespace bms::diagnosis {

using AnyColumns = Eigen::Ref<const Columns, 0, Eigen::OuterStride<>>;

/// columns' columns.
Eigen::MatrixXd squared(const AnyColumns& columns);

/// a' b; as many rows each.
Eigen::MatrixXd products(const AnyColumns& a, const AnyColumns& b);

}  // namespace bms::diagnosis
