// The search of a grey-box identification: several start values, and the weight of the prior on neighbouring nodes.
//
// Neighbouring nodes have a normal prior: the logarithm of their ratio has the standard deviation of those of Table 9.
// In the units of the residuals this is a row of tie_v * log(ratio) / deviation, with
//
//   tie_v = s sqrt(L)     s: RMS of the residuals, L: samples over which they are correlated, so that a run counts once
//
// of the model that is fitted. Both are unknown, so the fit is repeated with its own until it agrees with itself. It
// begins with the noise between neighbouring samples, the loosest tie that the data allow: nodes that begin tied too
// strongly cause the residuals that justify their ties.
#pragma once

#include <span>
#include <vector>

#include "identification/grey_box.hpp"
#include "identification/least_squares.hpp"

namespace bms::identification {

struct Search {
  Optimum optimum;               ///< the best; `evaluations` are those of all starts
  int starts = 0, agreeing = 0;  ///< number of start values, and how many of them led to the best optimum
  double tie_v = 0;              ///< with which it was found
};

/// The best of the optima from all start values; at least one. Never worse than any of them.
Search best_optimum(const GreyBox& grey_box, std::span<const Eigen::VectorXd> starts, Method method,
                    const Stopping& stopping);

/// The start of the grey box with its time constants, and with shorter and longer ones: C1 decides which of several
/// minima is found. Only the first with options.one_start.
std::vector<Eigen::VectorXd> starts_of(const GreyBox& grey_box);

/// Fits nodes with the prior, whose weight follows from the residuals of this fit. options.tie_v is not used.
Search search_with_prior(const model::CellParameters<>& cell, const std::vector<DataSet>& records,
                         GreyBoxOptions options, std::span<const Eigen::VectorXd> starts, Method method,
                         const Stopping& stopping);

}  // namespace bms::identification
