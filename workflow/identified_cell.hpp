// What an identification leaves in a cell file beside R0, R1, C1: OCV and capacity of slow runs, and noise.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "files/cell_file.hpp"
#include "identification/hysteresis_gap.hpp"
#include "identification/identify.hpp"
#include "measurement/recording.hpp"
#include "workflow/identification_data.hpp"

namespace bms::workflow {

struct OcvResult {
  std::optional<double> coulombic_efficiency;          ///< discharged over charged; only of a run of each kind
  std::vector<identification::GapAtTemperature> gaps;  ///< of each temperature with a run of each kind
  std::vector<measurement::Warning> warnings;
};

/// OCV, gap and capacity of slow charge and discharge recordings, with as few straight pieces as stay within
/// max_error_v; with more error, and a warning, where that cannot be. Of runs at several temperatures those nearest
/// to 25 degrees C make the curve. both_branches: with corners where the gap bends, too. Throws BadInput when they are
/// no slow runs.
OcvResult identify_ocv(const std::vector<std::string>& paths, double max_error_v, bool both_branches,
                       files::CellFile& cell);

/// The hysteresis between the measured curves of charge and discharge, as a mechanism; none where there was one run.
void identify_hysteresis(const OcvResult& ocv, files::CellFile& cell);

/// Takes what the cell's mechanisms do to the voltage off a record, so that a circuit can be identified from the rest.
identification::DataSet without_mechanisms(const files::CellFile& cell, const IdentificationData& of);

/// What an estimator needs besides: resistances that follow the temperature, errors that last as states of the filter,
/// and noise as it then is. data: what was identified from, as measured.
inline constexpr const char* extended_noise =
    "model: what they leave for longer than ten minutes, and a minor loop of the hysteresis; current offset: a sensor "
    "good to a hundredth of the 1C current, over a day's work; "
    "at rest: an open circuit, to a fifth of that; gain: half a percent of the reading and half a percent of the "
    "capacity";
void extend(const OcvResult& ocv, const std::vector<IdentificationData>& data, files::CellFile& cell);

/// Noise and tolerance: of the measuring chain by the recordings' rests, of the model by what it leaves over on
/// `judge`, and by what lies on the side of the OCV's gap that it does not lean to.
void identify_noise(const std::vector<measurement::Recording>& recordings, const identification::FitStatistics& judge,
                    const std::vector<identification::Parameter>& parameters, model::CellParameters<>& p);

/// Recordings within a few kelvins of each other, by their place in a list.
struct TemperatureGroup {
  double temperature_c = 25;  ///< mean, to a tenth
  std::vector<std::size_t> recordings;
};
/// Ascending; one of 25 degrees C for all where one of them has no temperature.
std::vector<TemperatureGroup> group_by_temperature(const std::vector<measurement::Recording>& recordings);

/// Seven digits of every number: more are noise.
void round_digits(files::CellFile& cell);

}  // namespace bms::workflow
