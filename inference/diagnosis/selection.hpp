// Which mechanisms belong to the best hypothesis: forward selection, then elimination of those that are not needed and
// comparison with their rivals.
#pragma once

#include <cstddef>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "diagnosis/likelihood_model.hpp"
#include "diagnosis/search.hpp"
#include "diagnosis/verdict.hpp"

namespace bms::diagnosis {

/// What the search may add.
struct Scope {
  std::vector<std::size_t> searched;  ///< all but the cell file's own; the screen leaves out what cannot be tested
  std::set<std::size_t> expected;     ///< certain before any voltage is looked at: fitted before anything that could
                                      ///< take its place
  std::set<std::size_t> kept;         ///< of these, certain in most of the recording: no set without takes their place
  std::vector<NotTestable> not_testable;
};
Scope scope_of(const LikelihoodModel& likelihood);

/// Result of the forward selection.
struct Grown {
  HypothesisFit fit;
  std::vector<HypothesisFit> singles;   ///< all that was tried alone
  std::map<std::size_t, double> gains;  ///< by mechanism: the largest gain by adding it
};
/// Adds the mechanism that explains most, then the next, as long as chance would not gain as much. Mechanisms that are
/// free to come and go come after all others. most: of mechanisms.
Grown grow(Search& search, const HypothesisFit& control, const Scope& scope, std::size_t most);

/// Result of the elimination.
struct Survivors {
  HypothesisFit best;
  std::map<std::size_t, std::vector<HypothesisFit>> rivals;     ///< by mechanism: with another one in its place
  std::map<std::size_t, double> gains;                          ///< by mechanism: over the hypothesis without it
  std::map<std::pair<std::size_t, std::size_t>, double> alike;  ///< correlation of signatures
};
/// Removes mechanisms that are not needed, and fits the rivals of each in its place.
Survivors eliminate(Search& search, const LikelihoodModel& likelihood, const HypothesisFit& control,
                    const HypothesisFit& grown, const Scope& scope);

/// Weakest mechanism to remove, the first if several are equally weak; no_mechanism if none is removable.
/// weight(mechanism): nothing if it is not removable.
template <class Weight>
std::size_t weakest_removable(const std::vector<std::size_t>& mechanisms, Weight&& weight) {
  decltype(weight(no_mechanism)) least;
  std::size_t goes = no_mechanism;
  for (const std::size_t m : mechanisms) {
    const auto of = weight(m);
    if (!of || (least && !(*of < *least))) continue;
    least = of;
    goes = m;
  }
  return goes;
}

/// The rest fitted again without a mechanism, with its gains.
Survivors without_one(Search& search, const HypothesisFit& control, const Survivors& found, std::size_t mechanism);

/// Removes mechanisms whose strength the error of the model does not let stand: within two standard deviations of none
/// where these contain it.
Survivors without_uncertain(Search& search, LikelihoodModel& likelihood, const HypothesisFit& control,
                            const Scope& scope, Survivors found);

}  // namespace bms::diagnosis
