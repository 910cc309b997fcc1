// One candidate of the diagnosis of the paper, fitted to some of the published figures.
//
// A fit weights each table by the difference of two such experiments that is expected. For the comparison of candidates
// the differences of a table have one unknown variance. Its prior is a scaled inverse chi-squared distribution around
// the expected difference, with the information of one figure. Integrated over, a table of n independent figures with a
// mean square difference m costs
//
//   (nu + n) / 2 ln(1 + n m / (nu s^2))        nu = 1, s: the expected difference
//
// so that a table that no candidate explains decides less, and a candidate gains little where all of them fit well.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "study/diagnose_paper.hpp"

namespace bms::study {

/// An unknown of a candidate; the search is over its logarithm.
struct PaperUnknown {
  std::string id, unit;
  double start = 0, low = 0, high = 0;
  void (*set)(PaperCandidate&, double) = nullptr;
};

class PaperFit {
 public:
  PaperFit(const model::CellParameters<>& cell, const Effects& effects, std::vector<Figure> published);

  const std::vector<PaperUnknown>& unknowns() const { return unknowns_; }
  Eigen::VectorXd start() const;
  /// The best of a few points spread over the bounds, by the figures used.
  Eigen::VectorXd screened(int points, const std::vector<bool>& used) const;
  std::vector<Figure> simulate(const Eigen::VectorXd& x) const;
  /// The same with runs of the plant that other simulations may share.
  std::vector<Figure> simulate(const Eigen::VectorXd& x, PaperRuns& runs) const;

  /// The better end of searches from the start and from the best screened point. There are several minima.
  Eigen::VectorXd searched(const std::vector<bool>& used, int points, int iterations) const;

  /// used: by figure, whether it counts.
  Eigen::VectorXd fit(const Eigen::VectorXd& from, const std::vector<bool>& used, int iterations) const;

  /// Standard deviations of the logarithms at x, from the figures used.
  Eigen::VectorXd deviation(const Eigen::VectorXd& x, const std::vector<bool>& used) const;

  /// The cost of all figures, and the penalty of Schwarz for the unknowns.
  double score(const std::vector<Figure>& simulated) const;

  const std::vector<Figure>& published() const { return published_; }

 private:
  id::LeastSquares problem(const std::vector<bool>& used) const;
  Eigen::VectorXd weighted(const std::vector<Figure>& simulated, const std::vector<bool>& used) const;
  Eigen::MatrixXd derivatives(const Eigen::VectorXd& x, PaperRuns& runs,
                              const std::function<Eigen::VectorXd(const std::vector<Figure>&)>& of) const;

  model::CellParameters<> cell_;
  Effects effects_;
  std::vector<Figure> published_;
  std::vector<PaperUnknown> unknowns_;
};

}  // namespace bms::study
