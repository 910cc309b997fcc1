// The rule of the adaptive subspace Gauss-Newton method as the toolbox documents it: directions whose eigenvalue of
// J'J is below gamma times the largest are left out. gamma begins with 1e-4 (InitialGnaTolerance), grows by LMStep = 2
// if no smaller cost was found in fewer than five bisections, and falls by 2 LMStep after a step without bisections.
//
// The test applies this rule to the bisections that it sees, and compares gamma with the directions that moved.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "identification/least_squares.hpp"

namespace bms::identification {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index probes = 80;
constexpr double probe_ratio = 1.25;  // of the eigenvalues of two neighbouring probes

double eigenvalue(Index probe) { return 0.5 * std::pow(probe_ratio, -static_cast<double>(probe)); }

/// One accepted point and the trial points before it.
struct Move {
  VectorXd from, to;
  int bisections = 0;
};

/// Linear residuals with the eigenvalues of the probes, one with eigenvalue 1 at its minimum, and one that a step
/// overshoots by about `overshoot`.
std::vector<Move> moves(double overshoot) {
  std::vector<Move> all;
  int trials = 0;
  VectorXd last;
  LeastSquares problem;
  problem.evaluate = [&](const VectorXd& x, VectorXd& r, MatrixXd* jacobian) {
    r = VectorXd::Zero(probes + 2);
    for (Index k = 0; k < probes; ++k) r[k] = std::sqrt(eigenvalue(k)) * (x[k] - 1);
    r[probes] = x[probes];
    r[probes + 1] = 1 + std::sin(overshoot * x[probes + 1]) / overshoot;
    if (jacobian == nullptr) return ++trials > 0;
    *jacobian = MatrixXd::Zero(r.size(), x.size());
    for (Index k = 0; k < probes; ++k) (*jacobian)(k, k) = std::sqrt(eigenvalue(k));
    (*jacobian)(probes, probes) = 1;
    (*jacobian)(probes + 1, probes + 1) = std::cos(overshoot * x[probes + 1]);
    if (last.size() > 0) all.push_back({last, x, trials - 1});
    last = x;
    trials = 0;
    return true;
  };
  Stopping few;
  few.iterations = 5;
  minimise(problem, VectorXd::Zero(probes + 2), Method::adaptive_subspace_gauss_newton, few);
  return all;
}

TEST(AdaptiveGaussNewton, KeepsTheDirectionsOfTheDocumentedRule) {
  constexpr double start = 1e-4, lm_step = 2;
  constexpr int many = 5;
  int none = 0, some = 0, at_least_five = 0;
  for (const double overshoot : {0.5, 6.0, 50.0, 500.0}) {
    SCOPED_TRACE(overshoot);
    double gamma = start;
    const std::vector<Move> all = moves(overshoot);
    ASSERT_GE(all.size(), 3U);
    for (const Move& move : all) {
      for (Index k = 0; k < probes; ++k) {
        const bool arrived = std::abs(move.from[k] - 1)<1e-9, moved = std::abs(move.to[k] - move.from[k])> 1e-12;
        EXPECT_TRUE(arrived || moved == (eigenvalue(k) > gamma)) << eigenvalue(k) << " of " << gamma;
      }
      none += move.bisections == 0 ? 1 : 0;
      some += move.bisections > 0 && move.bisections < many ? 1 : 0;
      at_least_five += move.bisections >= many ? 1 : 0;
      if (move.bisections == 0) gamma /= 2 * lm_step;
      if (move.bisections >= many) gamma *= lm_step;
    }
  }
  EXPECT_GT(none, 0);
  EXPECT_GT(some, 0);
  EXPECT_GT(at_least_five, 0);
}

}  // namespace
}  // namespace bms::identification
