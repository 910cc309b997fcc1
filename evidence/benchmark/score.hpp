// Figures of merit over the outcomes of many cases.
#pragma once

#include <string>
#include <vector>

#include "benchmark/run_case.hpp"

namespace bms::benchmark {

/// Number of cases with a property, of all cases that count.
struct Share {
  std::size_t hits = 0, of = 0;
  void count(bool hit) {
    hits += hit ? 1 : 0;
    ++of;
  }
  double value() const { return of == 0 ? 0 : static_cast<double>(hits) / static_cast<double>(of); }
};

/// Wilson's 95 % interval of a share, 0..1; (0, 1) without cases. (E. B. Wilson, J. Am. Stat. Assoc. 22, 1927.)
struct Interval {
  double low = 0, high = 1;
};
Interval wilson(const Share& share);

struct Score {
  Share false_alarms, detected, detected_all, first, first_class, in_set, pair_both, pair_one_none_wrong,
      outside_unknown, data_fault, holdout, separated;
  Share distinguished;  ///< causes that the recording can distinguish from the true one (Isolability): not confused
                        ///< with it
  Share confused;       ///< the others: confused
  /// Of the ambiguous diagnoses, whatever the kind of the case: after one experiment and after all that were proposed.
  Share decided_at_once, right_at_once, decided, right, nothing_more;
  double mean_experiments = 0;
  std::size_t named = 0;  ///< cases of the calibration error
  double mean_set_size = 0, median_overlap = 0, calibration_error = 0, mean_wall_s = 0;
};

/// Ids that hardly any recording can distinguish form one class; it has the name of one of them.
std::string class_of(const std::string& id);

/// Returns true if the diagnosis reported neither a mismatch nor a fault.
bool no_alarm(const Outcome& o);

Score score(const std::vector<Outcome>& outcomes);

}  // namespace bms::benchmark
