// Which cells are faulty, and of what: likelihood of hypotheses over all cells of a pack.
//
// A hypothesis is a list of accusations. It changes the prior of the accused parameters from the healthy spread of this
// pack to that of a fault. The marginal likelihood of a Gaussian linear model then follows in closed form:
//
//   ln Z = (S g)' M^-1 (S g) / 2 - ln det M / 2        M = 1 + S A S,  S: the prior's standard deviations
//
// A: information of the parameters, g: its product with the data (cell_fit.hpp). Cells are independent but for sense
// wires, which change the readings of two neighbours.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "diagnosis/pack/causes.hpp"
#include "diagnosis/pack/cell_fit.hpp"

namespace bms::diagnosis::pack {

/// sense_wire: the wire between `cell` and the next one.
struct Accusation {
  Cause cause = Cause::imbalance;
  std::size_t cell = 0;
  bool operator==(const Accusation&) const = default;
  bool touches(std::size_t c) const { return c == cell || (cause == Cause::sense_wire && c == cell + 1); }
};

struct Estimated {
  double value = 0, sigma = 0;
};

class PackLikelihood {
 public:
  /// healthy: standard deviation of each parameter over the healthy cells. r0_ohm: of a cell.
  /// days: length of the recording. step_s: between rows. unseen_share: as in Track.
  PackLikelihood(const std::vector<CellFit>& fits, const Vector& healthy, double r0_ohm, double days, double step_s,
                 double unseen_share = 0);

  /// ln Z of all cells that the accusations touch. checkpoint: with the rows up to it.
  double of(const std::vector<Accusation>& accusations, const std::vector<std::size_t>& cells,
            std::size_t checkpoint) const;
  /// ln Z with this accusation in addition to the others, minus ln Z without it.
  double gain(const std::vector<Accusation>& others, const Accusation& added, std::size_t checkpoint) const;
  /// The size of one of the accusations.
  Estimated size(const std::vector<Accusation>& accusations, const Accusation& of, std::size_t checkpoint) const;

  std::size_t cells() const { return fits_.size(); }
  std::size_t last_checkpoint() const { return fits_.front().until.size() - 1; }
  /// Everything a cell may be accused of.
  std::vector<Accusation> candidates_at(std::size_t cell) const;
  /// Causes of the same observation: those of this cell, and its two sense wires.
  std::vector<Accusation> rivals_of(const Accusation& of) const;
  /// Posterior odds [ln] above which an accusation is named, in terms of the gain.
  double least_gain() const;
  const Vector& healthy() const { return healthy_; }
  double unseen_share() const { return unseen_share_; }
  /// A smaller size is never named: by parameter, for this recording's rows and length.
  const Vector& least() const { return least_; }
  /// Returns true if a fault can have this size: large enough, significant, of the possible sign.
  bool is_possible(const Accusation& of, const Estimated& size) const;

 private:
  struct System {
    Eigen::MatrixXd information;
    Eigen::VectorXd with_data, prior;
  };
  System system_of(const std::vector<Accusation>& accusations, const std::vector<std::size_t>& cells,
                   std::size_t checkpoint) const;
  std::vector<std::size_t> cells_of(const std::vector<Accusation>& accusations, const Accusation& around) const;

  const std::vector<CellFit>& fits_;
  double r0_ohm_, unseen_share_;
  Vector healthy_, least_;
};

/// Spread of each parameter over the cells without accusations; at least that of healthy cells. Robust against a
/// minority of faulty cells.
Vector healthy_spread(const std::vector<CellFit>& fits, double r0_ohm);
/// The same before any pack is known.
Vector least_spread(double r0_ohm);
/// Spread of faulty cells.
Vector fault_spread(double r0_ohm);

/// Widens the prior of a cell's parameters, standard deviations, for this cause in the cell. A resistance responds to
/// the current within a row, of which the share that is not seen has an error that grows with it.
void widen_for(Cause cause, const Vector& healthy, double r0_ohm, double unseen_share,
               Eigen::Ref<Eigen::VectorXd> prior);

/// ln Z for any information, data and prior.
double log_marginal(const Eigen::MatrixXd& information, const Eigen::VectorXd& with_data, const Eigen::VectorXd& prior);

}  // namespace bms::diagnosis::pack
