// A hypothesis: the cell with a set of mechanisms, each with unknown parameters; its fit to recordings, and what the
// fit leaves.
//
// Maximum a posteriori: the residual whitened (noise.hpp), the base parameters free within their tolerance
// (calibration.hpp), the mechanisms' parameters within their bounds. Gauss-Newton with Levenberg's damping; derivatives
// by dual numbers through the same laws that the firmware runs. The base parameters are eliminated first (Schur
// complement), which makes a step cheap.
#pragma once

#include <cstddef>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "diagnosis/calibration.hpp"
#include "diagnosis/noise.hpp"
#include "diagnosis/prepared_recording.hpp"
#include "model/cell_parameters.hpp"
#include "model/extended.hpp"

namespace bms::diagnosis {

using model::mechanism_index;
using model::MechanismSetting;

/// A parameter that is sought.
struct ParameterRef {
  std::size_t setting = 0;    ///< in the hypothesis
  std::size_t parameter = 0;  ///< of its mechanism
  bool operator==(const ParameterRef&) const = default;
};

struct Hypothesis {
  std::vector<MechanismSetting> settings;        ///< the cell's own, then those it adds
  std::size_t own = 0;                           ///< how many are the cell's own: these are not sought
  std::vector<std::vector<model::Span>> bursts;  ///< of a loose contact, by record

  std::vector<std::size_t> added() const;  ///< catalogue indices, ascending
  const MechanismSetting* find(std::size_t index) const;
  std::vector<ParameterRef> sought() const;
  std::string name() const;  ///< ids joined by '+', "calibration" when it adds none
};

/// With this mechanism, its strengths at their neutral values.
Hypothesis with(const Hypothesis& h, std::size_t mechanism, double capacity_ah);
/// With a setting of it.
Hypothesis with(const Hypothesis& h, const MechanismSetting& setting);
Hypothesis without(const Hypothesis& h, std::size_t mechanism);

struct HypothesisFit {
  Hypothesis hypothesis;        ///< with the values found
  Eigen::VectorXd calibration;  ///< the base parameters' unknowns, in standard deviations
  Eigen::VectorXd residual;     ///< whitened, all records after another
  double cost = 0;   ///< |residual|^2 + |calibration|^2 + priors: -2 log posterior but for what the noise adds
  NoiseModel noise;  ///< by which the residual was whitened
  Eigen::MatrixXd covariance;  ///< of what is sought, base parameters marginalised; in the parameters' units
  std::vector<char> at_bound;  ///< of what is sought
  bool converged = false;
};

/// Residual of a simulation that has run away to where there are no numbers.
inline constexpr double runaway_v = 1e3;

/// Everything that stays the same from hypothesis to hypothesis.
class LikelihoodModel {
 public:
  /// own: mechanisms of the cell file. Records that are empty or have no voltage: std::invalid_argument.
  LikelihoodModel(const model::CellParameters<>& cell, std::vector<MechanismSetting> own,
                  std::vector<PreparedRecording> records, const NoiseModel& noise);

  const model::CellParameters<>& cell() const { return cell_; }
  const std::vector<PreparedRecording>& records() const { return records_; }
  const Calibration& calibration() const { return calibration_; }
  const NoiseModel& noise() const { return noise_; }
  /// Rows of a residual: one a reading of every record after another, then one a check of an instrument
  /// (Record::checks).
  std::size_t samples() const { return samples_ + checks_; }
  std::size_t readings() const { return samples_; }
  std::size_t used() const;
  const std::vector<char>& usable(std::size_t record) const { return usable_[record]; }
  const Whitener& whitener(std::size_t record) const { return whiteners_[record]; }
  Hypothesis base() const;  ///< the cell as its file says
  Eigen::VectorXd unchanged() const {
    return Eigen::VectorXd::Zero(static_cast<Eigen::Index>(calibration_.size()));
  }  ///< base parameters' unknowns, as the file has them

  /// The same with other noise.
  void set_noise(const NoiseModel& noise);

  /// Voltage that would be read, record by record. u: base parameters' unknowns. socs: if asked for.
  std::vector<double> voltage(const Hypothesis& h, const Eigen::VectorXd& u, std::size_t record,
                              std::vector<double>* soc = nullptr) const;
  /// Measured less predicted, whitened, all records.
  Eigen::VectorXd residual(const Hypothesis& h, const Eigen::VectorXd& u) const;
  /// Derivatives of the predicted voltage, whitened: by what is sought, in the parameters' units.
  Columns derivatives(const Hypothesis& h, const Eigen::VectorXd& u, std::span<const ParameterRef> by) const;
  /// By the base parameters' unknowns.
  Columns calibration_derivatives(const Hypothesis& h, const Eigen::VectorXd& u) const;
  /// Measured less predicted, V; 0 where there is no voltage. Checks in their own deviations, as in all columns: they
  /// are white as they are.
  Columns raw_residual(const Hypothesis& h, const Eigen::VectorXd& u) const;
  /// The noise that makes a raw residual likeliest, at least the nominal, at its price; cost: -2 log likelihood with
  /// it.
  NoiseModel likeliest_noise(const Columns& raw, const NoiseModel& nominal, double& cost) const;

  /// Any columns over all records, made white.
  void whiten(Columns& columns) const;

  /// Where the fits that follow find the base parameters' derivatives, until the noise changes; saves each of them its
  /// own.
  void linearise(const Hypothesis& h, const Eigen::VectorXd& u) const;
  HypothesisFit fit(const Hypothesis& start, int iterations = 12) const;
  /// From where another fit ended, e.g. with other noise. Ends early when even a step that keeps all it promises stays
  /// above hopeless.
  HypothesisFit fit(const Hypothesis& start, const Eigen::VectorXd& calibration, int iterations = 12,
                    double hopeless = std::numeric_limits<double>::infinity()) const;

 private:
  struct Linear;  // base parameters' derivatives and their factorised normal matrix
  /// row(k, voltage, course), then check(j, what the hypothesis expects in place of the trusted side, in deviations).
  template <class S, class Base, class Row, class ForCheck>
  void run(const std::vector<model::MechanismValues<S>>& values, const Hypothesis& h, const Base& base,
           std::size_t record, Row&& row, ForCheck&& check) const;
  std::vector<double> simulate(const Hypothesis& h, const Eigen::VectorXd& u, std::size_t record,
                               std::vector<double>* soc, std::vector<double>* checks) const;
  /// Columns first .. first + here, in one run.
  template <std::size_t Lanes>
  void derive(const Hypothesis& h, const Eigen::VectorXd& u, std::span<const ParameterRef> by, std::size_t first,
              std::size_t here, Columns& columns) const;
  /// By all base parameters, in one run: what each row makes of the states before it and of the levers, carried on from
  /// row to row.
  template <std::size_t Lanes>
  void carry(const Hypothesis& h, const Eigen::VectorXd& u, Columns& columns) const;
  std::shared_ptr<const Linear> linear(const Hypothesis& h, const Eigen::VectorXd& u) const;

  model::CellParameters<> cell_;
  model::Cell<double, model::max_intervals> tables_;
  std::vector<MechanismSetting> own_;
  std::vector<PreparedRecording> records_;
  Calibration calibration_;
  NoiseModel noise_;
  std::vector<Whitener> whiteners_;
  std::vector<Whitener> whiteners_for(const NoiseModel& noise) const;
  void whiten(Columns& columns, const std::vector<Whitener>& by) const;
  std::vector<std::vector<char>> usable_;
  std::vector<RowNoise> row_noise_;
  std::size_t samples_ = 0, checks_ = 0;
  mutable std::shared_ptr<const Linear> nearby_;  ///< where fits begin to be linear in the base parameters
};

}  // namespace bms::diagnosis
