#include "identification/hammerstein_wiener_search.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Dense>

#include "identification/variable_projection.hpp"
#include "numerics/matrix_factors.hpp"

namespace bms::identification {

namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr std::size_t enough_samples = 2'000;
constexpr std::array places = {0.0, 0.5, 1.0, 1.5};             // pieces, below and above the data
constexpr std::array begun_time_constants = {5.0, 15.0, 45.0};  // samples
struct Round {
  int iterations;
  std::size_t kept;
};
constexpr std::array rounds = {Round{6, 12}, Round{15, 3}, Round{100, 1}};

struct Beginning {
  HammersteinWiener model;
  double cost = INFINITY;
};

void improve(Beginning& c, const Data& data, std::size_t every, int iterations) {
  const LeastSquares all = simulation_error(data, c.model, every);
  const VectorXd start = to_unknowns(c.model);
  const Index first = unknowns_before_corners(c.model);
  Stopping stopping;
  stopping.iterations = iterations;
  const Optimum found = minimise(with_others_at_their_best(all, start, first), start.head(first),
                                 Method::trust_region_reflective, stopping);
  VectorXd x = start;
  x.head(first) = found.x;
  c.model = with_unknowns(c.model, best_others(all, x, first));
  c.cost = found.cost;
}

/// An integrator, as every cell is one, and one time constant; the other numbers by linear least squares.
DiscreteModel integrator_with(double time_constant, const DiscreteModel& like, const Structure& s, const Data& data) {
  DiscreteModel m = like;
  m.f.assign(s.nf, 0);
  const double pole = std::exp(-1 / time_constant);
  m.f[0] = -(1 + pole);
  m.f[1] = pole;
  VectorXd x = to_unknowns(m, s), r;
  Eigen::MatrixXd jacobian;
  if (!simulation_error(data, s, x).evaluate(x, r, &jacobian)) return like;
  const auto numerator = static_cast<Index>(s.nb), after = static_cast<Index>(s.nb + s.nf);
  jacobian.middleCols(numerator, after - numerator).setZero();
  x -= numerics::shortest_least_squares(jacobian, r);
  return to_model(x, s);
}

/// Linear blocks to begin with. A pole outside the unit circle would keep a search at the limit of stability.
std::vector<DiscreteModel> linear_blocks(const DiscreteModel& linear, const Structure& s, const Data& data) {
  std::vector<DiscreteModel> all = {linear};
  all.front().f = mirrored_inside(linear.f);
  if (s.nf < 2) return all;
  for (const double time_constant : begun_time_constants)
    all.push_back(integrator_with(time_constant, linear, s, data));
  return all;
}

}  // namespace

HammersteinWiener find_hammerstein_wiener(const DiscreteModel& linear, const Structure& structure,
                                          const model::OcvTable<double>& ocv, const Data& data, double soc) {
  const std::size_t every = std::max<std::size_t>(1, data.size() / enough_samples);
  std::vector<Beginning> all;
  for (const DiscreteModel& block : linear_blocks(linear, structure, data)) {
    for (const double below : places) {
      for (const double above : places)
        all.push_back({begin_hammerstein_wiener(block, structure, ocv, data, soc, {below, above}), INFINITY});
    }
  }
  for (const Round& round : rounds) {
    for (Beginning& c : all) improve(c, data, every, round.iterations);
    std::stable_sort(all.begin(), all.end(), [](const Beginning& a, const Beginning& b) { return a.cost < b.cost; });
    all.resize(std::min(all.size(), round.kept));
  }
  return all.front().model;
}

}  // namespace bms::identification
