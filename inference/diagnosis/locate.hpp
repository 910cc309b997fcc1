// Where a mismatch lies: in time, and in which regimes of soc, current, temperature and time since an edge.
#pragma once

#include <cstddef>
#include <map>
#include <vector>

#include "diagnosis/likelihood_model.hpp"
#include "diagnosis/verdict.hpp"

namespace bms::diagnosis {

struct Contributions {
  std::map<std::size_t, double> rms_v;      ///< by mechanism: RMS change of the voltage without it [V]
  std::vector<std::vector<double>> energy;  ///< by record and row, of all of them together [V^2]
  std::vector<model::Span> spans;           ///< of the first record
  double explained_share = 0;               ///< of the squared error of the calibration, less noise, that is gone
  double remaining_rmse_v = 0;              ///< measured less extended model, base parameters fitted [V]
};

/// Share of a squared error, less that of the white noise, that is gone; all RMS [V].
double explained_share(double error_v, double remaining_v, double white_v);

/// base: the calibration alone. fit: with mechanisms.
Contributions contributions(const LikelihoodModel& likelihood, const HypothesisFit& base, const HypothesisFit& fit);

/// Where the energy exceeds a share of its peak (Thresholds::Location); spans close to each other are one.
std::vector<model::Span> strongest_spans(const PreparedRecording& record, const std::vector<double>& energy);

/// Of each axis the narrowest range that holds most of the energy, if the recordings spend much less time there; the
/// sharpest first. energy: by record and row.
std::vector<Regime> regimes(const LikelihoodModel& likelihood, const HypothesisFit& fit,
                            const std::vector<std::vector<double>>& energy);

}  // namespace bms::diagnosis
