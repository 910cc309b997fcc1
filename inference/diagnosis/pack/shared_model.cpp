#include "diagnosis/pack/shared_model.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "diagnosis/pack/current_kind.hpp"

namespace bms::diagnosis::pack::shared {

namespace {

constexpr const PackThresholds::Shared& of_model = limits.shared;

double polarisation_prior(double unseen_share) {
  const double slow = std::min(1.0, unseen_share / of_model.slow_from);
  return of_model.polarisation * std::pow(of_model.slow_polarisation / of_model.polarisation, slow);
}

double slope_at(const Track& t, double soc) {
  const double reach = of_model.slope_reach;
  return (model::look_up(t.cell, soc + reach).ocv_v - model::look_up(t.cell, soc - reach).ocv_v) / (2 * reach);
}

}  // namespace

double charge_wave(Eigen::Index k, double share) {
  return std::sin((static_cast<double>(k) + 0.5) * std::numbers::pi * share);
}

double beyond_waves(const Problem& p) {
  return p.pack.count_walk * p.pack.count_walk * p.hours() /
         (std::numbers::pi * std::numbers::pi * PackThresholds::Shared::charge_waves);
}

Unknowns healthy_of(const Problem& p, double ocv_factor) {
  const Track& t = p.track;
  Unknowns u = Unknowns::Constant(ocv_factor * t.ocv_tolerance_v / std::numbers::sqrt2);
  u[start] = of_model.start_soc;
  u[sensor_offset] = of_model.healthy_offset_c * t.capacity_ah;
  for (Eigen::Index k = 0; k < PackThresholds::Shared::charge_waves; ++k) {
    const double amplitude = std::numbers::sqrt2 / ((static_cast<double>(k) + 0.5) * std::numbers::pi);
    u[charge_wave_1 + k] = std::max(of_model.no_walk, p.pack.count_walk * std::sqrt(p.hours()) * amplitude);
  }
  u[sensor_gain] = of_model.healthy_gain;
  u[all_capacity] = of_model.healthy_capacity;
  u[all_resistance] = of_model.resistance;
  u[all_polarisation] = polarisation_prior(t.unseen_share);
  u[warmth] = of_model.per_k;
  u[level] = ocv_factor * t.ocv_tolerance_v;
  u[lead] = of_model.lead_rows;
  for (Eigen::Index w = resistance_wave_1; w < unknowns; ++w) u[w] = of_model.resistance_wave;
  return u;
}

Course course_of(const Problem& p, const Unknowns& u) {
  Course c;
  double v_rc_v = 0;
  std::uint8_t interval = 0;
  for (std::size_t k = 0; k < p.pack.rows(); ++k) {
    const double lasted_s = p.pack.time_s[k] - p.pack.time_s.front();
    const double lost = u[sensor_offset] * lasted_s / (3'600 * p.track.capacity_ah);
    c.soc.push_back(p.track.soc.front() + u[start] +
                    (1 + u[all_capacity]) * ((1 - u[sensor_gain]) * p.charge[k] - lost));
    for (Eigen::Index w = 0; w < PackThresholds::Shared::charge_waves; ++w)
      c.soc.back() += u[charge_wave_1 + w] * charge_wave(w, lasted_s / (3'600 * p.hours()));
    const double mean_a = mean_current_a(p.pack, k);
    const double current_a = (1 - u[sensor_gain]) * (std::isfinite(mean_a) ? mean_a : 0) - u[sensor_offset];
    const double dt_s = k > 0 ? p.pack.time_s[k] - p.pack.time_s[k - 1] : 0;
    const auto at = model::look_up(p.track.cell, c.soc[k], interval);
    v_rc_v += -std::expm1(-dt_s / (at.r1_ohm * at.c1_f)) * (at.r1_ohm * current_a - v_rc_v);
    c.v_rc_v.push_back(v_rc_v);
  }
  return c;
}

void set_row(const Problem& p, const Unknowns& u, std::size_t block, double soc, double v_rc_v, Columns& columns) {
  const Blocks& b = p.blocks;
  const auto at = model::look_up(p.track.cell, soc);
  const double current_a = (1 - u[sensor_gain]) * b.current_a[block] - u[sensor_offset];
  const double hours = (b.time_s[block] - p.pack.time_s.front()) / 3'600, r0_v = at.r0_ohm * current_a;
  const double slope_v = slope_at(p.track, soc), share = hours / p.hours();
  double moved = soc - p.track.soc.front() - u[start];
  auto row = columns.row(static_cast<Eigen::Index>(block));
  row[start] = slope_v;
  for (Eigen::Index k = 0; k < PackThresholds::Shared::charge_waves; ++k) {
    row[charge_wave_1 + k] = slope_v * charge_wave(k, share);
    moved -= u[charge_wave_1 + k] * charge_wave(k, share);
  }
  row[sensor_offset] = -slope_v * hours / p.track.capacity_ah - at.r0_ohm - at.r1_ohm;
  row[sensor_gain] = -slope_v * moved - r0_v - v_rc_v;
  row[all_capacity] = slope_v * moved;
  row[all_resistance] = r0_v + v_rc_v;
  row[all_polarisation] = v_rc_v;
  row[warmth] = b.warmer_k[block] * (r0_v + v_rc_v);
  row[level] = 1;
  row[lead] = at.r0_ohm * b.change_a[block];
  const auto wave = [&](Eigen::Index k) { return std::cos(std::numbers::pi * static_cast<double>(k + 1) * soc); };
  for (Eigen::Index k = 0; k < PackThresholds::Shared::ocv_waves; ++k) row[wave_1 + k] = wave(k);
  for (Eigen::Index k = 0; k < PackThresholds::Shared::resistance_waves; ++k)
    row[resistance_wave_1 + k] = wave(k) * (r0_v + v_rc_v);
  double model_v = at.ocv_v + r0_v + v_rc_v;
  for (Eigen::Index k = all_resistance; k < unknowns; ++k) model_v += row[k] * u[k];
  row[unknowns] = b.voltage_v[block] - model_v;
}

}  // namespace bms::diagnosis::pack::shared
