// The 95 % interval of a predicted voltage, and how many readings of a recording it contains.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "diagnosis/mechanism.hpp"
#include "diagnosis/prepared_recording.hpp"
#include "healthy_data/healthy_data.hpp"
#include "measurement/statistics.hpp"
#include "model/cell_parameters.hpp"

namespace bms::diagnosis {

inline constexpr double nominal_coverage = 0.95;
inline constexpr double half_width_sigmas = 1.96;  ///< of a normal distribution that contains nominal_coverage

/// Readings within the interval, counted one by one or recording by recording.
class Coverage {
 public:
  /// A reading without a value does not count.
  void add(double error_v, double sigma_v);
  void add(std::span<const double> measured_v, std::span<const double> predicted_v, std::span<const double> sigma_v);

  std::size_t readings() const { return error_.count(); }
  double share() const;                                       ///< within the interval; NaN without a reading
  double error_v() const { return error_.root(); }            ///< RMS of measured less predicted
  double half_width_v() const { return half_width_.root(); }  ///< RMS
  /// Returns true if the prediction failed: fewer readings lie within the interval than nominal_coverage, and the error
  /// is larger than what the noise alone explains.
  bool is_beyond(double noise_floor_v) const { return share() < nominal_coverage && error_v() > noise_floor_v; }

 private:
  std::size_t within_ = 0;
  measurement::MeanSquare error_, half_width_;
};

/// "The 95 % interval of the prediction contains 93.8 % of the readings of drive2.csv; its half width is 12.1 mV, the
/// error 5.3 mV (RMS)."
std::string sentence_of(const Coverage& coverage, const std::string& recording);

struct PredictionInterval {
  std::vector<double> sigma_v;  ///< standard deviation of each reading around its prediction
  Coverage coverage;
};

/// The interval around a cell's prediction of a record: by the cell's noise and tolerance, and by what healthy
/// recordings showed (predicted_band.hpp). settings: mechanisms of the cell. predicted_v: by row, as predict() gives
/// it. voltage_v of the record may be all NaN. Cost: one simulation for each base parameter.
PredictionInterval prediction_interval(const model::CellParameters<>& cell,
                                       const std::vector<MechanismSetting>& settings, const PreparedRecording& record,
                                       std::span<const double> predicted_v, const healthy_data::HealthyData& healthy);

}  // namespace bms::diagnosis
