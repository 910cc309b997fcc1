#include "diagnosis/instrument_comparison.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <Eigen/Dense>

#include "diagnosis/mechanism.hpp"
#include "diagnosis/numerics.hpp"
#include "diagnosis/thresholds.hpp"
#include "measurement/statistics.hpp"
#include "numerics/matrix_factors.hpp"

namespace bms::diagnosis {

namespace {

constexpr const Thresholds::References& compare_limits = thresholds.references;

/// A cause of a difference: its mechanism, and what it does to each row at strength 1.
struct Effect {
  std::size_t mechanism;
  Eigen::VectorXd by_row;
  double tolerance = 0;  ///< of the strength: a smaller one does not count
};

/// The difference of an instrument from the trusted one, all recordings one after the other.
struct Difference {
  Eigen::VectorXd error;  ///< read - trusted [A or V]
  std::vector<Effect> effects;
  Eigen::VectorXd time_s;
  std::vector<Eigen::Index> block_ends;  ///< blocks whose errors are independent of each other
  double own = 0;                        ///< standard deviation of the trusted instrument's reading
};

struct Fit {
  Eigen::VectorXd strength, residual;
  double cost = std::numeric_limits<double>::infinity();
};

/// Weighted least squares of some of the effects.
Fit fit_of(const Difference& d, const std::vector<std::size_t>& chosen, const Eigen::VectorXd& weight) {
  Fit fit{Eigen::VectorXd(static_cast<Eigen::Index>(chosen.size())), d.error, 0};
  if (!chosen.empty()) {
    Eigen::MatrixXd columns(d.error.size(), static_cast<Eigen::Index>(chosen.size()));
    for (std::size_t k = 0; k < chosen.size(); ++k)
      columns.col(static_cast<Eigen::Index>(k)) = d.effects[chosen[k]].by_row;
    const Eigen::MatrixXd weighted = weight.asDiagonal() * columns;
    fit.strength = numerics::solve_least_squares(weighted, weight.cwiseProduct(d.error));
    fit.residual -= columns * fit.strength;
  }
  fit.cost = weight.cwiseProduct(fit.residual).squaredNorm();
  return fit;
}

/// Factor on a variance because neighbouring residuals are alike.
double correlation_of(const Difference& d, const Eigen::VectorXd& residual) {
  double alone = 0, together = 0;
  Eigen::Index from = 0;
  for (const Eigen::Index end : d.block_ends) {
    const auto block = residual.segment(from, end - from);
    alone += block.squaredNorm();
    together += block.sum() * block.sum();
    from = end;
  }
  return alone > 0 ? std::max(1.0, together / alone) : 1;
}

/// 1 / standard deviation of each row: the scatter that no effect explains, and an error that wanders by a share of
/// itself over the whole recording, so that all its rows count as one.
Eigen::VectorXd weights_of(const Difference& d) {
  std::vector<std::size_t> all(d.effects.size());
  for (std::size_t k = 0; k < all.size(); ++k) all[k] = k;
  const Fit rough = fit_of(d, all, Eigen::VectorXd::Ones(d.error.size()));
  std::vector<double> size(static_cast<std::size_t>(d.error.size()));
  for (std::size_t k = 0; k < size.size(); ++k) size[k] = std::abs(rough.residual[static_cast<Eigen::Index>(k)]);
  const double scatter = std::max(d.own, measurement::median(size) / numerics.statistics.normal_abs_median),
               common = scatter * scatter * correlation_of(d, rough.residual),
               wander =
                   compare_limits.unsteady_share * compare_limits.unsteady_share * static_cast<double>(d.error.size());
  return (common + wander * d.error.array().square()).sqrt().inverse();
}

double score_of(const Fit& fit, std::size_t chosen) {
  return fit.cost + thresholds.decision.per_unknown * static_cast<double>(chosen);
}

/// The effects that together explain most for what they cost.
std::vector<std::size_t> best_of(const Difference& d, const std::vector<std::size_t>& allowed,
                                 const Eigen::VectorXd& weight) {
  std::vector<std::size_t> best;
  double least = score_of(fit_of(d, {}, weight), 0);
  for (std::size_t subset = 1; subset < (std::size_t{1} << allowed.size()); ++subset) {
    std::vector<std::size_t> chosen;
    for (std::size_t k = 0; k < allowed.size(); ++k) {
      if (((subset >> k) & 1) != 0) chosen.push_back(allowed[k]);
    }
    const double score = score_of(fit_of(d, chosen, weight), chosen.size());
    if (score >= least) continue;
    least = score;
    best = chosen;
  }
  return best;
}

/// Standard deviations that contain what is common to a block.
Eigen::VectorXd deviations_of(const Difference& d, const std::vector<std::size_t>& chosen, const Fit& fit,
                              const Eigen::VectorXd& weight) {
  const auto n = static_cast<Eigen::Index>(chosen.size());
  Eigen::MatrixXd columns(d.error.size(), n);
  for (Eigen::Index k = 0; k < n; ++k) columns.col(k) = d.effects[chosen[static_cast<std::size_t>(k)]].by_row;
  const Eigen::VectorXd squares = weight.array().square();
  const Eigen::MatrixXd inverse = (columns.transpose() * squares.asDiagonal() * columns).inverse();
  Eigen::MatrixXd middle = Eigen::MatrixXd::Zero(n, n);
  Eigen::Index from = 0;
  for (const Eigen::Index end : d.block_ends) {
    const Eigen::VectorXd slope =
        columns.middleRows(from, end - from).transpose() *
        squares.segment(from, end - from).cwiseProduct(fit.residual.segment(from, end - from));
    middle += slope * slope.transpose();
    from = end;
  }
  Eigen::VectorXd deviation = (inverse * middle * inverse).diagonal().cwiseMax(0).cwiseSqrt();
  for (Eigen::Index k = 0; k < n; ++k)  // and of the trusted instrument itself
    deviation[k] =
        std::hypot(deviation[k], d.own / std::sqrt(columns.col(k).squaredNorm() / static_cast<double>(columns.rows())));
  return deviation;
}

/// Returns true if the effect at its largest is more than the trusted instrument's own error. A gain is not, where no
/// current flows.
bool can_be_seen(const Effect& e, const Difference& d, const model::CellParameters<>& cell) {
  return e.by_row.lpNorm<Eigen::Infinity>() * model::catalogue[e.mechanism].parameter[0].upper(cell.capacity_ah) >
         d.own;
}

void add_errors(const Difference& all, const model::CellParameters<>& cell, std::vector<InstrumentError>& errors) {
  if (all.error.size() == 0) return;
  Difference d = all;
  std::erase_if(d.effects, [&](const Effect& e) { return !can_be_seen(e, all, cell); });
  const Eigen::VectorXd weight = weights_of(d);
  std::vector<std::size_t> allowed(d.effects.size());
  for (std::size_t k = 0; k < allowed.size(); ++k) allowed[k] = k;
  for (;;) {
    const std::vector<std::size_t> chosen = best_of(d, allowed, weight);
    const Fit fit = fit_of(d, chosen, weight);
    std::vector<double> gains;
    std::optional<std::size_t> weakest;
    for (std::size_t k = 0; k < chosen.size(); ++k) {
      std::vector<std::size_t> less = chosen;
      less.erase(less.begin() + static_cast<std::ptrdiff_t>(k));
      gains.push_back(fit_of(d, less, weight).cost - fit.cost);
      const bool none = std::abs(fit.strength[static_cast<Eigen::Index>(k)]) < d.effects[chosen[k]].tolerance;
      if ((none || gains[k] < thresholds.decision.detected) && (!weakest || gains[k] < gains[*weakest])) weakest = k;
    }
    if (weakest) {
      std::erase(allowed, chosen[*weakest]);
      continue;
    }
    if (chosen.empty()) return;
    const Eigen::VectorXd deviation = deviations_of(d, chosen, fit, weight);
    for (std::size_t k = 0; k < chosen.size(); ++k) {
      InstrumentError e{model::default_setting(d.effects[chosen[k]].mechanism, cell), gains[k], {}};
      e.setting.value[0] = fit.strength[static_cast<Eigen::Index>(k)];
      e.setting.deviation[0] = deviation[static_cast<Eigen::Index>(k)];
      const model::Parameter& p = model::catalogue[e.setting.index].parameter[0];
      e.setting.value[0] = std::clamp(e.setting.value[0], p.lower(cell.capacity_ah), p.upper(cell.capacity_ah));
      for (const std::size_t other : allowed) {
        std::vector<std::size_t> instead = chosen;
        if (std::find(chosen.begin(), chosen.end(), other) != chosen.end()) continue;
        instead[k] = other;
        if (fit_of(d, instead, weight).cost - fit.cost < thresholds.decision.tie)
          e.equivalent_to.push_back(d.effects[other].mechanism);
      }
      errors.push_back(std::move(e));
    }
    return;
  }
}

/// Rows of all recordings in which both instruments read.
struct Both {
  std::vector<double> error, trusted, current_a;
  std::vector<Eigen::Index> block_ends;

  void add(const PreparedRecording& r, const measurement::Column& read, const measurement::Column& reference) {
    const std::size_t before = error.size(), blocks = numerics.statistics.blocks;
    for (std::size_t block = 0; block < blocks; ++block) {
      for (std::size_t k = block * r.size() / blocks; k < (block + 1) * r.size() / blocks; ++k) {
        const double a = r.current_ref_a.empty() ? r.current_a[k] : r.current_ref_a[k];
        if (!std::isfinite(read[k]) || !std::isfinite(reference[k]) || !std::isfinite(a)) continue;
        error.push_back(read[k] - reference[k]);
        trusted.push_back(reference[k]);
        current_a.push_back(a);
      }
      const auto end = static_cast<Eigen::Index>(error.size());
      if (end > static_cast<Eigen::Index>(before) && (block_ends.empty() || end > block_ends.back()))
        block_ends.push_back(end);
    }
  }
  bool any() const { return !error.empty(); }
};

Eigen::VectorXd vector_of(const std::vector<double>& values) {
  return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

double largest(const std::vector<double>& values) {
  double most = 0;
  for (const double v : values) most = std::max(most, std::abs(v));
  return most;
}

}  // namespace

bool has_trusted(const PreparedRecording& r, Check::Channel channel) {
  return !(channel == Check::Channel::current ? r.current_ref_a : r.voltage_ref_v).empty();
}

bool is_inverted(const PreparedRecording& r) {
  double product = 0;
  for (std::size_t k = 0; k < r.size() && !r.current_ref_a.empty(); ++k) {
    const double p = r.current_a[k] * r.current_ref_a[k];
    product += std::isfinite(p) ? p : 0;
  }
  return product < 0;
}

std::vector<InstrumentError> compare_instruments(const std::vector<PreparedRecording>& records,
                                                 const model::CellParameters<>& cell) {
  Both current, voltage;
  for (const PreparedRecording& r : records) {
    if (has_trusted(r, Check::Channel::current)) current.add(r, r.current_a, r.current_ref_a);
    if (has_trusted(r, Check::Channel::voltage)) voltage.add(r, r.voltage_v, r.voltage_ref_v);
  }
  std::vector<InstrumentError> errors;
  const auto ones = [](const Both& b) { return Eigen::VectorXd::Ones(static_cast<Eigen::Index>(b.error.size())); };
  constexpr const Thresholds::Calibration& tolerated = thresholds.calibration;
  if (current.any()) {
    add_errors({vector_of(current.error),
                {{model::mechanism_index_of<model::CurrentGain>, vector_of(current.trusted), tolerated.gain_sigma},
                 {model::mechanism_index_of<model::CurrentOffset>, ones(current),
                  tolerated.offset_at_most_c * cell.capacity_ah}},
                {},
                current.block_ends,
                compare_limits.meter_c * cell.capacity_ah},
               cell, errors);
  }
  if (voltage.any()) {
    const double drift_v = cell.tolerance.drift_v;
    add_errors({vector_of(voltage.error),
                {{model::mechanism_index_of<model::ContactStep>, vector_of(voltage.current_a),
                  drift_v / std::max(largest(voltage.current_a), std::numeric_limits<double>::min())},
                 {model::mechanism_index_of<model::VoltageOffset>, ones(voltage), drift_v},
                 {model::mechanism_index_of<model::VoltageGain>, vector_of(voltage.trusted),
                  drift_v / std::max(largest(voltage.trusted), std::numeric_limits<double>::min())}},
                {},
                voltage.block_ends,
                compare_limits.meter_v},
               cell, errors);
  }
  // what is seen from the first row on; not in a recording before the first with a trusted voltmeter
  const PreparedRecording& first = records.front();
  for (InstrumentError& e : errors) {
    if (e.setting.index == model::mechanism_index_of<model::ContactStep>)
      e.setting.value[contact_onset] =
          has_trusted(first, Check::Channel::voltage) ? first.time_s.front() : first.time_s.back() + 1;
  }
  std::stable_sort(errors.begin(), errors.end(),
                   [](const InstrumentError& a, const InstrumentError& b) { return a.gain > b.gain; });
  return errors;
}

}  // namespace bms::diagnosis
