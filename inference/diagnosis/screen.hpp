// Which mechanisms could explain the residual of a fit, each judged by its signature after the base parameters and the
// parameters already in the fit are projected out.
//
//   gain   decrease of the whitened sum of squares; a first-order estimate of what a fit will find
//   alike  correlation of what two mechanisms explain: near 1, this recording cannot distinguish them
#pragma once

#include <cstddef>
#include <vector>

#include "diagnosis/likelihood_model.hpp"
#include "diagnosis/residual_projection.hpp"
#include "diagnosis/signatures.hpp"
#include "diagnosis/testability.hpp"

namespace bms::diagnosis {

struct Candidate {
  std::size_t mechanism = 0;
  MechanismSetting start;                        ///< estimate from the signature, where a fit begins
  std::vector<MechanismSetting> other_forms;     ///< the same of the other forms of its law
  std::vector<std::vector<model::Span>> bursts;  ///< by record; of a loose contact only
  double gain = 0;                               ///< less what its number of unknowns gains on noise
  double estimate = 0, sigma = 0;                ///< of its first strength, to first order; sigma 0: not estimated
  double least_sigma = 0;                        ///< the least over its probes; 0: not estimated
};

class Screen {
 public:
  /// around: what is there already. over: mechanisms to judge; those in `around` are left out.
  Screen(const LikelihoodModel& likelihood, const HypothesisFit& around, const std::vector<std::size_t>& over);
  Screen(const Screen&) = delete;
  Screen& operator=(const Screen&) = delete;

  /// Largest gain first.
  const std::vector<Candidate>& candidates() const { return candidates_; }
  /// 0..1; indices as in candidates().
  double alike(std::size_t a, std::size_t b) const;

 private:
  /// What a mechanism adds to the voltage at its best probe.
  struct Shape {
    Probe probe;           ///< without parameters if it has no columns
    Eigen::MatrixXd gram;  ///< of the probe's columns, projected
  };

  Screen(const LikelihoodModel& likelihood, const HypothesisFit& around, const std::vector<std::size_t>& over,
         const ResidualProjection& projection);
  /// Products of a probe's columns with the residual.
  Eigen::VectorXd toward(const Probe& probe) const;
  void judge(const LikelihoodModel& likelihood, const Probe& probe);
  void keep_form(double gain, const MechanismSetting& start);
  void judge_bursts(const LikelihoodModel& likelihood, const HypothesisFit& around,
                    const ResidualProjection& projection, std::size_t mechanism);
  void sort();

  SignatureSet signatures_;
  std::vector<ResidualProjection::Products> products_;  ///< of the signatures' blocks
  std::vector<Candidate> candidates_;
  std::vector<Shape> best_;  ///< of each candidate
  struct FormStart {
    double gain;
    MechanismSetting start;
  };
  std::vector<FormStart> forms_;  ///< of mechanisms whose law has several
};

}  // namespace bms::diagnosis
