// Compares what was found with healthy recordings of the same cell, and takes back what they show as well.
#pragma once

#include <map>
#include <optional>
#include <vector>

#include "diagnosis/adequacy.hpp"
#include "diagnosis/selection.hpp"
#include "diagnosis/verdict.hpp"

namespace bms::diagnosis {

/// Gain of every mechanism that was added or has survived.
std::vector<MechanismGain> gains_of(const Grown& grown, const Survivors& survivors);

/// Gain of an unknown cause, on the scale of a mechanism's gain.
double unknown_gain(const ResidualTest& residual);

/// Largest RMS error that the cell file has on a healthy recording [V]; 0 without any.
double largest_error_v(const healthy_data::HealthyData& healthy);

/// Returns true if healthy recordings decide what may be named: they were where these recordings are, or they show
/// causes that are not there. Others confirm the tolerance of the cell file as far as they go; elsewhere it is what is
/// known, as without them.
bool healthy_decide(const HealthyNull& null, const HealthyCoverage& covered);

class HealthyJudge {
 public:
  /// All must outlive it.
  HealthyJudge(Search& search, const LikelihoodModel& likelihood, const HypothesisFit& control, const Scope& scope,
               const healthy_data::HealthyData& healthy, double false_alarm_rate);

  const HealthyBasis& basis() const { return basis_; }
  std::vector<Withheld> withheld() const;

  /// If healthy recordings decide: removes mechanisms that do not stand out, the least one first, each time with the
  /// others fitted again. What is left is compared with its rivals again.
  Survivors without_withheld(Survivors found);

  /// The smallest gain at which a mechanism would stand out; nothing if it could not.
  std::optional<double> gain_needed(std::size_t mechanism) const;

  /// Takes back an unknown cause that does not stand out.
  void withhold_unknown(Adequacy& adequacy);

 private:
  /// Returns true if the healthy blocks stand for enough of the recordings.
  bool is_covered() const;
  /// What healthy blocks stand for with the current sensor's error of a fit taken away; nothing if it has none, or if
  /// it leaves more than healthy recordings show.
  HealthyCoverage covered_by(const HypothesisFit& fit) const;
  /// So far behind the best, a fit equals it.
  double reach() const;
  /// A recording beyond the healthy ones is covered if it is by the best fit or by a rival that equals it.
  void cover_true_current(const Survivors& found);
  /// Result when current-sensor faults are tried first: a recording beyond the healthy ones may be there because of
  /// it, and its signature, which is linear, says little of a gain that doubles the reading.
  Survivors with_current_sensor(Survivors found);
  HealthyComparison compare(std::size_t mechanism, double gain) const;
  Withheld withheld_of(std::size_t mechanism, const MechanismSetting& setting, double gain) const;
  /// The mechanism that stands out least; nothing if all stand out.
  std::optional<Withheld> least_of(const Survivors& found) const;

  Search& search_;
  const LikelihoodModel& likelihood_;
  const HypothesisFit& control_;
  Scope scope_;  ///< without what was withheld
  const healthy_data::HealthyData& healthy_;
  HealthyCoverage as_read_;
  HealthyBasis basis_;
  HealthyNull null_;
  std::vector<Withheld> withheld_;
};

}  // namespace bms::diagnosis
