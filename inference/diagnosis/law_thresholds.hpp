// Numbers that decide on the law of an unknown cause and on a term for it. Chosen on seed 5 of the effects outside the
// catalogue (`outside development 5`) unless another origin is given.
#pragma once

#include <array>
#include <cstddef>

namespace bms::diagnosis {

/// A term for what no known cause explains (law_term.hpp).
struct TermThresholds {
  std::size_t folds = 3, blocks = 24;                  ///< of each recording: every third block is left out in turn
  std::size_t long_blocks = 6;                         ///< a term must do no harm either where so long parts are left
                                                       ///< out: next to short ones a drift looks like a law
  std::array<double, 3> times_tolerance = {20, 8, 3};  ///< of the law's tables
  double error_left = 0.8;       ///< share of the error on what was left out, below which a term pays
  double improves_sigmas = 1.5;  ///< mean improvement of the blocks left out over its standard deviation, at least
  double as_good = 1.02;         ///< of the least error, within which the smaller factor is taken
};

/// The evidence of a law (law_evidence.hpp).
struct EvidenceThresholds {
  double least = 20;           ///< of a law: healthy recordings have less
  std::size_t few_causes = 2;  ///< named without healthy recordings, at most so many are doubted: a cell file missing
                               ///< three or more effects produces residuals outside the catalogue
  double narrowest = 1.0 / 64, widest = 4;  ///< prior of a law's columns, times the free error
  /// [s] time constants of the load before; a memory of the load is fitted from the slow ones.
  std::array<double, 3> fast_s = {4, 15, 60}, slow_s = {250, 1'000, 4'000};
  std::size_t late_rows = 2;           ///< lateness of a channel that is tried
  double middle_c = 25, swing_k = 10;  ///< temperature at which nothing changes, and a usual distance from it
  double ahead_soc = 0.05;             ///< by which a part of the cell is ahead
  double slope_soc = 0.002;            ///< for the slope of the OCV
};

/// A reading that follows in leaps.
struct LeapThresholds {
  std::size_t moves = 30;        ///< of the reading, at least
  double stands = 0.2;           ///< share of the rows, at least, in which it stands still. A cell under a square wave
                                 ///< that is read once in each half moves by much in every row (NASA B0025)
  double least_quantile = 0.02;  ///< that counts as the smallest leap
  double of_median = 0.3;        ///< the smallest leap exceeds this share of the median move,
  double steps = 2.5;            ///< and so many steps of the resolution
  double same_v = 1e-9;          ///< [V] by which readings differ that are the same
};

struct LawThresholds {
  TermThresholds term;
  EvidenceThresholds law;
  LeapThresholds leaps;
};

inline constexpr LawThresholds law_thresholds{};

}  // namespace bms::diagnosis
