#include "diagnosis/residual_test.hpp"

#include <algorithm>
#include <span>

#include <Eigen/Cholesky>

#include "diagnosis/generic_columns.hpp"
#include "diagnosis/locate.hpp"
#include "diagnosis/residual_projection.hpp"
#include "diagnosis/thresholds.hpp"
#include "measurement/statistics.hpp"
#include "numerics/in_parallel.hpp"

namespace bms::diagnosis {

namespace {

constexpr const Thresholds::ResidualTest& residual_limits = thresholds.residual;

/// What gains most so far.
struct Best {
  double gain = 0;
  const char* family = "";
  Eigen::VectorXd explained_v;  ///< by row
  std::optional<PlaceOfGain> only_place = std::nullopt;
};

/// Where columns of some strengths gain, if that is one place.
std::optional<PlaceOfGain> place_of(const LikelihoodModel& likelihood, const ResidualProjection::Products& products,
                                    Eigen::Index first, const Eigen::VectorXd& strengths) {
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(strengths.size());
  return only_place(likelihood, products.residual_with(first, none), products.residual_with(first, strengths), 0);
}

/// Each family by itself, its columns with a standard normal prior.
void test_families(const LikelihoodModel& likelihood, const HypothesisFit& fit, const ResidualProjection& projection,
                   Best& best) {
  const GenericColumns generic = generic_columns(likelihood, fit);
  Columns white = generic.columns;
  likelihood.whiten(white);
  const ResidualProjection::Products products = projection.of(white);
  for (const ColumnFamily& f : generic.families) {
    const Eigen::MatrixXd own_gram = products.gram(f.first, f.count);
    Eigen::MatrixXd regular = own_gram;
    regular.diagonal().array() += 1;
    const Eigen::LDLT<Eigen::MatrixXd> solver(regular);
    const Eigen::VectorXd toward = products.toward().segment(f.first, f.count), x = solver.solve(toward);
    // what the columns gain on noise alone: the trace of what they can follow
    const double freedom = solver.solve(own_gram).trace(),
                 gain = toward.dot(x) - residual_limits.gain_per_freedom * freedom;
    if (gain <= best.gain) continue;
    best = {gain, f.depends_on, generic.columns.middleCols(f.first, f.count) * x,
            place_of(likelihood, products, f.first, x)};
  }
}

/// The frequency that gains most, and its amplitudes.
struct BestWave {
  double gain = 0, frequency_hz = 0;
  Eigen::Vector2d amplitudes = Eigen::Vector2d::Zero();
};

BestWave best_of(const LikelihoodModel& likelihood, const ResidualProjection& projection,
                 std::span<const double> frequencies_hz) {
  Columns white = sine_columns(likelihood, frequencies_hz);
  likelihood.whiten(white);
  const ResidualProjection::Products products = projection.of(white);
  BestWave best;
  for (std::size_t k = 0; k < frequencies_hz.size(); ++k) {
    const Eigen::Index first = 2 * static_cast<Eigen::Index>(k);
    const Eigen::Matrix2d g = products.gram(first, 2);
    const Eigen::Vector2d b = products.toward().segment(first, 2);
    const Eigen::Vector2d x =
        (g + numerics.grid.sine_ridge * g.diagonal().maxCoeff() * Eigen::Matrix2d::Identity()).ldlt().solve(b);
    const double gain = b.dot(x) - residual_limits.gain_of_frequencies;
    if (gain > best.gain) best = {gain, frequencies_hz[k], x};
  }
  return best;
}

void test_frequencies(const LikelihoodModel& likelihood, const ResidualProjection& projection, Best& best) {
  const std::vector<double> all_hz = strange_frequencies(likelihood.records().front());
  constexpr std::size_t at_once = numerics.grid.frequencies_at_once;
  std::vector<BestWave> waves((all_hz.size() + at_once - 1) / at_once);
  numerics::in_parallel(waves.size(), [&](std::size_t k) {
    const std::size_t first = k * at_once;
    waves[k] =
        best_of(likelihood, projection, std::span(all_hz).subspan(first, std::min(at_once, all_hz.size() - first)));
  });
  for (const BestWave& wave : waves) {
    if (wave.gain <= best.gain) continue;
    const double hz = wave.frequency_hz;
    best = {wave.gain, "a period of its own", sine_columns(likelihood, {&hz, 1}) * wave.amplitudes};
  }
}

/// Distribution of the whitened residual: too wide, or with outliers.
void test_distribution(const Eigen::VectorXd& residual, ResidualTest& found) {
  std::vector<double> squares;
  for (const double r : residual) {
    if (r != 0) squares.push_back(r * r);
  }
  if (squares.size() <= residual_limits.rows) return;
  const double far2 = residual_limits.far_sigma * residual_limits.far_sigma;
  double sum = 0;
  for (const double s : squares) sum += std::min(s, far2);  // winsorised: a few bad samples are no excess
  const auto count = static_cast<double>(squares.size());
  found.fast_excess = sum / count - 1;
  // what lies within the tolerance is not far out
  const double variance = std::max(measurement::upper_median(squares) / numerics.statistics.chi_square_median, 1.0);
  const auto far = std::count_if(squares.begin(), squares.end(), [&](double s) { return s > far2 * variance; });
  found.far_out = static_cast<double>(far) / count;
}

}  // namespace

ResidualTest test_residual(const LikelihoodModel& likelihood, const HypothesisFit& fit) {
  const ResidualProjection projection(likelihood, fit);
  Best best{0, "", Eigen::VectorXd::Zero(static_cast<Eigen::Index>(likelihood.samples()))};
  test_families(likelihood, fit, projection, best);
  test_frequencies(likelihood, projection, best);
  ResidualTest found;
  found.gain = best.gain;
  found.family = best.family;
  found.only_place = best.only_place;
  // checks of an instrument say nothing of how well the cell is explained
  test_distribution(fit.residual.head(static_cast<Eigen::Index>(likelihood.readings())), found);
  Eigen::Index row = 0;
  for (const PreparedRecording& r : likelihood.records()) {
    std::vector<double>& e = found.energy.emplace_back(r.size());
    for (std::size_t k = 0; k < r.size(); ++k, ++row) e[k] = best.explained_v[row] * best.explained_v[row];
  }
  found.spans = strongest_spans(likelihood.records().front(), found.energy.front());
  return found;
}

}  // namespace bms::diagnosis
