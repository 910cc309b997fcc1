// Resistances of the cell as a fit describes it, at the temperature of the recordings and at that of the cell file.
//
// A recording in the cold shows the product of a resistance and its Arrhenius factor. The size at the file's
// temperature, which a finding states, is that product over a factor whose energy is uncertain. Both are functions of
// the same unknowns: the model's own laws with dual numbers, and the joint covariance of base parameters, findings and
// the file's mechanisms. Equations: docs/diagnosis_method.md.
#pragma once

#include "diagnosis/likelihood_model.hpp"
#include "diagnosis/verdict.hpp"

namespace bms::diagnosis {

/// Adds the resistances of the cell and of its findings, if the recordings have a temperature. The likelihood has the
/// noise model of the fit. A loose contact is closed, one that has changed stays so, and the current does not heat the
/// cell. Names of ResistanceAt:
///   r0_ohm, r1_ohm              of the cell
///   step_ohm                    of the cell, from one row to the next after a step of the current
///   resistance_ohm              a finding's own
///   added_r0_ohm, added_r1_ohm  with the finding less without it
void add_resistances(const LikelihoodModel& likelihood, const HypothesisFit& fit, Diagnosis& d);

}  // namespace bms::diagnosis
