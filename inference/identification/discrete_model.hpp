// Linear discrete model of the battery (paper, 3.2.1 and 3.2.2), evenly sampled:
//
//   y[k] - offset = B(q)/F(q) u[k - nk] + free response + e[k]
//   B(q) = b[0] + b[1] q^-1 + ...        F(q) = 1 + f[0] q^-1 + f[1] q^-2 + ...        u: current [A], y: voltage [V]
//
// The only difference between model and measurement is the white noise e. Past errors therefore do not improve a
// prediction: the one-step and every k-step prediction of this structure are the simulation itself.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "identification/data.hpp"
#include "identification/least_squares.hpp"

namespace bms::identification {

struct DiscreteModel {
  std::vector<double> b;  ///< [ohm]; b[i] goes with u[k - nk - i]
  std::vector<double> f;  ///< f[j] goes with y[k - 1 - j]; at least one
  std::size_t nk = 0;     ///< delay in samples
  double offset_v = 0;
  /// Free response in the first samples [V], as many as f; F determines the others. Empty: no free response. The input
  /// before the recording counts as 0; the free response contains its effect, exactly from sample nk + nb - 1 - nf on.
  std::vector<double> initial_v;
};

/// Orders of the model, and which of its numbers are unknown. Order of the unknowns: b, f, offset, initial.
struct Structure {
  std::size_t nb = 3, nf = 2, nk = 0;
  double offset_v = 0;  ///< value of the offset if it is not estimated
  bool estimate_offset = false;
  /// Estimate the free response. Together with the offset the first value is fixed at 0, because with a pole at 1 a
  /// constant free response and the offset are the same. Without a pole near 1 this restricts the start slightly.
  bool estimate_initial = false;
  std::size_t unknown_initial() const { return estimate_initial ? nf - (estimate_offset ? 1 : 0) : 0; }
  std::size_t unknowns() const { return nb + nf + (estimate_offset ? 1 : 0) + unknown_initial(); }
};

/// TF, Eq. 11: b = c0 c1 c2, f = a1 a2, y minus b0_v, the OCV line extrapolated to SOC 0. The free response contains
/// the charge at the start.
Structure transfer_function(double b0_v);

/// OE, Eq. 18-22: one sample of delay, the offset estimated. from_rest: no free response, for a cell that rested before
/// the recording.
Structure output_error(bool from_rest = false);

/// Unknowns of a model and back. Throw std::invalid_argument if the sizes differ. A missing initial_v counts as zeros.
Eigen::VectorXd to_unknowns(const DiscreteModel& model, const Structure& structure);
DiscreteModel to_model(const Eigen::VectorXd& unknowns, const Structure& structure);

/// Output over the input. jacobian: null, or dy/dx, as many rows as samples, columns as Structure orders them with
/// everything estimated and all nf initial values: b, f, offset, initial. Exact (sensitivity filters), cost about 10
/// filters for nb = 3, nf = 2. Throws std::invalid_argument when f is empty or initial_v has neither 0 nor nf values.
/// The output of an unstable model may not be finite.
Eigen::VectorXd simulate(const DiscreteModel& model, std::span<const double> input,
                         Eigen::MatrixXd* jacobian = nullptr);

/// Largest absolute value of the roots of F.
double largest_pole(const std::vector<double>& f);

/// Returns true if every pole is within 1 + margin. The margin allows for an identified integrator. A recording of N
/// samples tolerates 1 / N: a growth by e over the recording.
bool stable(const std::vector<double>& f, double margin = 1e-3);

/// F with its roots outside the unit circle moved to 1 / conj(root).
std::vector<double> mirrored_inside(const std::vector<double>& f);

/// Simulation error: residuals are simulated minus measured [V]. A row is zero where the voltage is not finite and,
/// with an estimated free response, in the first nk + nb - 1 - nf samples, which it does not reach. Not defined at
/// poles beyond 1 + 1 / N. No bounds. `start` gives the scale. Throws std::invalid_argument: uneven sampling, current
/// not finite, fewer measured samples than unknowns.
LeastSquares simulation_error(const Data& data, const Structure& structure, const Eigen::VectorXd& start);

/// Start values: of several F the one with the smallest simulation error, with b, offset and free response by linear
/// least squares for each. The F come from least squares of the equation error (ARX, biased by noise), from its
/// refinement by the iteration of Steiglitz and McBride (IEEE Trans. Autom. Control 10, 1965: both signals filtered by
/// the last 1/F) and, for nf = 2, from pairs of time constants between one sample and more than the recording. Cost:
/// about 100 filters over the recording, 0.1 s for 20,000 samples. Throws as simulation_error; and when the current
/// never changes.
DiscreteModel start_values(const Data& data, const Structure& structure, int refinements = 8);

}  // namespace bms::identification
