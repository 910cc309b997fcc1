// The likelihood of a hypothesis, and its fit: data, noise model and calibration unknowns, which stay the same from
// hypothesis to hypothesis.
//
// Maximum a posteriori: the residual whitened (noise.hpp), the base parameters free within their tolerance
// (calibration.hpp), the mechanisms' parameters free within their bounds. Damped Gauss-Newton; the derivatives are dual
// numbers through the same laws that the firmware runs. The base parameters are eliminated first (Schur complement),
// which makes a step cheap. Equations: docs/diagnosis_method.md.
#pragma once

#include <cstddef>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "diagnosis/calibration.hpp"
#include "diagnosis/hypothesis.hpp"
#include "diagnosis/learned_error.hpp"
#include "diagnosis/noise.hpp"
#include "diagnosis/numerics.hpp"
#include "diagnosis/prepared_recording.hpp"
#include "diagnosis/recording_facts.hpp"
#include "diagnosis/remembered.hpp"
#include "model/cell_parameters.hpp"
#include "model/extended.hpp"

namespace bms::diagnosis {

struct HypothesisFit {
  Hypothesis hypothesis;        ///< with the values found
  Eigen::VectorXd calibration;  ///< the base parameters' unknowns, in standard deviations
  Eigen::VectorXd residual;     ///< whitened, all records one after another
  double cost = 0;   ///< |residual|^2 + |calibration|^2 + priors: -2 log posterior without the part of the noise
  NoiseModel noise;  ///< with which the residual was whitened
  std::optional<double> likeliest_cost;  ///< of the residual with the noise that it makes most probable, if known
  Eigen::MatrixXd covariance;  ///< of the estimated parameters, base parameters marginalised; in the parameters' units
  std::vector<char> at_bound;  ///< by estimated parameter
  bool converged = false;
};

/// Residual [V] where a simulation has diverged and has no finite value.
inline constexpr double runaway_v = 1e3;

class LikelihoodModel {
 public:
  /// own: mechanisms of the cell file. A record with fewer than two rows: std::invalid_argument.
  LikelihoodModel(const model::CellParameters<>& cell, std::vector<MechanismSetting> own,
                  std::vector<PreparedRecording> records, const NoiseModel& noise, const Loosened& loosened = {},
                  const LearnedError& learned = {});

  const model::CellParameters<>& cell() const { return cell_; }
  const std::vector<PreparedRecording>& records() const { return records_; }
  const RecordingFacts& facts() const { return facts_; }
  const Calibration& calibration() const { return calibration_; }
  const NoiseModel& noise() const { return noise_; }
  const LearnedError& learned() const { return learned_; }
  /// Rows of a residual: one per reading, record after record, then one per check of an instrument
  /// (PreparedRecording::checks).
  std::size_t samples() const { return samples_ + checks_; }
  std::size_t readings() const { return samples_; }
  /// Readings that count in the likelihood.
  std::size_t used() const;
  const std::vector<char>& usable(std::size_t record) const { return usable_[record]; }
  const Whitener& whitener(std::size_t record) const { return whiteners_[record]; }
  const RowNoise& row_noise(std::size_t record) const { return row_noise_[record]; }
  /// The cell as its file describes it.
  Hypothesis base() const;
  /// The base parameters' unknowns that leave the cell file as it is.
  Eigen::VectorXd unchanged() const { return Eigen::VectorXd::Zero(static_cast<Eigen::Index>(calibration_.size())); }

  /// Replaces the noise model; discards the linearisation.
  void set_noise(const NoiseModel& noise);

  /// Voltage that would be read in one record [V]. u: base parameters' unknowns. soc: filled in unless nullptr.
  std::vector<double> voltage(const Hypothesis& h, const Eigen::VectorXd& u, std::size_t record,
                              std::vector<double>* soc = nullptr) const;
  /// Measured less predicted, whitened. samples() rows.
  Eigen::VectorXd residual(const Hypothesis& h, const Eigen::VectorXd& u) const;
  /// Derivatives of the predicted voltage by parameters, in the parameters' units, whitened: samples() rows, a column
  /// per parameter.
  Columns derivatives(const Hypothesis& h, const Eigen::VectorXd& u, std::span<const ParameterRef> by) const;
  /// Base parameters' derivatives at one point.
  struct Point {
    Hypothesis hypothesis;
    Eigen::VectorXd unknowns;
    bool operator==(const Point& o) const { return hypothesis == o.hypothesis && unknowns == o.unknowns; }
  };
  struct Linearisation {
    Point at;
    Columns columns;       ///< J_u, white
    Eigen::MatrixXd gram;  ///< J_u' J_u + I
    Eigen::LLT<Eigen::MatrixXd> normal;
  };
  /// Remembers the last one: several users of the same point share it, also from several threads.
  std::shared_ptr<const Linearisation> linearised_at(const Hypothesis& h, const Eigen::VectorXd& u) const;
  /// By the base parameters' unknowns: a column each.
  Columns calibration_derivatives(const Hypothesis& h, const Eigen::VectorXd& u) const;
  /// The same, not white.
  Columns raw_calibration_derivatives(const Hypothesis& h, const Eigen::VectorXd& u) const;
  /// Measured less predicted [V], one column; 0 where there is no voltage. Checks in units of their own standard
  /// deviation, as in all columns.
  Columns raw_residual(const Hypothesis& h, const Eigen::VectorXd& u) const;
  /// The noise model that makes a raw residual most probable, with the prior of price_of_noise and no part below the
  /// nominal one. cost: -2 log posterior with it, without the constant.
  NoiseModel likeliest_noise(const Columns& raw, const NoiseModel& nominal, double& cost) const;

  /// Whitens columns with samples() rows.
  void whiten(Columns& columns) const;

  /// The fits that follow use the base parameters' derivatives at this point until the noise changes.
  void linearise(const Hypothesis& h, const Eigen::VectorXd& u) const;
  /// Returns true if fits that begin now share one; then several may run at once.
  bool has_linearisation() const { return nearby_.get() != nullptr; }
  HypothesisFit fit(const Hypothesis& start, int iterations = numerics.fit.iterations) const;
  /// From given base parameters, e.g. those of another fit. Ends early when even a step that gains all it promises
  /// leaves the cost above `hopeless`.
  HypothesisFit fit(const Hypothesis& start, const Eigen::VectorXd& calibration,
                    int iterations = numerics.fit.iterations,
                    double hopeless = std::numeric_limits<double>::infinity()) const;

 private:
  friend class GaussNewton;

  void set_row_noise(const PreparedRecording& r);
  /// Laws, start and readings of one record. Defined in simulation_run.hpp, as are run and at_check.
  template <class S, class Base>
  SimulationSetup<S> setup_for(const std::vector<model::MechanismValues<S>>& values, const Hypothesis& h,
                               const Base& base, std::size_t record) const;
  /// row(k, voltage, simulation), then check(j, prediction of a check in its standard deviations).
  template <class S, class Base, class Row, class ForCheck>
  void run(const std::vector<model::MechanismValues<S>>& values, const Hypothesis& h, const Base& base,
           std::size_t record, Row&& row, ForCheck&& check) const;
  std::vector<double> simulate(const Hypothesis& h, const Eigen::VectorXd& u, std::size_t record,
                               std::vector<double>* soc, std::vector<double>* checks) const;
  /// Columns first .. first + here, in one run.
  template <std::size_t Lanes>
  void derive(const Hypothesis& h, const Eigen::VectorXd& u, std::span<const ParameterRef> by, std::size_t first,
              std::size_t here, Columns& columns) const;
  /// By all base parameters, in one run: each row's derivatives by the states before it and by the levers, carried from
  /// row to row.
  template <std::size_t Lanes>
  void carry(const Hypothesis& h, const Eigen::VectorXd& u, Columns& columns) const;
  std::shared_ptr<const Linearisation> linearised(const Hypothesis& h, const Eigen::VectorXd& u) const;
  std::shared_ptr<const Linearisation> factorised(Point at, Columns columns) const;
  std::vector<Whitener> whiteners_for(const NoiseModel& noise) const;
  /// -2 log posterior of a noise model by a raw residual, without the constant.
  std::vector<double> costs_of_noise(const Columns& raw, std::span<const NoiseModel> noises,
                                     const NoiseModel& nominal) const;
  /// Returns the logarithm of the determinant of the checks' covariance.
  double whiten(Columns& columns, const std::vector<Whitener>& by, const NoiseModel& noise) const;
  /// Checks of one voltage channel share its drift: their covariance is I + w w', undone by (I + w w')^-1/2.
  double whiten_checks(Columns& columns, Eigen::Index row, const NoiseModel& noise) const;

  model::CellParameters<> cell_;
  model::Cell<double, model::max_intervals> tables_;
  std::vector<MechanismSetting> own_;
  std::vector<PreparedRecording> records_;
  RecordingFacts facts_;
  LearnedError learned_;
  Calibration calibration_;
  NoiseModel noise_;
  std::vector<Whitener> whiteners_;        ///< by record
  std::vector<std::vector<char>> usable_;  ///< by record and row
  std::vector<RowNoise> row_noise_;        ///< by record
  std::size_t samples_ = 0, checks_ = 0;
  mutable Remembered<Linearisation> nearby_;  ///< where fits begin to be linear in the base parameters
  mutable Remembered<Linearisation> latest_;  ///< that linearised_at() has made
  mutable Remembered<Columns> at_base_;       ///< of the cell as its file describes it; not white
};

}  // namespace bms::diagnosis
