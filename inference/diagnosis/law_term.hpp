// Where an unknown cause sits, and a model of it: which law of the cell model must change, and by how much, for the
// recordings to be explained where they were not used.
//
// The law is the one with the most evidence (law_evidence.hpp). The term of a law with a table is the change of that
// table over the state of charge: hat functions with a prior, as the calibration has them (calibration.hpp), with a
// standard deviation several times the tolerance. The factor is the one with the smallest error on parts of the
// recordings that are left out in turn. The term of the slow polarisation is a mechanism, load_memory. Other laws have
// no term. A term that does not improve the parts left out is not learned: one that fitted its recording increased the
// error of a hold-out from 2.8 to 3.1 mV.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/law_evidence.hpp"
#include "diagnosis/likelihood_model.hpp"

namespace bms::diagnosis {

struct LawTerm {
  std::vector<LawEvidence> laws;        ///< all of them, the largest first
  std::string law;                      ///< ocv, ohmic, fast, slow, charge, temperature, voltage, timing
  std::vector<std::string> depends_on;  ///< soc, current, time, temperature, voltage
  double left_out_before_v = 0;         ///< RMS error on the parts left out, base parameters within their tolerance;
                                        ///< 0: not learned
  double left_out_after_v = 0;          ///< with the term; 0: the law has no term
  double times_tolerance = 1;
  std::optional<model::CellParameters<>> cell;  ///< with the term in its tables, or with base parameters that fit
                                                ///< together with `mechanism`; nothing: there is no term
  std::optional<MechanismSetting> mechanism;    ///< that is the term; nothing: the tables have it
};

/// Mechanisms of a cell file and the term, if it is one.
std::vector<MechanismSetting> with_term(std::vector<MechanismSetting> own, const LawTerm& term);

/// The law in words.
std::string_view name_of_law(const LawTerm& term);

/// Of all laws by the cell file as it is, its base parameters within their tolerance.
std::vector<LawEvidence> law_evidence(const LikelihoodModel& likelihood, const NoiseModel& nominal);

/// Nothing if no law has enough evidence.
std::optional<LawTerm> learn_law_term(const LikelihoodModel& likelihood, const NoiseModel& nominal,
                                      std::vector<LawEvidence> laws);

}  // namespace bms::diagnosis
