// Published figures of the paper compared with each other, without any simulation.
#pragma once

#include <string>
#include <vector>

#include "study/observations.hpp"

namespace bms::study {

/// Standard deviation of the voltage of each experiment: output of Table 8 over 1 - fit on the diagonal of Table 7.
std::array<double, paper_experiments> published_voltage_sd_v();

struct Inconsistency {
  std::string figures;   ///< which figures
  std::string observed;  ///< what they say
  std::string meaning;   ///< why that cannot be, or what it says of the procedure
};
std::vector<Inconsistency> inconsistencies();

}  // namespace bms::study
