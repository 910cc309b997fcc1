// Nonlinear grey box (paper, 3.2.4): the 1RC model of model/one_rc.hpp over recordings. The unknowns are R0, R1, C1 at
// nodes of SOC and the initial states. The residual is the simulation error: open loop, no measured voltage is fed
// back.
//
// Order of the unknowns: R0 at each node, R1 at each node, C1 at each node, the OCV branch position if asked for, then
// for each recording v_rc and SOC at its start, where asked for. The derivatives come from the step of the model under
// automatic differentiation by (soc, v_rc, R0, R1, C1); the chain rule over time and nodes is written by hand, so that
// one node more costs one multiplication per sample.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "identification/data.hpp"
#include "identification/least_squares.hpp"
#include "identification/ocv_error.hpp"
#include "model/cell.hpp"

namespace bms::identification {

/// One recording and what is known of its initial state.
struct DataSet {
  Data data;
  double initial_soc = 0.5;      ///< fixed; or the prior; or the start value of the search
  double initial_soc_sigma = 0;  ///< of the prior; 0: fixed, or estimated without a prior
  bool estimate_initial_soc = false;
  bool estimate_initial_v_rc = true;  ///< false: the recording begins at rest
};

/// Bounds of R0, R1, C1 at every node: Table 3.
struct CircuitBounds {
  double r0_min_ohm = 0.001, r0_max_ohm = 0.1;
  double r1_min_ohm = 0.001, r1_max_ohm = 0.5;
  double c1_min_f = 100, c1_max_f = 50'000;
};

/// RMS of the logarithmic ratio of neighbours in Table 9, whose nodes are tenths: R0, R1, C1. All, and those at its
/// ends (10 to 20 and 90 to 100 %), where the curves bend.
inline constexpr std::array<double, 3> neighbours_differ = {0.044, 0.28, 0.27},
                                       neighbours_differ_at_ends = {0.09, 0.56, 0.52};

/// Standard deviation of the logarithmic ratio of neighbours; quantity: 0 R0, 1 R1, 2 C1.
double step_between(std::size_t quantity, double below_soc, double above_soc);

struct GreyBoxOptions {
  std::vector<double> soc_nodes;  ///< ascending, one or more; one: constant parameters
  CircuitBounds bounds;
  bool estimate_ocv_branch = false;  ///< needs ocv.half_gap_v of the cell
  double voltage_sigma_v = 0.001;    ///< weight of a voltage residual against a prior
  /// Residual of two neighbouring nodes that differ as much as those of Table 9 do; 0: nodes are independent.
  double tie_v = 0;
  /// Standard deviation of the error of the OCV curve, which is marginalised (ocv_error.hpp); 0: none. A residual of
  /// tie_v stands for one standard deviation.
  double ocv_sigma_v = 0;
  bool ocv_ends_unmeasured = false;  ///< the curve is from a slow run (ocv_error.hpp)
  /// Error of an OCV curve that follows the voltages of the fit: its residuals do not show it, but it is in them.
  double ocv_hidden_v = 0;
  bool one_start = false;  ///< only the start given, without other time constants
};

enum class Quantity { r0, r1, c1, ocv_branch, initial_v_rc, initial_soc };

struct Unknown {
  Quantity quantity;
  double soc = 0;          ///< of the node; of the start of the recording for its states
  std::size_t record = 0;  ///< for its states

  /// "r0_ohm", "r1_ohm", "c1_f", "ocv_lean", "initial_v_rc_v", "initial_soc"
  const char* name() const;
};

class GreyBox {
 public:
  /// cell: OCV, capacity, and R0, R1, C1 to start from (at the nodes by interpolation).
  /// Throws std::invalid_argument: no nodes, no recordings, a recording with fewer than two samples, an OCV branch
  /// position without a half gap.
  GreyBox(const model::CellParameters<>& cell, std::vector<DataSet> records, GreyBoxOptions options);

  const std::vector<Unknown>& unknowns() const { return unknowns_; }
  const std::vector<DataSet>& records() const { return records_; }
  const GreyBoxOptions& options() const { return options_; }
  /// The values of the cell, clamped to the bounds.
  Eigen::VectorXd start() const;
  /// Residuals in V: simulated minus measured, 0 in rows without a voltage; with the error of the OCV that is best for
  /// these unknowns, if it has one. Then one row per prior of an initial SOC, the prior of that error, and one row per
  /// pair of neighbouring nodes where these are tied. The problem refers to this object.
  LeastSquares problem() const;
  std::size_t samples() const { return samples_; }
  /// SOC of all samples, NaN without a voltage.
  Eigen::VectorXd counted_soc(const Eigen::VectorXd& x) const;
  /// Lowest and highest SOC of the samples with a voltage.
  std::pair<double, double> soc_range(const Eigen::VectorXd& x) const;
  std::size_t ties() const { return options_.tie_v > 0 ? 3 * (nodes() - 1) : 0; }

  /// Terminal voltage over recording r. derivatives: samples by unknowns, or null. Returns false if not finite.
  bool simulate(const Eigen::VectorXd& x, std::size_t r, Eigen::Ref<Eigen::VectorXd> voltage_v,
                Eigen::Ref<Eigen::MatrixXd>* derivatives) const;

  /// The cell with R0, R1, C1 and the OCV branch position of x.
  model::CellParameters<> cell_with(const Eigen::VectorXd& x) const;

 private:
  template <class S>
  bool run(const Eigen::VectorXd& x, std::size_t r, Eigen::Ref<Eigen::VectorXd> voltage_v,
           Eigen::Ref<Eigen::MatrixXd>* derivatives) const;
  bool evaluate(const Eigen::VectorXd& x, Eigen::VectorXd& residuals, Eigen::MatrixXd* jacobian) const;
  bool add_simulation(const Eigen::VectorXd& x, std::size_t r, Eigen::Index from, Eigen::VectorXd& residuals,
                      Eigen::MatrixXd* jacobian) const;
  void add_ties(const Eigen::VectorXd& x, Eigen::Index row, Eigen::VectorXd& residuals,
                Eigen::MatrixXd* jacobian) const;
  std::size_t nodes() const { return options_.soc_nodes.size(); }
  bool ocv_errs() const { return options_.tie_v > 0 && options_.ocv_sigma_v > 0; }
  OcvErrorPrior ocv_error_prior() const;
  std::optional<Eigen::Index> unknown(Quantity quantity, std::size_t record) const;

  model::CellParameters<> cell_;
  std::vector<DataSet> records_;
  GreyBoxOptions options_;
  std::vector<Unknown> unknowns_;
  std::size_t samples_ = 0, priors_ = 0;
};

/// The cell with its OCV at another branch position: -1 slow discharge, 1 slow charge.
model::CellParameters<> with_ocv_branch(const model::CellParameters<>& cell, double ocv_branch);

/// Nodes for data from soc_min to soc_max: one in the middle if the range is narrow, otherwise at tenths as in Table 9.
std::vector<double> nodes_for(double soc_min, double soc_max);

}  // namespace bms::identification
