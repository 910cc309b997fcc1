#include "ammeter/ammeter_by_cell.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/LU>

#include <fmt/format.h>

#include "measurement/thinned_recording.hpp"
#include "replay/simulation.hpp"

namespace bms::ammeter {

namespace {

using Vector = Eigen::VectorXd;
using Matrix = Eigen::MatrixXd;

enum Unknown : Eigen::Index { initial_soc, offset, gain, r0, r1, unknowns };
using Values = Eigen::Matrix<double, unknowns, 1>;

constexpr std::size_t most_blocks = 400, fewest_blocks = 15;
constexpr double shortest_block_s = 10;
/// Standard deviations before the log: nothing is known of the initial state of charge; the offset is below 10 % of 1C;
/// gain and capacity are good to 5 %; resistances change by half over a life.
constexpr double soc_prior = 0.5, offset_prior_c = 0.1, gain_prior = 0.05, resistance_prior = 0.5;
constexpr double relaxation_s = 3'600, ocv_correlation_soc = 0.05, plateau_soc = 0.3;
constexpr int most_iterations = 25;
constexpr std::size_t most_starts = 6;
/// The cell file may be off by so many times what it states, in each block or slowly: the noise of the fit grows with
/// it, and so do the standard deviations of the result. Beyond it the file does not describe the log.
constexpr double worst_scale = 2;
constexpr int scale_rounds = 3;
constexpr std::size_t most_fit_rows = 5'000;
constexpr double worst_gain = 0.1;     ///< beyond it the cell file has another capacity
constexpr double same_cost = 6;        ///< two starts whose costs differ by less explain the log equally well
constexpr double visible_share = 0.2;  ///< of the prior: an offset that is less certain is not visible

/// A part of the log whose readings are averaged.
struct Block {
  std::size_t begin = 0, end = 0, readings = 0;
  double time_s = 0;
};

std::vector<Block> blocks_of(const measurement::Recording& r) {
  const double length_s = std::max(shortest_block_s, r.duration_s() / static_cast<double>(most_blocks));
  std::vector<Block> blocks;
  for (std::size_t k = 0; k < r.rows();) {
    Block b{k, k, 0, r.time_s[k]};
    while (b.end < r.rows() && r.time_s[b.end] - r.time_s[k] < length_s) {
      if (std::isfinite(r.voltage_v[b.end])) ++b.readings;
      ++b.end;
    }
    k = b.end = std::max(b.end, k + 1);
    b.time_s = 0.5 * (r.time_s[b.begin] + r.time_s[b.end - 1]);
    if (b.readings > 0) blocks.push_back(b);
  }
  return blocks;
}

class Fit {
 public:
  Fit(const measurement::Recording& recording, const files::CellFile& cell)
      : recording_(recording), file_(cell), blocks_(blocks_of(recording)) {
    const double one_c_a = cell.parameters.capacity_ah;
    prior_ << soc_prior, offset_prior_c * one_c_a, gain_prior, resistance_prior, resistance_prior;
    step_ << 1e-4, 1e-4 * one_c_a, 1e-4, 1e-3, 1e-3;
  }

  struct Result {
    Values values = Values::Zero();
    double cost = std::numeric_limits<double>::infinity();
  };

  /// exact: the gain stays at 0.
  Result from(const Values& start, bool exact = false) {
    exact_gain_ = exact;
    Result best;
    best.values = start;
    weigh(best.values);
    best.cost = cost_of(best.values);
    for (int k = 0; k < most_iterations; ++k) {
      const Values step = newton_step(best.values);
      Result next = best;
      double share = 1;
      for (; share > 1e-3; share /= 2) {
        next.values = limited(best.values + share * step);
        next.cost = cost_of(next.values);
        if (next.cost < best.cost) break;
      }
      const double gained = best.cost - next.cost;
      if (!(gained > 0)) break;
      best = next;
      if (k == most_iterations / 2) {  // the noise along the state of charge, at the better place
        weigh(best.values);
        best.cost = cost_of(best.values);
      } else if (gained < 1e-3) {
        break;
      }
    }
    return best;
  }
  /// The noise at these values, for comparing results of several starts.
  double cost_with_noise_at(const Values& noise_at, const Values& values) {
    weigh(noise_at);
    return cost_of(values);
  }

  /// Covariance of the unknowns by the noise model, at these values.
  Eigen::Matrix<double, unknowns, unknowns> covariance(const Values& values) {
    weigh(values);
    const Matrix j = factor_.matrixL().solve(sensitivity(values));
    Eigen::Matrix<double, unknowns, unknowns> information = j.transpose() * j;
    information.diagonal() += prior_.cwiseInverse().cwiseAbs2();
    return information.inverse();
  }
  /// By how much the errors at these values exceed what the cell file states: quickly (whitened) or slowly (RMS).
  double excess(const Values& values) {
    weigh(values);
    const Vector white = factor_.matrixL().solve(block_errors(row_errors(values)));
    const double chi2 =
        white.squaredNorm() / std::max(1.0, static_cast<double>(blocks_.size()) - static_cast<double>(unknowns));
    return scale_ * std::max(std::sqrt(chi2), rms(values) / expected_rms_);
  }
  /// Standard deviations of the noise in those of the cell file.
  double scale() const { return scale_; }
  void set_scale(double scale) { scale_ = scale; }
  double rms(const Values& values) const {
    const Vector e = block_errors(row_errors(values));
    return e.size() == 0 ? 0 : std::sqrt(e.squaredNorm() / static_cast<double>(e.size()));
  }
  std::size_t blocks() const { return blocks_.size(); }
  const Values& prior() const { return prior_; }

  std::vector<double> row_errors(const Values& v) const { return row_errors(v, recording_); }
  std::vector<double> row_errors(const Values& v, const measurement::Recording& recording) const {
    const auto rows = simulated(v, recording);
    std::vector<double> error(rows.size());
    for (std::size_t k = 0; k < rows.size(); ++k) error[k] = recording.voltage_v[k] - rows[k].voltage_v;
    return error;
  }

 private:
  static Values limited(Values v) {
    v[initial_soc] = std::clamp(v[initial_soc], 0.0, 1.0);
    v[gain] = std::clamp(v[gain], -0.3, 0.3);
    for (const Unknown r : {r0, r1}) v[r] = std::clamp(v[r], -0.8, 4.0);
    return v;
  }

  std::vector<replay::SimulatedRow> simulated(const Values& v, const measurement::Recording& r) const {
    auto parameters = file_.parameters;
    for (std::size_t k = 0; k < parameters.rc.soc.size; ++k) {
      parameters.rc.r0_ohm[k] *= 1 + v[r0];
      parameters.rc.r1_ohm[k] *= 1 + v[r1];
      parameters.rc.c1_f[k] /= 1 + v[r1];
    }
    const auto tables = model::prepare<double, model::max_intervals>(parameters);
    std::vector<double> current_a(r.rows());
    for (std::size_t k = 0; k < current_a.size(); ++k) current_a[k] = (r.current_a[k] - v[offset]) / (1 + v[gain]);
    return replay::simulate({.cell = tables,
                             .capacity_ah = parameters.capacity_ah,
                             .mechanisms = file_.mechanisms,
                             .time_s = {r.time_s.data(), r.rows()},
                             .current_a = current_a,
                             .temperature_c = {r.temperature_c.data(), r.temperature_c.size()},
                             .initial_soc = v[initial_soc]});
  }

  Vector block_errors(const std::vector<double>& error_v) const {
    Vector e(static_cast<Eigen::Index>(blocks_.size()));
    for (std::size_t b = 0; b < blocks_.size(); ++b) {
      double sum = 0;
      for (std::size_t k = blocks_[b].begin; k < blocks_[b].end; ++k) {
        if (std::isfinite(error_v[k])) sum += error_v[k];
      }
      e[static_cast<Eigen::Index>(b)] = sum / static_cast<double>(blocks_[b].readings);
    }
    return e;
  }

  double cost_of(const Values& v) const {
    const Vector white = factor_.matrixL().solve(block_errors(row_errors(v)));
    Values known = v;
    known[initial_soc] = 0;  // nothing is known before
    return white.squaredNorm() + known.cwiseQuotient(prior_).squaredNorm();
  }

  Matrix sensitivity(const Values& v) const {
    const Vector base = block_errors(row_errors(v));
    Matrix j(base.size(), static_cast<Eigen::Index>(unknowns));
    for (Eigen::Index u = 0; u < unknowns; ++u) {
      Values moved = v;
      const double step = u == initial_soc && v[u] > 0.5 ? -step_[u] : step_[u];
      moved[u] += step;
      j.col(u) = (block_errors(row_errors(moved)) - base) / step;
    }
    return j;
  }

  Values newton_step(const Values& v) const {
    const Matrix j = factor_.matrixL().solve(sensitivity(v));
    const Vector e = factor_.matrixL().solve(block_errors(row_errors(v)));
    Eigen::Matrix<double, unknowns, unknowns> information = j.transpose() * j;
    information.diagonal() += prior_.cwiseInverse().cwiseAbs2();
    Values known = v.cwiseQuotient(prior_.cwiseAbs2());
    known[initial_soc] = 0;
    Values gradient = j.transpose() * e + known;
    if (exact_gain_) {
      information.row(gain).setZero();
      information.col(gain).setZero();
      information(gain, gain) = 1;
      gradient[gain] = 0;
    }
    return -information.ldlt().solve(gradient);
  }

  /// What the cell file states about its own errors: of the OCV over a few per cent of the state of charge, and of the
  /// voltage at rest over an hour, over a plateau, and over the whole log (a sensor of the voltage, an entropy).
  double covariance_of(const Block& a, const Block& b, const std::vector<replay::SimulatedRow>& rows) const {
    const model::Noise& n = file_.parameters.noise;
    const model::Tolerance& t = file_.parameters.tolerance;
    const double apart_s = std::abs(a.time_s - b.time_s), apart_soc = rows[a.begin].soc - rows[b.begin].soc;
    const auto along = [&](double correlated_soc) {
      return std::exp(-0.5 * apart_soc * apart_soc / (correlated_soc * correlated_soc));
    };
    const double model_s = std::max(1.0, n.model_correlation_s * model::persistent_error_correlations);
    return t.ocv_v * t.ocv_v * along(ocv_correlation_soc) +
           n.rest_v * n.rest_v * (std::exp(-apart_s / relaxation_s) + along(plateau_soc) + 1) +
           n.model_v * n.model_v * std::exp(-apart_s / model_s);
  }

  /// The noise of the blocks.
  void weigh(const Values& v) {
    const auto rows = simulated(v, recording_);
    const model::Noise& n = file_.parameters.noise;
    const auto count = static_cast<Eigen::Index>(blocks_.size());
    Matrix c(count, count);
    for (Eigen::Index a = 0; a < count; ++a) {
      const Block& block = blocks_[static_cast<std::size_t>(a)];
      for (Eigen::Index b = 0; b <= a; ++b) {
        const Block& other = blocks_[static_cast<std::size_t>(b)];
        c(a, b) = c(b, a) = covariance_of(block, other, rows);
      }
      c(a, a) += n.voltage_v * n.voltage_v / static_cast<double>(block.readings) + 1e-10;
    }
    c *= scale_ * scale_;
    expected_rms_ = std::sqrt(c.diagonal().mean());
    factor_.compute(c);
  }

  const measurement::Recording& recording_;
  const files::CellFile& file_;
  std::vector<Block> blocks_;
  Values prior_, step_;
  Eigen::LLT<Matrix> factor_;
  double expected_rms_ = 0, scale_ = 1;
  bool exact_gain_ = false;
};

/// Places from which the fit begins: over all states of charge and offsets, those whose voltage is nearest to the
/// measured one, none close to another.
std::vector<Values> starts_of(const Fit& fit) {
  struct Place {
    Values values;
    double rms_v;
  };
  std::vector<Place> places;
  for (int soc = 1; soc <= 20; ++soc) {
    for (int share = -8; share <= 8; ++share) {
      Place place{Values::Zero(), 0};
      place.values[initial_soc] = 0.05 * soc - 0.02;
      place.values[offset] = 0.125 * share * fit.prior()[offset];
      place.rms_v = fit.rms(place.values);
      places.push_back(place);
    }
  }
  std::sort(places.begin(), places.end(), [](const Place& a, const Place& b) { return a.rms_v < b.rms_v; });
  std::vector<Values> starts;
  for (const Place& place : places) {
    const bool near = std::any_of(starts.begin(), starts.end(), [&](const Values& other) {
      const Values apart = (place.values - other).cwiseAbs();
      return apart[initial_soc] < 0.12 && apart[offset] < 0.3 * fit.prior()[offset];
    });
    if (!near) starts.push_back(place.values);
    if (starts.size() == most_starts) break;
  }
  return starts;
}

/// Results of several starts, the best first, under the noise that the smallest residual shows.
std::vector<Fit::Result> results_of(Fit& fit) {
  std::vector<Fit::Result> results;
  for (const Values& start : starts_of(fit)) results.push_back(fit.from(start));
  const auto smallest = [&] {
    return std::min_element(results.begin(), results.end(),
                            [&](const auto& a, const auto& b) { return fit.rms(a.values) < fit.rms(b.values); })
        ->values;
  };
  double scale = 1;
  for (int k = 0; k < scale_rounds; ++k) {
    const double wanted = std::max(1.0, fit.excess(smallest()));
    if (wanted < 1.05 * scale || wanted > worst_scale) break;
    fit.set_scale(scale = wanted);
    for (Fit::Result& r : results) r = fit.from(r.values);
  }
  // the noise depends on the place; the smallest residual decides under which noise all of them are compared
  const Values at = smallest();
  for (Fit::Result& r : results) r.cost = fit.cost_with_noise_at(at, r.values);
  std::sort(results.begin(), results.end(), [](const auto& a, const auto& b) { return a.cost < b.cost; });
  return results;
}

}  // namespace

AmmeterByCell ammeter_by_cell(const measurement::Recording& recording, const files::CellFile& cell) {
  AmmeterByCell found;
  const measurement::Recording rows = measurement::thinned(recording, most_fit_rows);
  Fit fit(rows, cell);
  if (fit.blocks() < fewest_blocks) {
    found.offset_a.why = "the log is too short; some hours with a rest would show it";
    return found;
  }
  const auto results = results_of(fit);
  const Values& best = results.front().values;
  const auto covariance = fit.covariance(best);
  // the noise was scaled by another result, or not to the end
  const double excess = fit.excess(best), widened = std::max(1.0, excess / fit.scale());
  const auto std_of = [&](Unknown u) { return widened * std::sqrt(covariance(u, u)); };
  found.residual_v = fit.rms(best);
  found.error_v = fit.row_errors(best, recording);
  found.r0_times = 1 + best[r0];
  found.gain_and_capacity = {best[gain], std_of(gain)};
  found.gain_visible = std_of(gain) < 0.5 * gain_prior;
  // a gain that is off by more than assumed takes the offset with it
  Values without_gain = best;
  without_gain[gain] = 0;
  const double moved_a = fit.from(without_gain, true).values[offset] - best[offset];
  const Uncertain offset_a{best[offset], std::hypot(std_of(offset), moved_a)};
  const auto other = std::find_if(results.begin(), results.end(), [&](const Fit::Result& r) {
    return r.cost < results.front().cost + same_cost && std::abs(r.values[offset] - best[offset]) > 3 * offset_a.std;
  });
  if (excess > worst_scale)
    found.offset_a.why = fmt::format(
        "the cell file does not describe this log, it is off by {:.1f} mV RMS; "
        "bms diagnose finds why",
        1e3 * found.residual_v);
  else if (std::abs(best[gain]) > worst_gain || std::max(best[r0], best[r1]) > 1 || std::min(best[r0], best[r1]) < -0.5)
    found.offset_a.why = fmt::format(
        "the cell file does not describe this log: it would need a charge balance that is off by {:+.0f} %, and {:.1f} "
        "and {:.1f} times the R0 and R1; bms diagnose finds why",
        100 * best[gain], 1 + best[r0], 1 + best[r1]);
  else if (other != results.end())
    found.offset_a.why = fmt::format(
        "offsets of {} and {} explain the log equally well; a log with a rest near full or near empty would "
        "show which",
        amperes(best[offset]), amperes(other->values[offset]));
  else if (offset_a.std > visible_share * fit.prior()[offset])
    found.offset_a.why = fmt::format("only to {}; a longer log, with a rest near full or near empty, would show it",
                                     amperes(offset_a.std));
  else
    found.offset_a.value = offset_a;
  return found;
}

}  // namespace bms::ammeter
