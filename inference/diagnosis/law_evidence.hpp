// How well a change of each law would explain what an unknown cause leaves, in the order of their evidence.
//
// Each law has columns: what the voltage would do if the law changed, as a curve with few knots over what the law
// depends on. Their strengths have a normal prior whose width is the one with the most evidence:
//
//   evidence(s) = s^2 b' (I + s^2 G)^-1 b - log det(I + s^2 G),   b = W'r, G = W'W, base parameters projected out
//
// which is twice the log of how much more probable the recording is with the columns than without. The determinant is
// the price of freedom: a law with two columns wins over one with thirty that explains the same.
#pragma once

#include <vector>

#include "diagnosis/likelihood_model.hpp"

namespace bms::diagnosis {

struct LawEvidence {
  const char* law;               ///< as LawTerm::law; "": a function of the time, which every law is
  const char* depends_on;        ///< soc, current, time, temperature, voltage
  double gain = 0;               ///< the evidence
  double outside_catalogue = 0;  ///< gain of the best form that no mechanism of the catalogue has
};

/// The largest first; the best form of each law.
std::vector<LawEvidence> law_evidence(const LikelihoodModel& likelihood, const HypothesisFit& fit);

/// Returns true if a law that no mechanism changes explains more than the causes that are named, or less by no more
/// than a tie. gain: of the causes. remaining: what they leave, which counts against them; where it is nothing, no law
/// can be missing.
bool another_law_explains_more(const std::vector<LawEvidence>& laws, double gain, double remaining);

/// Returns true if the voltage's reading often stands still, and never moves by less than several of the steps that it
/// can resolve: it stands until the voltage has left it by a threshold.
bool follows_in_leaps(const PreparedRecording& r);
/// The same of any of several recordings.
bool is_read_in_leaps(const std::vector<PreparedRecording>& records);

}  // namespace bms::diagnosis
