#include "identification/joint_fit.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "arithmetic/dual_number.hpp"
#include "identification/uncertainty.hpp"
#include "model/corrected_readings.hpp"
#include "numerics/in_parallel.hpp"

namespace bms::identification {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr std::size_t lanes = 16;  ///< derivatives of one pass
using Jet = arithmetic::DualNumber<lanes>;
using Tables = model::Cell<double, model::max_intervals>;

constexpr double robust_v = 0.03, sigma_v = 0.003, prior_weight = 0.1;
constexpr std::size_t per_recording = 2;   ///< r0_change, branch_position
constexpr std::size_t initial_branch = 3;  ///< parameter of ocv_hysteresis

/// Everything of a simulation that the unknowns change.
template <class S>
struct Values {
  S r0{1}, r1{1}, c1{1};  ///< factors of the tables
  std::vector<model::MechanismValues<S>> mechanisms;
};

template <class S>
Values<S> values_of(const JointModel& m) {
  Values<S> v;
  for (const model::MechanismSetting& setting : m.mechanisms) {
    model::MechanismValues<S>& own = v.mechanisms.emplace_back();
    for (std::size_t k = 0; k < own.size(); ++k) own[k] = S(setting.value[k]);
  }
  return v;
}

template <class S>
void put(const JointModel& m, const JointUnknown& unknown, const S& value, Values<S>& into) {
  switch (unknown.of) {
    case JointUnknown::Of::r0:
      into.r0 = value / mean_of(m.cell.rc.r0_ohm);
      return;
    case JointUnknown::Of::r1:
      into.r1 = value / mean_of(m.cell.rc.r1_ohm);
      return;
    case JointUnknown::Of::c1:
      into.c1 = value / mean_of(m.cell.rc.c1_f);
      return;
    case JointUnknown::Of::mechanism:
      into.mechanisms[place_of(m, unknown.mechanism)][unknown.parameter] = value;
  }
}

/// What belongs to the recording is put on top of the cell's values.
template <class S>
void put(const JointModel& m, const S& r0_change, const S& branch_position, Values<S>& into) {
  into.r0 = into.r0 * (S(1) + r0_change);
  for (std::size_t k = 0; k < m.mechanisms.size(); ++k) {
    if (m.mechanisms[k].index == model::mechanism_index_of<model::OcvHysteresis>)
      into.mechanisms[k][initial_branch] = branch_position;
  }
}

/// Calls row(k, voltage, soc) for each row.
template <class S, class Row>
void run(const JointModel& m, const Tables& tables, const Values<S>& values, const JointRecording& r, Row&& row) {
  model::ChosenLaws<S> laws;
  double delay_s = 0, lag_s = 0;
  for (std::size_t k = 0; k < m.mechanisms.size(); ++k) {
    const model::MechanismSetting& setting = m.mechanisms[k];
    model::choose<S, S>(laws, setting.index, values.mechanisms[k], m.cell.capacity_ah);
    if (setting.index == model::mechanism_index_of<model::ChannelSkew>) delay_s = setting.value[0];
    if (setting.index == model::mechanism_index_of<model::TemperatureSensor>) lag_s = setting.value[1];
  }
  const model::CorrectedReadings<double> readings(r.data.time_s, r.data.current_a, r.temperature_c, delay_s, lag_s);
  model::OpenLoopSimulation<S> simulation(tables, m.cell.capacity_ah, laws, S(r.initial_soc));
  const auto adjust = [&](model::TablePoint<S>& at, const S&) {
    model::mechanism_detail::scale<S>(at.r0_ohm, at.r0_delta_ohm, values.r0);
    model::mechanism_detail::scale<S>(at.r1_ohm, at.r1_delta_ohm, values.r1);
    at.c1_f = at.c1_f * values.c1;
  };
  for (std::size_t k = 0; k < r.data.size(); ++k) {
    const double duration_s = k == 0 ? 0 : r.data.time_s[k] - r.data.time_s[k - 1];
    const S v = simulation.step(r.data.time_s[k], duration_s, S(readings.current(k) + r.current_correction_a),
                                S(readings.temperature(k)), adjust);
    row(k, v, simulation.soc());
  }
}

/// The unknowns of the search: those of the cell, then r0_change and branch_position of each recording.
class JointProblem {
 public:
  JointProblem(const JointModel& m, std::span<const JointRecording> recordings, const JointOptions& options)
      : model_(m),
        recordings_(recordings),
        options_(options),
        tables_(model::prepare<double, model::max_intervals>(m.cell)) {
    if (recordings.empty()) throw std::invalid_argument("joint fit: no recordings");
    first_row_.push_back(0);
    for (const JointRecording& r : recordings) {
      std::vector<std::size_t> with_voltage, used;
      for (std::size_t k = 0; k < r.data.size(); ++k) {
        if (std::isfinite(r.data.voltage_v[k])) with_voltage.push_back(k);
      }
      if (with_voltage.empty()) throw std::invalid_argument(r.name + ": no voltage in the range that counts");
      const std::size_t stride = (with_voltage.size() + options.rows - 1) / options.rows;
      for (std::size_t k = 0; k < with_voltage.size(); k += stride) used.push_back(with_voltage[k]);
      first_row_.push_back(first_row_.back() + used.size());
      used_.push_back(std::move(used));
    }
  }

  Index unknowns() const { return static_cast<Index>(cell_unknowns() + per_recording * recordings_.size()); }
  Index data_rows() const { return static_cast<Index>(first_row_.back()); }

  LeastSquares problem() const {
    LeastSquares p;
    p.evaluate = [this](const VectorXd& x, VectorXd& r, MatrixXd* j) { return evaluate(x, r, j); };
    p.lower = p.upper = p.scale = VectorXd::Ones(unknowns());
    for (std::size_t k = 0; k < cell_unknowns(); ++k) {
      const JointUnknown& u = model_.unknowns[k];
      const auto i = static_cast<Index>(k);
      p.lower[i] = u.positive ? std::log(u.low) : u.low;
      p.upper[i] = u.positive ? std::log(u.high) : u.high;
      if (!u.positive) p.scale[i] = u.prior_sigma > 0 ? u.prior_sigma : (u.high - u.low) / 10;
    }
    for (std::size_t r = 0; r < recordings_.size(); ++r) {
      p.lower[own(r)] = -0.8;
      p.upper[own(r)] = 2;
      p.scale[own(r)] = options_.r0_change_sigma;
      p.lower[own(r) + 1] = -1;
      p.upper[own(r) + 1] = 1;
    }
    return p;
  }

  VectorXd start(const VectorXd& value) const {
    VectorXd x = VectorXd::Zero(unknowns());
    for (std::size_t k = 0; k < cell_unknowns(); ++k) {
      const JointUnknown& u = model_.unknowns[k];
      const auto i = static_cast<Index>(k);
      const double v = std::clamp(value.size() > 0 ? value[i] : u.start, u.low, u.high);
      x[i] = u.positive ? std::log(v) : v;
    }
    return x;
  }

  double value(const VectorXd& x, std::size_t unknown) const {
    const double v = x[static_cast<Index>(unknown)];
    return model_.unknowns[unknown].positive ? std::exp(v) : v;
  }
  RecordingState state(const VectorXd& x, std::size_t r) const { return {x[own(r)], x[own(r) + 1]}; }

  bool evaluate(const VectorXd& x, VectorXd& residuals, MatrixXd* jacobian) const {
    const std::vector<Prior> priors = priors_at(x);
    const Index rows = data_rows() + static_cast<Index>(priors.size());
    residuals.setZero(rows);
    if (jacobian != nullptr) jacobian->setZero(rows, unknowns());
    numerics::in_parallel(recordings_.size(), [&](std::size_t r) {
      if (jacobian == nullptr)
        residuals_of(x, r, residuals);
      else
        for (std::size_t from = 0; from < cell_unknowns() + per_recording; from += lanes)
          derivatives_of(x, r, from, residuals, *jacobian);
    });
    Index row = data_rows();
    for (const Prior& prior : priors) {
      residuals[row] = prior_weight * prior.distance;
      if (jacobian != nullptr) (*jacobian)(row, prior.unknown) = prior_weight * prior.slope;
      ++row;
    }
    return residuals.allFinite();
  }

 private:
  struct Prior {
    Index unknown;
    double distance, slope;  ///< in standard deviations
  };

  std::size_t cell_unknowns() const { return model_.unknowns.size(); }
  Index own(std::size_t r) const { return static_cast<Index>(cell_unknowns() + per_recording * r); }

  std::vector<Prior> priors_at(const VectorXd& x) const {
    std::vector<Prior> all;
    for (std::size_t k = 0; k < cell_unknowns(); ++k) {
      const JointUnknown& u = model_.unknowns[k];
      if (!(u.prior_sigma > 0)) continue;
      const double v = value(x, k);
      all.push_back({static_cast<Index>(k), (v - u.prior) / u.prior_sigma, (u.positive ? v : 1) / u.prior_sigma});
    }
    for (std::size_t r = 0; r < recordings_.size(); ++r) {
      all.push_back({own(r), x[own(r)] / options_.r0_change_sigma, 1 / options_.r0_change_sigma});
      all.push_back({own(r) + 1, x[own(r) + 1], 1});
    }
    return all;
  }

  /// The values at x; lane k of a dual number is the derivative by unknown `from + k` of this recording.
  template <class S>
  Values<S> values_at(const VectorXd& x, std::size_t r, std::size_t from) const {
    const auto lane = [&](double v, double slope, std::size_t unknown) {
      S s(v);
      if constexpr (model::Dual<S>) {
        if (unknown >= from && unknown < from + lanes) s.v.set(unknown - from, slope);
      }
      return s;
    };
    Values<S> v = values_of<S>(model_);
    for (std::size_t k = 0; k < cell_unknowns(); ++k) {
      const double at = value(x, k);
      put(model_, model_.unknowns[k], lane(at, model_.unknowns[k].positive ? at : 1, k), v);
    }
    const RecordingState s = state(x, r);
    put(model_, lane(s.r0_change, 1, cell_unknowns()), lane(s.branch_position, 1, cell_unknowns() + 1), v);
    return v;
  }

  double weight(std::size_t r) const { return robust_v / sigma_v / std::sqrt(static_cast<double>(used_[r].size())); }

  void residuals_of(const VectorXd& x, std::size_t r, VectorXd& residuals) const {
    std::size_t next = 0;
    run<double>(model_, tables_, values_at<double>(x, r, 0), recordings_[r], [&](std::size_t k, double v, double) {
      if (next == used_[r].size() || used_[r][next] != k) return;
      const double e = (v - recordings_[r].data.voltage_v[k]) / robust_v;
      residuals[static_cast<Index>(first_row_[r] + next++)] = std::asinh(e) * weight(r);
    });
  }

  void derivatives_of(const VectorXd& x, std::size_t r, std::size_t from, VectorXd& residuals,
                      MatrixXd& jacobian) const {
    const std::size_t mine = cell_unknowns() + per_recording, count = std::min<std::size_t>(lanes, mine - from);
    std::size_t next = 0;
    run<Jet>(model_, tables_, values_at<Jet>(x, r, from), recordings_[r], [&](std::size_t k, const Jet& v, const Jet&) {
      if (next == used_[r].size() || used_[r][next] != k) return;
      const auto row = static_cast<Index>(first_row_[r] + next++);
      const double e = (v.a - recordings_[r].data.voltage_v[k]) / robust_v;
      residuals[row] = std::asinh(e) * weight(r);
      const double slope = weight(r) / robust_v / std::sqrt(1 + e * e);
      for (std::size_t j = 0; j < count; ++j) {
        const std::size_t u = from + j;
        const Index column =
            u < cell_unknowns() ? static_cast<Index>(u) : own(r) + static_cast<Index>(u - cell_unknowns());
        jacobian(row, column) = slope * v.v[j];
      }
    });
  }

  const JointModel& model_;
  std::span<const JointRecording> recordings_;
  const JointOptions& options_;
  Tables tables_;
  std::vector<std::vector<std::size_t>> used_;  ///< rows of the residual, by recording
  std::vector<std::size_t> first_row_;          ///< of each recording in the residual, and the end
};

void add_uncertainty(const JointModel& m, const JointProblem& problem, JointFit& fit) {
  VectorXd residuals;
  MatrixXd jacobian;
  if (!problem.evaluate(fit.optimum.x, residuals, &jacobian)) return;
  const Index data = problem.data_rows();
  Uncertainty u = uncertainty(residuals, jacobian, data, fit.optimum.at_bound, 0);
  // a prior has the weight of its standard deviation against runs of residuals as long as they have turned out to be
  jacobian.bottomRows(jacobian.rows() - data) *= std::sqrt(u.output_variance_v2 * u.correlation_length) / prior_weight;
  u = uncertainty(residuals, jacobian, data, fit.optimum.at_bound, 0);
  for (Index k = 0; k < fit.std.size(); ++k) {
    const JointUnknown& of = m.unknowns[static_cast<std::size_t>(k)];
    // what the recordings do not show is known to be within its bounds all the same
    const double uniform = (of.high - of.low) / std::sqrt(12.0), sigma = u.std(k) * (of.positive ? fit.value[k] : 1);
    fit.std[k] = sigma < uniform ? sigma : uniform;  // also of one that is not a number
  }
}

}  // namespace

JointFit fit_joint(const JointModel& model, std::span<const JointRecording> recordings, const JointOptions& options,
                   const VectorXd& start) {
  const JointProblem problem(model, recordings, options);
  JointFit fit;
  fit.optimum = minimise(problem.problem(), problem.start(start), Method::trust_region_reflective, options.stopping);
  const auto n = static_cast<Index>(model.unknowns.size());
  fit.value = fit.std = VectorXd::Zero(n);
  fit.at_bound = fit.optimum.at_bound.head(n);
  for (Index k = 0; k < n; ++k) fit.value[k] = problem.value(fit.optimum.x, static_cast<std::size_t>(k));
  for (std::size_t r = 0; r < recordings.size(); ++r) fit.states.push_back(problem.state(fit.optimum.x, r));
  if (options.uncertainty) add_uncertainty(model, problem, fit);
  const JointModel found = with_values(model, fit.value);
  fit.rmse_v.resize(recordings.size());
  numerics::in_parallel(recordings.size(), [&](std::size_t r) {
    fit.rmse_v[r] = rmse_v(recordings[r].data, simulate(found, recordings[r], fit.states[r]).voltage_v);
  });
  return fit;
}

JointSimulation simulate(const JointModel& model, const JointRecording& recording, const RecordingState& state) {
  const Tables tables = model::prepare<double, model::max_intervals>(model.cell);
  JointSimulation s;
  Values<double> values = values_of<double>(model);
  put(model, state.r0_change, state.branch_position, values);
  run<double>(model, tables, values, recording, [&](std::size_t, double v, double soc) {
    s.voltage_v.push_back(v);
    s.soc.push_back(soc);
  });
  // the same cell without resistances: its voltage is the OCV on the branch of the hysteresis
  constexpr double negligible = 1e-9;
  values.r0 *= negligible;
  values.r1 *= negligible;
  values.c1 /= negligible;
  for (std::size_t k = 0; k < model.mechanisms.size(); ++k) {
    const std::size_t index = model.mechanisms[k].index;
    if (index == model::mechanism_index_of<model::SlowPolarisation> ||
        index == model::mechanism_index_of<model::FastPolarisation>)
      values.mechanisms[k][0] *= negligible;
  }
  run<double>(model, tables, values, recording,
              [&](std::size_t k, double v, double) { s.overpotential_v.push_back(s.voltage_v[k] - v); });
  return s;
}

}  // namespace bms::identification
