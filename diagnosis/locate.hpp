// Where a mismatch lies: in time, and in which regimes of soc, current, direction, temperature and time since an edge.
#pragma once

#include <cstddef>
#include <map>
#include <vector>

#include "diagnosis/diagnose.hpp"
#include "diagnosis/hypothesis.hpp"

namespace bms::diagnosis {

struct Contributions {
  std::map<std::size_t, double> rms_v;      ///< by mechanism: how much the voltage would differ without it
  std::vector<std::vector<double>> energy;  ///< by record and row, of all of them together, V^2
  std::vector<model::Span> spans;           ///< of the first record
  double explained_share = 0;               ///< of the squared error beyond the calibration's that is gone
  double remaining_rmse_v = 0;              ///< measured less extended, base parameters fitted
};

Contributions contributions(const LikelihoodModel& evidence, const HypothesisFit& base, const HypothesisFit& fit);

/// Where the energy exceeds a twenty-fifth of its largest (a fifth of the amplitude); stretches less than a tenth of
/// the record apart are one.
std::vector<model::Span> strongest_spans(const PreparedRecording& record, const std::vector<double>& energy);

/// Of each axis the narrowest range that holds 70 % of the energy, where that is much narrower than the record; the
/// sharpest first.
std::vector<Regime> regimes(const LikelihoodModel& evidence, const HypothesisFit& fit,
                            const std::vector<std::vector<double>>& energy);

}  // namespace bms::diagnosis
