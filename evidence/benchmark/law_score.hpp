// What is said of effects that no catalogue contains: is the law named in which the effect acts, and how much of the
// hold-out error does the term for it remove?
#pragma once

#include <string>
#include <vector>

#include "benchmark/run_case.hpp"
#include "benchmark/score.hpp"

namespace bms::benchmark {

/// Of the cases of one effect, or of all.
struct LawScore {
  std::size_t cases = 0, nothing = 0, cause = 0, no_law = 0;  ///< cause: of the catalogue
  Share law;                                                  ///< named rightly; of all cases
  Share of_named;                                             ///< the same, of the cases with a law
  Share cut;  ///< hold-out error above the floor at most half of that of the file alone; of the cases where it shows
  Share cut_with_term;                    ///< the same, of those with a term
  Share plain_cut;                        ///< the whole error, with the floor, at most half
  std::vector<double> frozen_v, after_v;  ///< hold-out errors of the cases where it shows
};

/// Returns true if the effect stands above noise and tolerance in the hold-out.
bool shows_in_holdout(const Outcome& o);

/// Error above the floor at most half of the file's.
bool cuts_holdout(const Outcome& o);

bool names_right_law(const Outcome& o);

LawScore law_score(const std::vector<Outcome>& outcomes);

/// A row for each effect and one for all.
std::string law_table(const std::vector<Outcome>& outcomes);

}  // namespace bms::benchmark
