// Which physics the published figures of the paper ask for: a simulated cell with a few unknowns is fitted to Tables 5
// to 8 and Appendix A at once, with and without each effect, and predicts figures that were not used.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "study/reconciliation.hpp"
#include "study/study.hpp"

namespace bms::study {

/// Effects that a candidate may have.
struct Effects {
  bool hysteresis = false, slow_polarisation = false, other_ocv = false;
  bool whole_ocv = false;  ///< the models of Tables 7 and 8 know the OCV over the whole range, not as a line at 40 %
  std::string name() const;
};

/// A number of the chosen candidate with its 95 % interval.
struct PaperPhysics {
  std::string id;
  double value = 0, low = 0, high = 0;
  std::string unit;
};

/// How well simulated figures agree with Table 7.
struct Table7Match {
  double rank_correlation = 0;               ///< of all 49 cells (Spearman)
  double off_diagonal_rank_correlation = 0;  ///< of the 42
  double median_gap_points = 0;
};

struct CandidateFit {
  Effects effects;
  std::size_t unknowns = 0;
  double score = 0;   ///< smaller is better; it contains the penalty of Schwarz for the unknowns
  double weight = 0;  ///< share among the candidates, exp(-score)
  Table7Match table7;
};

/// Whether the figures ask for an effect: the best candidate with it, compared with the best one without it.
struct EffectVerdict {
  std::string effect;
  double probability = 0;       ///< if it was as likely as not before
  std::optional<bool> present;  ///< missing: the figures do not decide it (5 to 95 %)
};

/// Figures that were left out of a fit, predicted.
struct HeldOut {
  std::string table;  ///< "8"; or the half of Table 7
  std::string from;   ///< what was fitted
  std::optional<double>
      rank_correlation;  ///< of Table 8 the mean over its columns; missing where there are few figures
  std::optional<double> median_gap_points;  ///< of fits in percent
  double typical_ratio = 0;                 ///< exp of the RMS of the logarithms
};

struct Contradiction {
  std::string figure;
  double published = 0, simulated = 0;
};

struct PaperDiagnosis {
  std::vector<CandidateFit> candidates;  ///< best first
  std::vector<PaperPhysics> physics;     ///< of the best
  CandidateFit plain;                    ///< the equations of the paper alone
  std::vector<EffectVerdict> effects;
  std::vector<HeldOut> held_out;
  std::vector<HeldOut> held_out_plain;  ///< those of Table 7 by the equations of the paper alone; the others are empty
  std::vector<Contradiction> contradictions;
  std::vector<TableMisfit> misfits;
  std::vector<Figure> simulated;  ///< by the best candidate, in the order of published_figures()
  std::string statement;          ///< for the reader
  double seconds = 0;
};

/// Effects of every candidate.
std::vector<Effects> all_effects();

struct PaperDiagnosisOptions {
  std::vector<Figure> published = published_figures();
  std::vector<Effects> candidates = all_effects();  ///< the one without effects among them
  int iterations = 8;
  int screening_points = 24;  ///< for a second search where all of Table 7 is left out: then there are several minima
  bool hold_out = true;       ///< predict figures that a fit did not use
};
PaperDiagnosis diagnose_paper(const model::CellParameters<>& cell, const PaperDiagnosisOptions& options = {});

/// Tables of the page.
std::vector<files::PageTable> tables_of(const PaperDiagnosis& diagnosis);

/// Spearman's rank correlation; ties get their mean rank.
double rank_correlation(const std::vector<double>& a, const std::vector<double>& b);

}  // namespace bms::study
