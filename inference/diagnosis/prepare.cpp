#include "diagnosis/prepare.hpp"

#include <algorithm>

#include "diagnosis/denoise_current.hpp"
#include "diagnosis/idle_reading.hpp"
#include "diagnosis/thresholds.hpp"
#include "diagnosis/true_current.hpp"

namespace bms::diagnosis {

namespace {

LikelihoodModel model_of(const model::CellParameters<>& cell, const std::vector<model::MechanismSetting>& own,
                         std::vector<PreparedRecording> records, const LearnedError& learned) {
  const model::CellParameters<> judged = learned.applied(cell);
  const NoiseModel noise = nominal_noise(records, judged);
  for (PreparedRecording& r : records) {
    if (r.checks.empty()) add_idle_checks(r, judged);
    const double at_most_a = thresholds.denoising.noise_times_file * cell.noise.current_a;
    r.current_a = denoise_current(r.current_a, std::min(current_noise(r.current_a), at_most_a));
  }
  return {judged, own, std::move(records), noise, {}, learned};
}

}  // namespace

NoiseModel nominal_noise(const std::vector<PreparedRecording>& records, const model::CellParameters<>& cell) {
  constexpr const Thresholds::Noise& limits = thresholds.noise;
  NoiseModel noise;
  noise.white_v = limits.white_share_of_ocv * cell.tolerance.ocv_v;
  for (const PreparedRecording& r : records)
    noise.white_v = std::max(
        noise.white_v, white_noise(r.voltage_v, r.current_a, limits.quiet_c * cell.capacity_ah, cell.noise.voltage_v));
  noise.fast_v = std::max(cell.tolerance.ocv_v, limits.fast_at_least_v);
  noise.slow_v = limits.slow_times_drift * std::max(cell.tolerance.drift_v, limits.slow_at_least_v);
  return noise;
}

LikelihoodModel likelihood_model_of(const model::CellParameters<>& cell,
                                    const std::vector<model::MechanismSetting>& own,
                                    std::vector<PreparedRecording> records,
                                    const std::vector<healthy_data::HealthyRegime>& regimes) {
  LearnedError learned(regimes, cell, records);
  // a fault of the sensors leads to where no healthy recording was, although the cell was not there
  if (learned.is_elsewhere())
    learned = {regimes, cell, with_likeliest_current(model_of(cell, own, records, LearnedError()))};
  return model_of(cell, own, std::move(records), learned);
}

}  // namespace bms::diagnosis
