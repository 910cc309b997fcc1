#include "diagnosis/model_tolerance.hpp"

#include <algorithm>
#include <numeric>

#include "diagnosis/prepare.hpp"
#include "diagnosis/recording_check.hpp"
#include "diagnosis/residual_test.hpp"
#include "diagnosis/screen.hpp"
#include "diagnosis/thresholds.hpp"

namespace bms::diagnosis {

model::Tolerance with_wider_tolerance(model::Tolerance t, double factor) {
  t.ocv_v *= factor;
  t.drift_v *= factor;
  return t;
}

double tolerance_factor(const model::CellParameters<>& cell, const std::vector<model::MechanismSetting>& mechanisms,
                        std::vector<PreparedRecording> records) {
  for (PreparedRecording& r : records) check_recording(r, cell);
  std::vector<std::size_t> all(model::mechanism_count);
  std::iota(all.begin(), all.end(), std::size_t{0});
  const auto enough = [&](double factor) {
    model::CellParameters<> wide = cell;
    wide.tolerance = with_wider_tolerance(wide.tolerance, factor);
    const LikelihoodModel likelihood = likelihood_model_of(wide, mechanisms, records);
    const HypothesisFit fit = likelihood.fit(likelihood.base());
    const ResidualTest left = test_residual(likelihood, fit);
    if (left.gain > thresholds.adequacy.unexplained || left.far_out > thresholds.adequacy.far_out) return false;
    const Screen screen(likelihood, fit, all);
    return screen.candidates().empty() || screen.candidates().front().gain < thresholds.decision.detected;
  };
  constexpr const auto& factors = thresholds.model_tolerance.factors;
  const auto* least = std::partition_point(factors.begin(), factors.end() - 1, [&](double f) { return !enough(f); });
  return *least;
}

}  // namespace bms::diagnosis
