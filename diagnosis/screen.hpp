// Which mechanisms could explain what a fit has left, each judged by its signature: the derivative of the voltage by
// its strength, shapes on a grid, whitened, base parameters and the parameters already in the fit projected out.
//
//   gain   how much the whitened sum of squares would fall; a first-order estimate of what a fit will find
//   limit  strength that would be found in 9 of 10 recordings like this one at one false alarm in 100 (4.76 deviations)
//   alike  correlation of what two mechanisms explain: near 1, this recording cannot tell them apart
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "diagnosis/hypothesis.hpp"

namespace bms::diagnosis {

struct Candidate {
  std::size_t mechanism = 0;
  MechanismSetting start;  ///< estimate from the signature, for a fit to begin at
  std::vector<std::vector<model::Span>> bursts;
  double gain = 0;   ///< corrected for what its number of unknowns gains on noise
  double limit = 0;  ///< of its first strength, in its unit; 0: not estimated
};

/// Settings at which the signature of a testable mechanism is taken: every shape of its grid, strengths just off a
/// bound at 0.
std::vector<MechanismSetting> probe_settings(const LikelihoodModel& evidence, std::size_t mechanism);

/// Why a mechanism cannot be judged by these recordings beside those given, or nothing.
std::optional<std::string> not_testable(const LikelihoodModel& evidence, const Hypothesis& given,
                                        std::size_t mechanism);

class Screen {
 public:
  /// around: what is there already. over: mechanisms to judge (those in `around` are left out).
  Screen(const LikelihoodModel& evidence, const HypothesisFit& around, const std::vector<std::size_t>& over);

  /// Best first.
  const std::vector<Candidate>& candidates() const { return candidates_; }
  /// 0..1; indices as in candidates().
  double alike(std::size_t a, std::size_t b) const;

 private:
  struct Probe {
    MechanismSetting setting;
    std::vector<std::size_t> parameters;  ///< those that vary
    Eigen::Index first = 0;
  };
  double gain_of(const std::vector<Eigen::Index>& columns, Eigen::VectorXd* strengths = nullptr) const;
  static double corrected(double gain, std::size_t unknowns);

  std::vector<Candidate> candidates_;
  std::vector<Probe> best_;  ///< of each candidate
  Eigen::MatrixXd gram_;     ///< of all probes' columns, projected
  Eigen::VectorXd toward_;   ///< their products with the residual
};

}  // namespace bms::diagnosis
