#include "diagnosis/good_to.hpp"

#include <algorithm>
#include <array>
#include <numeric>

#include "diagnosis/decision.hpp"
#include "diagnosis/prepare.hpp"
#include "diagnosis/remainder.hpp"
#include "diagnosis/screen.hpp"
#include "diagnosis/trust.hpp"

namespace bms::diagnosis {

model::Tolerance widened(model::Tolerance t, double factor) {
  t.ocv_v *= factor;
  t.drift_v *= factor;
  return t;
}

double widening(const model::CellParameters<>& cell, const std::vector<model::MechanismSetting>& mechanisms,
                std::vector<Record> records) {
  for (Record& r : records) examine(r, cell);
  std::vector<std::size_t> all(model::mechanism_count);
  std::iota(all.begin(), all.end(), std::size_t{0});
  const auto enough = [&](double factor) {
    model::CellParameters<> wide = cell;
    wide.tolerance = widened(wide.tolerance, factor);
    Evidence evidence = evidence_of(wide, mechanisms, records);
    const Fit fit = evidence.fit(evidence.base());
    const Remainder left = what_remains(evidence, fit);
    if (left.gain > decision::much_left || left.far_out > decision::far_out) return false;
    const Screen screen(evidence, fit, all);
    return screen.candidates().empty() || screen.candidates().front().gain < decision::detected;
  };
  constexpr std::array factors = {1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0};
  const auto* least = std::partition_point(factors.begin(), factors.end() - 1, [&](double f) { return !enough(f); });
  return *least;
}

}  // namespace bms::diagnosis
