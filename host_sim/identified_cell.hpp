// What an identification leaves in a cell file beside R0, R1, C1: OCV and capacity of slow runs, and noise.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "host_sim/cell_file.hpp"
#include "host_sim/recording.hpp"
#include "identification/identify.hpp"

namespace bms {

struct OcvTaken {
  std::optional<double> coulombic_efficiency;  ///< discharged over charged; only of a run of each kind
  std::vector<Warning> warnings;
};

/// OCV, gap and capacity of slow charge and discharge recordings, with as few straight pieces as stay within error_asked_v; with more error,
/// and a warning, where that cannot be. Throws BadInput when they are no slow runs.
OcvTaken take_ocv(const std::vector<std::string>& paths, double error_asked_v, CellFile& cell);

/// Noise and tolerance: of the measuring chain by the recordings' rests, of the model by what it leaves over on `judge`, and by what lies
/// on the side of the OCV's gap that it does not lean to.
void take_noise(const std::vector<Recording>& recordings, const identification::Fit& judge, const std::vector<identification::Parameter>& parameters, model::CellParameters<>& p);

/// Seven digits of every number: more are noise.
void round_digits(CellFile& cell);

}  // namespace bms
