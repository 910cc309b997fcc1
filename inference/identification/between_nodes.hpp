// What R0, R1, C1 do between their nodes, where the model has straight lines.
#pragma once

#include "identification/grey_box.hpp"

namespace bms::identification {

/// Change of the residuals of the grey box (rows of its problem) if a curve between two nodes differs from the straight
/// line by as much as curves do whose neighbouring nodes differ as in Table 9; one column per quantity and interval.
/// With one node: if it rises as curves of Table 9 do over the range of the samples; one column per quantity.
Eigen::MatrixXd changes_between_nodes(const GreyBox& grey_box, const Eigen::VectorXd& x);

}  // namespace bms::identification
