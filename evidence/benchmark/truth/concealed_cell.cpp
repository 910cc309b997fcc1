#include "benchmark/truth/concealed_cell.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "benchmark/truth/cell_elements.hpp"
#include "benchmark/truth/parallel_cells.hpp"

namespace bms::benchmark::truth {

Curve::Curve(const std::function<double(double)>& function) : value_(cells + 1) {
  for (std::size_t k = 0; k <= cells; ++k) value_[k] = function(first + step * static_cast<double>(k));
}

int substeps_of(double step_s) {
  constexpr double longest_s = 0.25;
  return std::max(1, static_cast<int>(std::ceil(step_s / longest_s - 1e-9)));
}

namespace {

double shifted_soc(const PlateauSlide& p, double soc) {
  if (p.slide == 0 || soc <= 0 || soc >= 1) return soc;
  const double window = (1 - std::exp(-soc / 0.13)) * (1 - std::exp(-(1 - soc) / 0.13));
  return soc + p.slide * window * (1 + p.tilt * (soc - 0.5));
}

double temperature_factor(const TemperatureLaw& law, double temperature_c) {
  const auto g = [&](double kelvin) { return 1 / (kelvin - law.zero_k); };
  return std::exp(law.steepness_k * (g(temperature_c + zero_celsius_k) - g(reference_k)));
}

/// One cell with all its states under one stimulus.
class CellRun {
 public:
  CellRun(const HealthyCell& cell, const CellEffects& effects, const Stimulus& stimulus, double start_soc)
      : cell_(cell),
        effects_(effects),
        stimulus_(stimulus),
        substeps_(substeps_of(stimulus.step_s)),
        substep_s_(stimulus.step_s / substeps_),
        capacity_as_(3'600 * cell.capacity_ah * effects.capacity_factor),
        lag_kept_(std::exp(-substep_s_ / effects.diffusion.lag_s)),
        stops_(effects.hysteresis, start_soc),
        slab_(effects.diffusion.time_s, substep_s_),
        in_r0_(effects.charge_transfer.alpha),
        in_r1_(effects.charge_transfer.alpha),
        soc_(start_soc),
        voltage_v_(cell.ocv_v.at(start_soc)),
        has_memory_(effects.memory.bump_v != 0),
        core_c_(stimulus.ambient_c.front()),
        can_c_(core_c_) {
    for (std::size_t n = 0; n < 3; ++n)
      fast_kept_[n] =
          std::exp(-substep_s_ / (effects.fast.time_s * std::pow(effects.fast.spread, static_cast<double>(n) - 1)));
  }

  CellTrace trace() {
    CellTrace trace;
    for (std::vector<double>* series : {&trace.voltage_v, &trace.soc, &trace.temperature_c, &trace.v1_v})
      series->reserve(stimulus_.current_a.size());
    for (std::size_t k = 0; k < stimulus_.current_a.size(); ++k) {
      const double current_a = stimulus_.current_a[k];
      const Factors factors = factors_at(k);
      if (k > 0) {
        for (int s = 0; s < substeps_; ++s) advance(current_a, factors);
        advance_slow_states(current_a);
        advance_temperatures(current_a, stimulus_.ambient_c[k], factors);
      }
      update_voltage(k, factors);
      trace.voltage_v.push_back(voltage_v_);
      trace.soc.push_back(soc_);
      trace.temperature_c.push_back(can_c_);
      trace.v1_v.push_back(v1_v_);
    }
    return trace;
  }

 private:
  /// What temperature, direction of the current and growth make of R0, R1 and C1.
  struct Factors {
    double r0 = 1, r1 = 1, c1 = 1;
  };

  Factors factors_at(std::size_t k) const {
    Factors f;
    if (effects_.temperature_law.steepness_k != 0) {
      const double temperature_c =
          stimulus_.resistance_temperature_c.empty() ? core_c_ : stimulus_.resistance_temperature_c[k];
      const double factor = temperature_factor(effects_.temperature_law, temperature_c);
      f.r1 *= factor;
      f.r0 *= std::pow(factor, effects_.temperature_law.share_of_r0);
    }
    if (effects_.asymmetry.excess != 0) {
      const double factor =
          1 + effects_.asymmetry.excess * (0.5 + 0.5 * std::tanh(stimulus_.current_a[k] / effects_.asymmetry.width_a));
      f.r0 *= factor;
      f.r1 *= factor;
    }
    if (effects_.growth.of_r1 != 0) {
      f.r1 *= 1 + effects_.growth.of_r1;
      f.c1 = std::pow(1 + effects_.growth.of_r1, -effects_.growth.c1_exponent);
    }
    return f;
  }

  double r0_ohm(const Factors& f) const {
    const ResistanceGrowth& growth = effects_.growth;
    return cell_.r0_ohm.at(soc_) * f.r0 * (1 + growth.of_r0 * (1 + growth.r0_tilt * (soc_ - 0.5)));
  }

  /// The part of the current that becomes charge of the cell.
  double stored_a(double current_a) const {
    double stored = current_a;
    if (effects_.charge_loss.share != 0 && current_a > 0)
      stored *= 1 - effects_.charge_loss.share * (0.6 + 0.8 * current_a / (current_a + effects_.charge_loss.half_a));
    if (effects_.leak.at_3v3_a != 0) stored -= effects_.leak.at_3v3_a * growth_of(effects_.leak, voltage_v_);
    return stored;
  }

  /// Charge and overvoltages over one substep.
  void advance(double current_a, const Factors& f) {
    const double h = substep_s_;
    const double soc_change = stored_a(current_a) * h / capacity_as_, middle = soc_ + soc_change / 2;
    soc_ += soc_change;

    const double r1 = cell_.r1_ohm.at(middle) * f.r1, c1 = cell_.c1_f.at(middle) * f.c1;
    if (effects_.charge_transfer.share_of_r1 > 0) {
      const double share = effects_.charge_transfer.share_of_r1;
      const auto rate = [&](double v) { return (current_a - in_r1_.current_at(v, share * r1, (1 - share) * r1)) / c1; };
      v1_v_ += h * rate(v1_v_ + h / 2 * rate(v1_v_));
    } else {
      v1_v_ = r1 * current_a + (v1_v_ - r1 * current_a) * std::exp(-h / (r1 * c1));
    }
    if (effects_.hysteresis.half_gap_v != 0) stops_.move(soc_change);
    if (effects_.diffusion.resistance_ohm != 0) {
      const double target_v = effects_.diffusion.resistance_ohm * slab_.advance(current_a);
      diffusion_v_ = target_v + (diffusion_v_ - target_v) * lag_kept_;
    }
    if (effects_.fast.resistance_ohm != 0) {
      constexpr std::array<double, 3> fast_share = {0.3, 0.4, 0.3};
      for (std::size_t n = 0; n < 3; ++n) {
        const double steady_v = effects_.fast.resistance_ohm * fast_share[n] * current_a;
        fast_v_[n] = steady_v + (fast_v_[n] - steady_v) * fast_kept_[n];
      }
    }
  }

  /// Plating and pressure, once per sample.
  void advance_slow_states(double current_a) {
    const double dt = stimulus_.step_s;
    if (effects_.plating.plateau_v != 0) {
      if (current_a > effects_.plating.least_a)
        plated_ += (1 - plated_) * dt / effects_.plating.fill_s;
      else
        plated_ = std::max(0.0, plated_ - dt / effects_.plating.hold_s);
    }
    if (effects_.pressure.lift_v != 0)
      pressure_ += (std::abs(current_a) / cell_.capacity_ah - pressure_) * dt / effects_.pressure.time_constant_s;
  }

  void advance_temperatures(double current_a, double ambient_c, const Factors& f) {
    const double dt = stimulus_.step_s;
    const plant::Thermal& thermal = cell_.thermal;
    const double heat_w = current_a * current_a * r0_ohm(f) + v1_v_ * v1_v_ / (cell_.r1_ohm.at(soc_) * f.r1);
    if (effects_.core.to_can_k_per_w > 0) {
      const double inner_j_per_k = thermal.heat_capacity_j_per_k * effects_.core.share_of_heat_capacity;
      const double outer_j_per_k = thermal.heat_capacity_j_per_k - inner_j_per_k;
      const double outward_w = (core_c_ - can_c_) / effects_.core.to_can_k_per_w;
      core_c_ += dt / inner_j_per_k * (heat_w - outward_w);
      can_c_ +=
          dt / outer_j_per_k * (outward_w - effects_.core.cooling * thermal.to_ambient_w_per_k * (can_c_ - ambient_c));
    } else {
      core_c_ += dt / thermal.heat_capacity_j_per_k * (heat_w - thermal.to_ambient_w_per_k * (core_c_ - ambient_c));
      can_c_ = core_c_;
    }
  }

  void update_voltage(std::size_t k, const Factors& f) {
    const double current_a = stimulus_.current_a[k], r0 = r0_ohm(f);
    voltage_v_ = cell_.ocv_v.at(shifted_soc(effects_.plateau_slide, soc_)) + v1_v_;
    if (effects_.charge_transfer.share_of_r0 > 0) {
      const double share = effects_.charge_transfer.share_of_r0;
      voltage_v_ += (1 - share) * r0 * current_a + in_r0_.under_current(current_a, share * r0);
    } else {
      voltage_v_ += r0 * current_a;
    }
    if (effects_.hysteresis.half_gap_v != 0) voltage_v_ += stops_.voltage_v(soc_);
    voltage_v_ += diffusion_v_ + fast_v_[0] + fast_v_[1] + fast_v_[2];
    if (effects_.entropy_scale != 0)
      voltage_v_ +=
          effects_.entropy_scale * effects_.entropy_v_per_k.at(soc_) * (core_c_ + zero_celsius_k - reference_k);
    if (effects_.contact_scale != 0) voltage_v_ += effects_.contact_scale * effects_.contact_ohm[k] * current_a;
    if (effects_.plating.plateau_v != 0) voltage_v_ += effects_.plating.plateau_v * std::tanh(plated_ / 0.12);
    if (effects_.pressure.lift_v != 0) voltage_v_ += effects_.pressure.lift_v * std::pow(pressure_ / 0.5, 1.7);
    if (has_memory_) add_memory(current_a);
  }

  void add_memory(double current_a) {
    const Memory& memory = effects_.memory;
    was_below_ = was_below_ || soc_ < memory.turned_at;
    if (was_below_ && soc_ > memory.turned_at + 0.12) has_memory_ = false;
    const double off = (soc_ - memory.turned_at) / memory.width;
    voltage_v_ +=
        memory.bump_v * std::exp(-off * off) * (0.65 + 0.35 * std::tanh(current_a / (0.1 * cell_.capacity_ah)));
  }

  const HealthyCell& cell_;
  const CellEffects& effects_;
  const Stimulus& stimulus_;
  const int substeps_;
  const double substep_s_, capacity_as_, lag_kept_;
  std::array<double, 3> fast_kept_{};

  StopOperators stops_;
  Slab slab_;
  Electrode in_r0_, in_r1_;
  double soc_, v1_v_ = 0, diffusion_v_ = 0, voltage_v_;
  std::array<double, 3> fast_v_{};
  double plated_ = 0, pressure_ = 0;
  bool has_memory_, was_below_ = false;
  double core_c_, can_c_;
};

}  // namespace

double growth_of(const Leak& leak, double voltage_v) {
  return std::exp((std::min(voltage_v, 3.6) - 3.3) / leak.per_e_v);
}

CellTrace run_cell(const HealthyCell& cell, const CellEffects& effects, const Stimulus& stimulus, double start_soc) {
  if (effects.parallel.inequality != 0) return run_parallel_cells(cell, effects.parallel, stimulus, start_soc);
  return CellRun(cell, effects, stimulus, start_soc).trace();
}

}  // namespace bms::benchmark::truth
