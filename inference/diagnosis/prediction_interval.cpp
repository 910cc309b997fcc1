#include "diagnosis/prediction_interval.hpp"

#include <cmath>

#include <fmt/format.h>

#include "diagnosis/predicted_band.hpp"
#include "diagnosis/prepare.hpp"

namespace bms::diagnosis {

void Coverage::add(double error_v, double sigma_v) {
  if (!std::isfinite(error_v)) return;
  within_ += std::abs(error_v) <= half_width_sigmas * sigma_v ? 1 : 0;
  error_.add(error_v);
  half_width_.add(half_width_sigmas * sigma_v);
}

void Coverage::add(std::span<const double> measured_v, std::span<const double> predicted_v,
                   std::span<const double> sigma_v) {
  for (std::size_t k = 0; k < sigma_v.size(); ++k) add(measured_v[k] - predicted_v[k], sigma_v[k]);
}

double Coverage::share() const {
  return readings() > 0 ? static_cast<double>(within_) / static_cast<double>(readings()) : std::nan("");
}

std::string sentence_of(const Coverage& c, const std::string& recording) {
  return fmt::format(
      "The {:.0f} % interval of the prediction contains {:.1f} % of the readings of {}; "
      "its half width is {:.1f} mV, the error {:.1f} mV (RMS).",
      100 * nominal_coverage, 100 * c.share(), recording, 1e3 * c.half_width_v(), 1e3 * c.error_v());
}

PredictionInterval prediction_interval(const model::CellParameters<>& cell,
                                       const std::vector<MechanismSetting>& settings, const PreparedRecording& record,
                                       std::span<const double> predicted_v, const healthy_data::HealthyData& healthy) {
  PredictionInterval interval{predicted_sigma_v(likelihood_model_of(cell, settings, {record}), 0, healthy), {}};
  interval.coverage.add(record.voltage_v, predicted_v, interval.sigma_v);
  return interval;
}

}  // namespace bms::diagnosis
