#include "diagnosis/model_tolerance.hpp"

#include <algorithm>
#include <array>
#include <numeric>

#include "diagnosis/decision.hpp"
#include "diagnosis/prepare.hpp"
#include "diagnosis/recording_check.hpp"
#include "diagnosis/residual_test.hpp"
#include "diagnosis/screen.hpp"

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
    LikelihoodModel evidence = likelihood_model_of(wide, mechanisms, records);
    const HypothesisFit fit = evidence.fit(evidence.base());
    const Remainder left = test_residual(evidence, fit);
    if (left.gain > decision::much_left || left.far_out > decision::far_out) return false;
    const Screen screen(evidence, fit, all);
    return screen.candidates().empty() || screen.candidates().front().gain < decision::detected;
  };
  constexpr std::array factors = {1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0};
  const auto* least = std::partition_point(factors.begin(), factors.end() - 1, [&](double f) { return !enough(f); });
  return *least;
}

}  // namespace bms::diagnosis
