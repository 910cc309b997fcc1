// Numbers that keep the arithmetic stable or bound its cost. A verdict should not depend on them: a fit that has
// converged stays where it is when one of them changes.
#pragma once

#include <array>
#include <cstddef>

namespace bms::diagnosis {

/// Constants of distributions.
struct Statistics {
  double normal_abs_median = 0.6745;       ///< median of |x|, x standard normal
  double normal_abs_quantile_80 = 1.2816;  ///< 80 % quantile of |x|
  double quantile_80 = 0.8;
  double second_difference_variance = 6;     ///< of white noise with variance 1
  double uniform_variance_denominator = 12;  ///< a rounding error has variance step^2 / 12
  double chi_square_median = 0.4549;         ///< of one degree of freedom
  double wilson_hilferty = 2.0 / 9;          ///< their factor
  std::size_t blocks = 24;                   ///< of a recording, whose errors are independent of each other
  double normal_of_two_sigma = 1.690;        ///< one-sided quantile at the probability of two sigma on both sides
  /// Of 1, 2 and 3 powers of 1 / degrees of freedom, in the 97.5 % quantile of Student's distribution over the normal
  /// one (Abramowitz and Stegun, 26.7.5).
  std::array<double, 3> student_975 = {1.2104, 1.4401, 1.3041};
};

struct Numerics {
  /// Damped Gauss-Newton (fit.cpp).
  struct Fit {
    int iterations = 12, refit_iterations = 5, nominal_iterations = 6, reduced_iterations = 8, onset_iterations = 4;
    int attempts = 8;                       ///< with growing damping, per iteration
    int renewals = 2, renewals_astray = 6;  ///< linearisations of the base parameters at most
    int iterations_after_renewal = 5;
    int iterations_before_hopeless = 3;
    double damping = 1e-3, damping_least = 1e-9;
    double damping_less = 5, damping_more = 8, damping_restart = 64;  ///< divisor, factor, divisor
    double calibration_way = 0.02;             ///< the base parameters' step shrinks as 1 / (1 + this damping)
    double within_reach = 0.2;                 ///< possible gain below which a fit has converged
    double hopeless_times = 2;                 ///< of the possible gain that a step is given credit for
    double falls_share = 0.1;                  ///< of the cost, that an iteration gained: such a fit is not hopeless
    double kept_promise = 0.3;                 ///< share of the promised gain below which a step has gone astray,
    double promise = 2, promise_share = 1e-3;  ///< if it promised more than this and this share of the cost
    double quiet = 0.05, quiet_share = 1e-5;   ///< gain below which an iteration changes nothing
    double far_gain = 50;                      ///< gain since the start after which a new linearisation pays
    double shape_step = 1.5;                   ///< in ln, at once
    double linear_steps = 100;                 ///< a linear parameter's unit step is its range over this
    double bound_reach = 1e-9;                 ///< of the range, within which a value is at its bound
    /// added to the diagonals of normal equations: absolute, and as shares of the largest or the own element
    double ridge = 1e-9, ridge_share = 1e-12, ridge_reach = 1e-6, ridge_covariance = 1e-12;
  };

  struct Products {
    double worth_a_thread = 1e6;  ///< multiplications, or elements to whiten, from which idle processors take a part
  };

  /// Linear algebra of signatures.
  struct Signatures {
    double probing_strength = 1e-6;            ///< of the upper bound: a strength just above its bound at 0
    double ridge_share = 1e-6, ridge = 1e-12;  ///< added to the diagonal of a Gram matrix
    double prior = 1e-9;                       ///< weak prior of the parameters in the fit, as a share
  };

  struct Noise {
    std::array<double, 4> amplitude_factors = {2, 1.41, 1.19, 1.09};  ///< of the coordinate search, in this order
    double same_reading = 1e-9;
    double same_amplitude = 1e-9;  ///< as a share
    int factors = 8;  ///< of a logarithm: variances of 1e-30 to 1e30 V^2 remain within the range of a double
  };

  struct Search {
    int noise_rounds = 2;                 ///< noise and fit in turn
    std::size_t fits_with_own_noise = 3;  ///< of the candidates fitted, those that get their own noise
    int converged_rounds = 8;             ///< fits, one from where another has ended
    double converged = 0.5;               ///< gain below which the last of them has changed nothing
    double another_minimum = 6;           ///< gain of one next to the last, after which all is compared again
    int elimination_rounds = 6, elimination_resumed = 2;
    double onset_reach = 40;     ///< the search for a contact's onset begins at the duration over this
    double onset_rows = 1.5;     ///< and ends at so many rows
    double onset_margin = 0.04;  ///< of the recording at each end, where a step is not a step
    std::array<double, 4> onset_steps = {-1, -0.5, 0.5, 1};
    double shortest_hours = 0.1;                ///< for the current that moves a given charge
    double limit_step = 1.25;                   ///< factor from one detection limit tried to the next
    double least_gain = 0.5;                    ///< of a cause on a healthy block; less is not stored
    double most_gain = 1e12, gain_step = 1e-3;  ///< of a bisection, in ln
    int tail_points = 160;                      ///< on each side, of the mean of a tail over a normal part
    double tail_step = 0.05;                    ///< between them, in standard deviations
    double progress_steps = 20;                 ///< after which 63 % are shown as done
  };

  struct Bursts {
    int resistance_rounds = 3, edge_rounds = 2;
    double better = 1e-9;  ///< gain by which a moved end must be better
  };

  struct Grid {
    double knots_margin = 0.999;  ///< of a knot distance: one more knot beyond the range
    double width_least = 1e-12, last_knot = 1e-9, current_least_a = 1e-9;
    double sine_ridge = 1e-6;
    std::size_t regime_bins = 40;
    std::size_t most_turns = 256;          ///< of a wave, before rounding errors are removed
    std::size_t frequencies_at_once = 16;  ///< whose products with the known columns are computed together
  };

  struct Design {
    int halvings = 60;  ///< to invert the current sensor's laws
    double covariance_share = 1e-6, covariance = 1e-18;
    double capacity_steps_per_ah = 100;  ///< capacity of a course, rounded down
    std::size_t shape_points = 400;      ///< by which a recording is compared with a course
  };

  double middle_soc = 0.5;  ///< at which a cell's R0, R1 and C1 are compared with a mechanism's
  Statistics statistics;
  Fit fit;
  Products products;
  Signatures signatures;
  Noise noise;
  Search search;
  Bursts bursts;
  Grid grid;
  Design design;
};

inline constexpr Numerics numerics{};

}  // namespace bms::diagnosis
