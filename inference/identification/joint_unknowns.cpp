// The parts of the joint fit that are not the fit: its unknowns, and small sums over recordings.
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "identification/joint_fit.hpp"

namespace bms::identification {

double mean_of(const model::Column<double, model::max_rc_nodes>& column) {
  double sum = 0;
  for (std::size_t k = 0; k < column.size; ++k) sum += column[k];
  return sum / static_cast<double>(column.size);
}

std::size_t place_of(const JointModel& m, std::size_t mechanism) {
  for (std::size_t k = 0; k < m.mechanisms.size(); ++k) {
    if (m.mechanisms[k].index == mechanism) return k;
  }
  throw std::invalid_argument("joint fit: the mechanism of an unknown is missing");
}

std::string JointUnknown::name() const {
  switch (of) {
    case Of::r0:
      return "r0_ohm";
    case Of::r1:
      return "r1_ohm";
    case Of::c1:
      return "c1_f";
    default: {
      const model::MechanismInfo& info = model::catalogue[mechanism];
      return std::string(info.id) + "." + std::string(info.parameter[parameter].name);
    }
  }
}

JointUnknown unknown_of(std::string_view mechanism, std::string_view parameter, double start, double capacity_ah,
                        bool positive) {
  JointUnknown u;
  u.mechanism = model::mechanism_index(mechanism);
  if (u.mechanism == model::mechanism_count) throw std::invalid_argument("joint fit: no such mechanism");
  const model::MechanismInfo& info = model::catalogue[u.mechanism];
  while (u.parameter < info.parameters && info.parameter[u.parameter].name != parameter) ++u.parameter;
  if (u.parameter == info.parameters) throw std::invalid_argument("joint fit: no such parameter");
  u.high = info.parameter[u.parameter].upper(capacity_ah);
  u.low = info.parameter[u.parameter].lower(capacity_ah);
  if (positive) u.low = std::max(u.low, 1e-4 * u.high);
  u.start = std::clamp(start, u.low, u.high);
  u.positive = positive;
  return u;
}

JointModel with_values(const JointModel& model, const Eigen::VectorXd& value) {
  JointModel with = model;
  for (std::size_t k = 0; k < model.unknowns.size(); ++k) {
    const JointUnknown& u = model.unknowns[k];
    const double v = value[static_cast<Eigen::Index>(k)];
    const auto scale = [&](auto& column) {
      const double factor = v / mean_of(column);
      for (std::size_t j = 0; j < column.size; ++j) column[j] *= factor;
    };
    if (u.of == JointUnknown::Of::r0) scale(with.cell.rc.r0_ohm);
    if (u.of == JointUnknown::Of::r1) scale(with.cell.rc.r1_ohm);
    if (u.of == JointUnknown::Of::c1) scale(with.cell.rc.c1_f);
    if (u.of == JointUnknown::Of::mechanism) with.mechanisms[place_of(model, u.mechanism)].value[u.parameter] = v;
  }
  // A branch that no recording shows has any time constant. One beyond what a cell file accepts does not show in it.
  auto& rc = with.cell.rc;
  constexpr auto farad = model::accepted::capacitance_f;
  constexpr auto seconds = model::accepted::time_constant_s;
  constexpr double inside = 1 + 1e-9;  // the product of a quotient may miss the bound
  for (std::size_t j = 0; j < rc.c1_f.size; ++j) {
    const double low = std::max(farad.low, inside * seconds.low / rc.r1_ohm[j]);
    rc.c1_f[j] = std::clamp(rc.c1_f[j], low, std::max(low, std::min(farad.high, seconds.high / inside / rc.r1_ohm[j])));
  }
  return with;
}

double rmse_v(const Data& measured, std::span<const double> simulated_v) {
  double squares = 0;
  std::size_t count = 0;
  for (std::size_t k = 0; k < measured.size(); ++k) {
    if (!std::isfinite(measured.voltage_v[k])) continue;
    squares += std::pow(simulated_v[k] - measured.voltage_v[k], 2);
    ++count;
  }
  return count > 0 ? std::sqrt(squares / static_cast<double>(count)) : std::numeric_limits<double>::quiet_NaN();
}

double current_correction_a(const Data& data, std::span<const double> soc_ref, double initial_soc) {
  double counted = initial_soc, known_a = 0, tt = 0, te = 0;
  for (std::size_t k = 1; k < data.size(); ++k) {
    if (std::isfinite(data.current_a[k])) known_a = data.current_a[k];
    const double per_a = 1 / (3'600 * data.capacity_ah), t = (data.time_s[k] - data.time_s[0]) * per_a;
    counted += known_a * (data.time_s[k] - data.time_s[k - 1]) * per_a;
    if (!std::isfinite(soc_ref[k])) continue;
    tt += t * t;
    te += t * (soc_ref[k] - counted);
  }
  return tt > 0 ? te / tt : 0;
}

}  // namespace bms::identification
