// Fits of hypotheses compared with each other: one mechanism more, another in its place, one less; and their scores.
#pragma once

#include <array>
#include <functional>
#include <limits>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/likelihood_model.hpp"
#include "diagnosis/screen.hpp"

namespace bms::diagnosis {

/// Receives the share that is done, 0..1, and what was done last.
using Progress = std::function<void(double, const std::string&)>;
/// Returns true once the search is to end with what it knows.
using Stopped = std::function<bool()>;

/// RMS of measured less predicted [V] by a hypothesis with the cell file's own base parameters: what an extended cell
/// file would achieve.
double plain_error_v(const LikelihoodModel& likelihood, const Hypothesis& h);
/// The same of a fit with its base parameters.
double fitted_error_v(const LikelihoodModel& likelihood, const HypothesisFit& f);

/// What the unknowns of a mechanism cost. What is known of most cells is not an unknown.
double price_of_unknowns(std::size_t mechanism);

class Search {
 public:
  /// All must outlive it. Its noise model is taken as the nominal one.
  Search(LikelihoodModel& likelihood, const Progress& progress, const Stopped& stopped)
      : likelihood_(likelihood), progress_(progress), stopped_(stopped), nominal_(likelihood.noise()) {}

  const NoiseModel& nominal_noise() const { return nominal_; }

  /// -2 log posterior with the cost of its unknowns, less the gain known beforehand: the smaller the better.
  double score(const HypothesisFit& f);

  /// Fitted again with the noise model that its own residual makes most probable.
  HypothesisFit with_own_noise(HypothesisFit f);

  /// Fitted on until nothing is gained any more, each time with base parameters' derivatives from where it stands.
  HypothesisFit converged(const HypothesisFit& f);

  /// Gain of a hypothesis over a smaller one, without what was known beforehand.
  double gain(const HypothesisFit& less, const HypothesisFit& more);

  /// All fits with one mechanism of `over` added, the best first.
  std::vector<HypothesisFit> one_more(const HypothesisFit& around, const std::vector<std::size_t>& over);

  struct Replacement {
    std::size_t mechanism;  ///< of the best hypothesis, to be replaced
    const HypothesisFit& best;
    const HypothesisFit& without;  ///< without the mechanism
    double gain;                   ///< of the mechanism
  };
  /// Fits with another mechanism of `over` in the place of one, and with that one from another start. likeness: of each
  /// mechanism's signature to the replaced one's, filled in.
  std::vector<HypothesisFit> in_place_of(const Replacement& r, const std::vector<std::size_t>& over,
                                         std::map<std::size_t, double>& likeness);

  /// Fits with each of `by` in the place of one mechanism of the best hypothesis, however bad. Those that these
  /// recordings cannot test are left out. The new mechanism is the last of its hypothesis.
  std::vector<HypothesisFit> replaced(const HypothesisFit& best, std::size_t mechanism,
                                      const std::vector<std::size_t>& by);

  /// Returns true if a cell file with it would do as well as with what was there. What helps only together with the
  /// start and the sensor's wander in this recording is not a cause. A first mechanism always passes: of two that hide
  /// each other, one alone makes the error larger.
  bool improves_lasting_error(const HypothesisFit& before, const HypothesisFit& f) const;

  /// The rest of a fit without a mechanism, fitted again from where it was.
  HypothesisFit without_one(const HypothesisFit& f, std::size_t mechanism);
  /// The same without each of its mechanisms in turn, by mechanism.
  std::map<std::size_t, HypothesisFit> without_each(const HypothesisFit& f);

  /// The best fit so far of each set of mechanisms.
  const std::map<std::vector<std::size_t>, HypothesisFit>& best_of_each() const { return best_; }

  /// Returns true once the search is to end: no further fit begins.
  bool stopped() const { return stopped_ && stopped_(); }

  /// Reports progress by one step.
  void report(std::string_view what);

 private:
  /// The totals of several, on all processors, for score().
  void learn_totals(const std::vector<HypothesisFit>& fits);
  /// What candidates are compared with.
  struct Foremost {
    double cost = std::numeric_limits<double>::infinity();  ///< above it a fit is given up
    const HypothesisFit* fit = nullptr;
    std::size_t mechanism = no_mechanism;  ///< of `fit`, in whose place the candidates are
    Eigen::VectorXd without;               ///< residual of `fit` without it
  };
  /// The better one of this fit and that of the same mechanisms which was the best so far.
  HypothesisFit best_so_far(HypothesisFit f);
  /// A candidate added to what is there, fitted from its estimate and from far starts. Called from several threads.
  HypothesisFit fit_with(const HypothesisFit& around, const Candidate& c, const Foremost& foremost);
  struct Start {
    Hypothesis hypothesis;
    Eigen::VectorXd calibration;
  };
  /// The cheapest of some starts: the candidate's own, and where it takes over from the mechanism in whose place it is,
  /// with the base parameters that these two share if they are alike.
  Start cheapest_start(const Hypothesis& h, const HypothesisFit& around, const Foremost& foremost) const;
  struct FarStart {
    Hypothesis hypothesis;
    double cost;  ///< |residual|^2
  };
  /// The best of some strengths far from the signature's estimate; nothing if none is better than it.
  std::optional<FarStart> far_start(const Hypothesis& h, const Eigen::VectorXd& u) const;
  /// Base parameters for far starts: those of the fit, and those of the cell file, which the fit may have left because
  /// a mechanism is missing.
  std::array<Eigen::VectorXd, 2> far_bases(const HypothesisFit& around) const;
  /// Where the last mechanism takes over a part of what another one explains; nothing if it has no such start.
  std::optional<Hypothesis> joint_start(Hypothesis h) const;
  /// By candidate: 1 if a far start is better where the signature, which is linear, sees nothing, or if there is a
  /// joint start; of a wrong start also if the recording states another one, whatever the signature sees: on a flat OCV
  /// a start that was wrong by 68 % of soc had only the seventh signature.
  std::vector<char> far_better(const HypothesisFit& around, const std::vector<Candidate>& candidates) const;
  /// The moment at which a contact has changed, to the row.
  HypothesisFit refined_onset(HypothesisFit best) const;
  /// The candidates fitted, by cost; the foremost with the noise that they leave, which is smaller if much is
  /// explained.
  std::vector<HypothesisFit> fitted(const HypothesisFit& around, const std::vector<Candidate>& candidates,
                                    const Foremost& foremost);

  LikelihoodModel& likelihood_;
  const Progress& progress_;
  const Stopped& stopped_;
  NoiseModel nominal_;
  std::map<std::vector<std::size_t>, HypothesisFit> best_;  ///< by mechanisms, in the catalogue's order
  std::map<double, double> totals_;                         ///< by the fit's cost, which no two different fits share
  std::mutex reporting_;
  int steps_ = 0;
};

}  // namespace bms::diagnosis
