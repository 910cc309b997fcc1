// Separable least squares: r is linear in some unknowns. For each value of the others these are at their best, so a
// search has only the others (Golub and Pereyra, SIAM J. Numer. Anal. 10 (1973) 413). It needs fewer steps and ends in
// fewer local minima.
#pragma once

#include "identification/least_squares.hpp"

namespace bms::identification {

/// The problem in its first unknowns. r is linear in those after them, which have no bounds; `start` is a value of all.
/// J without the term that vanishes with r (Kaufman, BIT 15 (1975) 49).
LeastSquares with_others_at_their_best(const LeastSquares& whole, const Eigen::VectorXd& start, Eigen::Index first);

/// x with those after the first at their best; x itself where r is not defined.
Eigen::VectorXd best_others(const LeastSquares& whole, Eigen::VectorXd x, Eigen::Index first);

}  // namespace bms::identification
