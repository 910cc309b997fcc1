#include "identification/ocv_error.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Cholesky>

#include "identification/ocv_curve.hpp"

namespace bms::identification {

namespace {

constexpr double correlation_soc = 0.1;  // over which errors of a curve are alike: a plateau, a tenth of R(SOC)
constexpr double width_soc = 0.01;       // distance of nodes
constexpr int end_nodes = 10;            // in an unmeasured end: a pulse crosses one of them within its time constant

/// Nodes over 0 to 1, closer in the ends.
const std::vector<double>& node_soc() {
  static const std::vector<double> soc = [] {
    std::vector<double> at;
    const double fine = unmeasured_end / end_nodes;
    const int coarse = static_cast<int>(std::lround((1 - 2 * unmeasured_end) / width_soc));
    for (int k = 0; k < end_nodes; ++k) at.push_back(k * fine);
    for (int k = 0; k < coarse; ++k) at.push_back(unmeasured_end + k * width_soc);
    for (int k = 0; k <= end_nodes; ++k) at.push_back(1 - unmeasured_end + k * fine);
    return at;
  }();
  return soc;
}

/// The two nodes around each row with their weights, 0 in rows that do not count.
struct Places {
  std::vector<Eigen::Index> below;
  Eigen::VectorXd below_part, above_part;
};

Places places_of(const Eigen::VectorXd& soc) {
  const std::vector<double>& nodes = node_soc();
  Places p{std::vector<Eigen::Index>(static_cast<std::size_t>(soc.size()), 0), Eigen::VectorXd::Zero(soc.size()),
           Eigen::VectorXd::Zero(soc.size())};
  for (Eigen::Index r = 0; r < soc.size(); ++r) {
    if (!std::isfinite(soc[r])) continue;
    const double at = std::clamp(soc[r], 0.0, 1.0);
    const auto above = std::clamp(std::upper_bound(nodes.begin(), nodes.end(), at) - nodes.begin(), std::ptrdiff_t{1},
                                  static_cast<std::ptrdiff_t>(nodes.size()) - 1);
    const double below_soc = nodes[static_cast<std::size_t>(above - 1)];
    p.below[static_cast<std::size_t>(r)] = above - 1;
    p.above_part[r] = (at - below_soc) / (nodes[static_cast<std::size_t>(above)] - below_soc);
    p.below_part[r] = 1 - p.above_part[r];
  }
  return p;
}

/// B'B; B: from nodes to rows.
Eigen::MatrixXd squares(const Places& at) {
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(OcvError::nodes(), OcvError::nodes());
  for (Eigen::Index r = 0; r < at.above_part.size(); ++r) {
    const Eigen::Index k = at.below[static_cast<std::size_t>(r)];
    const double below = at.below_part[r], above = at.above_part[r];
    sum(k, k) += below * below;
    sum(k, k + 1) += below * above;
    sum(k + 1, k + 1) += above * above;
  }
  for (Eigen::Index k = 0; k + 1 < OcvError::nodes(); ++k) sum(k + 1, k) = sum(k, k + 1);
  return sum;
}

/// B' rows.
Eigen::MatrixXd gathered(const Places& at, const Eigen::Ref<const Eigen::MatrixXd>& rows) {
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(OcvError::nodes(), rows.cols());
  for (Eigen::Index c = 0; c < rows.cols(); ++c) {
    for (Eigen::Index r = 0; r < rows.rows(); ++r) {
      const Eigen::Index k = at.below[static_cast<std::size_t>(r)];
      sum(k, c) += at.below_part[r] * rows(r, c);
      sum(k + 1, c) += at.above_part[r] * rows(r, c);
    }
  }
  return sum;
}

/// Adds B values.
void spread(const Places& at, const Eigen::MatrixXd& values, Eigen::Ref<Eigen::MatrixXd> rows) {
  for (Eigen::Index c = 0; c < rows.cols(); ++c) {
    for (Eigen::Index r = 0; r < rows.rows(); ++r) {
      const Eigen::Index k = at.below[static_cast<std::size_t>(r)];
      rows(r, c) += at.below_part[r] * values(k, c) + at.above_part[r] * values(k + 1, c);
    }
  }
}

}  // namespace

Eigen::Index OcvError::nodes() { return static_cast<Eigen::Index>(node_soc().size()); }

OcvError::OcvError(const OcvErrorPrior& prior, double weight_v) : prior_(Eigen::MatrixXd::Zero(nodes(), nodes())) {
  const std::vector<double>& soc = node_soc();
  const auto next_to = [&](Eigen::Index k, Eigen::Index known, double wanders_v) {
    const double width = std::abs(soc[static_cast<std::size_t>(k)] - soc[static_cast<std::size_t>(known)]),
                 fading = std::exp(-width / correlation_soc),
                 fresh_v = std::hypot(prior.curve_v * std::sqrt(1 - fading * fading),
                                      wanders_v * std::sqrt(width / unmeasured_end));
    prior_(k, k) = weight_v / fresh_v;
    prior_(k, known) = -fading * weight_v / fresh_v;
  };
  // from the lowest measured point up, and down from there
  prior_(end_nodes, end_nodes) = weight_v / prior.curve_v;
  for (Eigen::Index k = end_nodes + 1; k < nodes(); ++k)
    next_to(k, k - 1, k + end_nodes < nodes() ? 0 : prior.full_end_v);
  for (Eigen::Index k = end_nodes; k-- > 0;) next_to(k, k + 1, prior.empty_end_v);
}

void OcvError::take_out(const Eigen::VectorXd& soc, Eigen::Ref<Eigen::VectorXd> residuals,
                        Eigen::Ref<Eigen::VectorXd> prior_residuals, Eigen::MatrixXd* jacobian,
                        Eigen::Index prior_row) const {
  const Places at = places_of(soc);
  const Eigen::LLT<Eigen::MatrixXd> normal(squares(at) + prior_.transpose() * prior_);
  const Eigen::VectorXd error = -normal.solve(gathered(at, residuals));
  spread(at, error, residuals);
  prior_residuals = prior_ * error;
  if (jacobian == nullptr) return;
  const Eigen::MatrixXd by_unknowns = -normal.solve(gathered(at, jacobian->topRows(soc.size())));
  spread(at, by_unknowns, jacobian->topRows(soc.size()));
  jacobian->middleRows(prior_row, nodes()) = prior_ * by_unknowns;
}

}  // namespace bms::identification
