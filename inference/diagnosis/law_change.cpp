#include "diagnosis/law_change.hpp"

#include <algorithm>

namespace bms::diagnosis {

namespace {

double value_of(const LawTerm& term, const model::TablePoint<double>& at) {
  if (term.law == "ocv") return at.ocv_v;
  return term.law == "ohmic" ? at.r0_ohm : at.r1_ohm;
}

}  // namespace

std::vector<LawChange> law_changes(const Diagnosis& d, const model::CellParameters<>& before) {
  if (!d.law || !d.law->cell || d.law->mechanism) return {};
  double low = 1, high = 0;
  for (const RecordingView& view : d.views) {
    for (const double soc : view.soc) {
      low = std::min(low, soc);
      high = std::max(high, soc);
    }
  }
  if (!(high > low)) return {};
  const auto was = model::prepare<double, model::max_intervals>(before),
             is = model::prepare<double, model::max_intervals>(*d.law->cell);
  std::vector<LawChange> curve;
  for (int k = 0; k < law_change_points; ++k) {
    const double soc = low + (high - low) * k / (law_change_points - 1);
    curve.push_back({soc, value_of(*d.law, model::look_up(is, soc)) - value_of(*d.law, model::look_up(was, soc))});
  }
  return curve;
}

}  // namespace bms::diagnosis
