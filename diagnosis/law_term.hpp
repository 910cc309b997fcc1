// Where an unknown cause sits, and a model of it: which law of the cell model must change, and by how much, for the
// recordings to be explained where they were not used.
//
// The term is the change of one law's table over the state of charge: hat functions with a prior, as the calibration
// has them (calibration.hpp), with a standard deviation several times the tolerance. The law and that factor are those
// with the smallest error on parts of the recordings that are left out in turn.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/likelihood_model.hpp"

namespace bms::diagnosis {

struct LawTerm {
  std::string law;                      ///< ocv, ohmic, fast, charge, temperature
  std::vector<std::string> depends_on;  ///< soc, current, time, temperature
  double left_out_before_v = 0;         ///< RMS error on the parts left out, base parameters within their tolerance
  double left_out_after_v = 0;          ///< with the term; 0: the law has no term
  double times_tolerance = 1;
  std::optional<model::CellParameters<>> cell;  ///< with the term in its tables; nothing: there is no term
};

/// The law in words.
std::string_view name_of_law(const LawTerm& term);

/// family: of generic columns that explains most (ResidualTest). Nothing if neither
/// says more than that something is there.
std::optional<LawTerm> learn_law_term(const LikelihoodModel& likelihood, const NoiseModel& nominal,
                                      std::string_view family);

}  // namespace bms::diagnosis
