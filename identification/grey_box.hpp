// Nonlinear grey box (section 3.2.4): the 1RC model of model/one_rc.hpp over recordings, with R0, R1, C1 at nodes of
// soc and the initial states as unknowns. Simulation error: open loop, the measured voltage is compared with, never fed
// back.
//
// Unknowns, in this order: R0 at each node, R1 at each node, C1 at each node, the OCV's lean between slow discharge and
// charge if asked for, then per record v_rc and soc at its start, those that are asked for. Derivatives: the model's
// own step under automatic differentiation by (soc, v_rc, R0, R1, C1), the chain rule over time and nodes by hand, so
// that a node more costs one multiplication a sample.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "identification/data.hpp"
#include "identification/least_squares.hpp"
#include "model/cell.hpp"

namespace bms::identification {

/// One recording and what is known of its start.
struct DataSet {
  Data data;
  double initial_soc = 0.5;  ///< true, believed, or where the search begins
  double initial_soc_sigma =
      0;  ///< how far that is believed; 0 where initial_soc is not estimated, or nothing is known
  bool estimate_initial_soc = false;
  bool estimate_initial_v_rc = true;  ///< otherwise the record begins at rest
};

/// Bounds of R0, R1, C1 at every node: Table 3.
struct CircuitBounds {
  double r0_min_ohm = 0.001, r0_max_ohm = 0.1;
  double r1_min_ohm = 0.001, r1_max_ohm = 0.5;
  double c1_min_f = 100, c1_max_f = 50'000;
};

struct GreyBoxOptions {
  std::vector<double> soc_nodes;  ///< ascending, one or more; one: constant parameters
  CircuitBounds bounds;
  bool estimate_ocv_branch = false;  ///< needs the cell's ocv.half_gap_v
  double voltage_sigma_v = 0.001;    ///< weight of a voltage residual against a belief
  double tie_v =
      0;  ///< residual where neighbouring nodes differ as much as those of Table 9 do; 0: each stands for itself
};

/// What an unknown is.
struct Unknown {
  std::string name;        ///< "r0_ohm", "r1_ohm", "c1_f", "ocv_lean", "initial_v_rc_v", "initial_soc"
  double soc = 0;          ///< of the node; of the record's start for its states
  std::size_t record = 0;  ///< for its states
};

class GreyBox {
 public:
  /// cell: OCV, capacity, and R0, R1, C1 to start from (at the nodes by interpolation).
  /// Throws std::invalid_argument: no nodes, no records, a record of less than two samples, a lean without a gap.
  GreyBox(const model::CellParameters<>& cell, std::vector<DataSet> records, GreyBoxOptions options);

  const std::vector<Unknown>& unknowns() const { return unknowns_; }
  /// The cell's own values, moved inside the bounds.
  Eigen::VectorXd start() const;
  /// Residuals in V, simulated less measured; rows without a voltage are 0. Then one row per believed initial soc, and
  /// one per pair of neighbouring nodes where these are tied.
  LeastSquares problem() const;
  std::size_t samples() const { return samples_; }

  /// Terminal voltage over record r. derivatives: samples by unknowns, if asked for. False: not finite.
  bool simulate(const Eigen::VectorXd& x, std::size_t r, Eigen::Ref<Eigen::VectorXd> voltage_v,
                Eigen::Ref<Eigen::MatrixXd>* derivatives) const;

  /// The cell with R0, R1, C1 of x at the nodes, and the OCV leaning as x says.
  model::CellParameters<> cell_with(const Eigen::VectorXd& x) const;

 private:
  template <class S>
  bool run(const Eigen::VectorXd& x, std::size_t r, Eigen::Ref<Eigen::VectorXd> voltage_v,
           Eigen::Ref<Eigen::MatrixXd>* derivatives) const;
  std::size_t nodes() const { return options_.soc_nodes.size(); }
  std::optional<Eigen::Index> unknown(const std::string& name, std::size_t record) const;

  model::CellParameters<> cell_;
  std::vector<DataSet> records_;
  GreyBoxOptions options_;
  std::vector<Unknown> unknowns_;
  std::size_t samples_ = 0, beliefs_ = 0;
  std::size_t ties() const { return options_.tie_v > 0 ? 3 * (nodes() - 1) : 0; }
};

/// The cell with its OCV at another place between slow discharge (-1) and charge (1).
model::CellParameters<> with_ocv_branch(const model::CellParameters<>& cell, double ocv_branch);

/// Nodes for data that covers soc_min..soc_max: one in the middle if it is narrow, else at tenths as in Table 9.
std::vector<double> nodes_for(double soc_min, double soc_max);

}  // namespace bms::identification
