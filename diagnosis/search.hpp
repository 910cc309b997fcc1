// Fits of hypotheses against each other: one mechanism more, another in its place, one less; and what each is worth.
#pragma once

#include <array>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/hypothesis.hpp"
#include "diagnosis/screen.hpp"

namespace bms::diagnosis {

/// How far the cell was from the temperature that its file is for.
double away_k(const LikelihoodModel& evidence);
/// RMS of measured less predicted by a hypothesis with the cell file's own base parameters: what an extended cell file
/// will do.
double plain_error_v(const LikelihoodModel& evidence, const Hypothesis& h);

class Search {
 public:
  /// Both must outlive it.
  Search(LikelihoodModel& evidence, const std::function<void(double, const std::string&)>& progress)
      : evidence_(evidence), progress_(progress), nominal_(evidence.noise()), away_k_(away_k(evidence)) {}

  /// -2 log posterior, what its unknowns cost included, less what was known before: the smaller the better.
  double score(const HypothesisFit& f);

  /// Fitted again under the noise that its own residual speaks of.
  HypothesisFit settled(HypothesisFit f);

  /// What a hypothesis gains over a smaller one, whatever was known before.
  double gain(const HypothesisFit& less, const HypothesisFit& more);

  /// The best of adding one mechanism to what is there.
  std::vector<HypothesisFit> one_more(const HypothesisFit& around, const std::vector<std::size_t>& over);

  /// What could stand in the place of mechanism m of the best hypothesis, and m itself from another start; less:
  /// without m. likeness: of each to m.
  std::vector<HypothesisFit> in_place_of(std::size_t m, const HypothesisFit& best, const HypothesisFit& less,
                                         const std::vector<std::size_t>& over, double gain_of_m,
                                         std::map<std::size_t, double>& likeness);

  /// Whether a cell file with it would do as well as with what was there: what only helps together with the start and
  /// the wander that this recording needed is no cause. A first one may: of two that hide each other, one alone makes
  /// it worse.
  bool carries(const HypothesisFit& before, const HypothesisFit& f) const;

  /// The rest of a fit, fitted again from where it was.
  HypothesisFit without_one(const HypothesisFit& f, std::size_t m);

  /// Progress.
  void tell(std::string_view what);

 private:
  /// -2 log posterior with the noise that the residual speaks of, at its price.
  double total(const HypothesisFit& f) const;
  /// A candidate added to what is there and fitted from its estimate; shapes far apart are tried from two sides.
  HypothesisFit fit_with(const HypothesisFit& around, const Candidate& c, double hopeless);
  /// Where a knee of the OCV is passed, an effect on the charge is not linear: the best of some strengths far from the
  /// estimate.
  std::optional<Hypothesis> far_start(Hypothesis h, const Eigen::VectorXd& u);
  /// From where: where the base parameters have gone, and the cell file, which they may have left because of what is
  /// missing.
  std::array<Eigen::VectorXd, 2> far_bases(const HypothesisFit& around) const;
  /// Whether one is, where the screen, which is linear, sees nothing.
  bool far_better(const HypothesisFit& around, const Candidate& c);
  /// The moment of a contact's step, to the sample.
  HypothesisFit refined_onset(HypothesisFit best);
  static bool alike(const NoiseModel& a, const NoiseModel& b);
  /// The candidates fitted; the foremost again with the noise that they leave, which is smaller when much has been
  /// explained.
  std::vector<HypothesisFit> fitted(const HypothesisFit& around, const std::vector<Candidate>& candidates,
                                    double hopeless);

  LikelihoodModel& evidence_;
  const std::function<void(double, const std::string&)>& progress_;
  NoiseModel nominal_;
  double away_k_;
  std::map<double, double> totals_;  ///< by the fit's cost, which no two different fits share
  int steps_ = 0;
};

}  // namespace bms::diagnosis
