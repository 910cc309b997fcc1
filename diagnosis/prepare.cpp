#include "diagnosis/prepare.hpp"

#include <algorithm>

#include "diagnosis/denoise_current.hpp"

namespace bms::diagnosis {

namespace {

/// No model is better from sample to sample than this share of what its OCV is good to.
constexpr double least_white = 0.2;

}  // namespace

NoiseModel nominal_noise(const std::vector<PreparedRecording>& records, const model::CellParameters<>& cell) {
  NoiseModel noise;
  noise.white_v = least_white * cell.tolerance.ocv_v;
  for (const PreparedRecording& r : records)
    noise.white_v =
        std::max(noise.white_v, white_noise(r.voltage_v, r.current_a, 0.01 * cell.capacity_ah, cell.noise.voltage_v));
  noise.fast_v = std::max(cell.tolerance.ocv_v, 5e-4);
  noise.slow_v = 1.3 * std::max(cell.tolerance.drift_v, 5e-4);
  return noise;
}

LikelihoodModel likelihood_model_of(const model::CellParameters<>& cell,
                                    const std::vector<model::MechanismSetting>& own,
                                    std::vector<PreparedRecording> records) {
  const NoiseModel noise = nominal_noise(records, cell);
  for (PreparedRecording& r : records)
    r.current_a = denoise_current(r.current_a, std::min(current_noise(r.current_a), 1.5 * cell.noise.current_a));
  return {cell, own, std::move(records), noise};
}

}  // namespace bms::diagnosis
