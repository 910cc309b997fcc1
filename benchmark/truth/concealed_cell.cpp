#include "benchmark/truth/concealed_cell.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace bms::benchmark::truth {

Curve::Curve(const std::function<double(double)>& function) : value_(cells + 1) {
  for (std::size_t k = 0; k <= cells; ++k) value_[k] = function(first + step * static_cast<double>(k));
}

namespace {

constexpr double zero_celsius_k = 273.15, reference_k = 298.15;
constexpr double thermal_voltage_v = 8.314462618 * reference_k / 96'485.33212;

/// Charge that has passed the surface of an electrode and where it is by now: finite volumes from the closed back to
/// the surface.
class Slab {
 public:
  Slab(double time_s, double step_s) {
    const double r = step_s / time_s * volumes * volumes;
    // implicit Euler: (1 + 2 r) c[k] - r (c[k-1] + c[k+1]) = c_before[k]; no flow at the back, the flux enters the last
    // volume
    double below_factor = 0;
    for (std::size_t k = 0; k < volumes; ++k) {
      const double diagonal = 1 + (k == 0 || k + 1 == volumes ? r : 2 * r);
      inverse_[k] = 1 / (diagonal - (k == 0 ? 0 : r * below_factor));
      upper_[k] = below_factor = r * inverse_[k];
    }
    r_ = r;
    inflow_ = step_s / time_s * volumes;
  }

  /// Surface less mean for a flux whose steady value is 1 (a slab settles at a third of its flux).
  double advance(double flux) {
    std::array<double, volumes>& c = concentration_;
    c[volumes - 1] += 3 * flux * inflow_;
    c[0] *= inverse_[0];
    for (std::size_t k = 1; k < volumes; ++k) c[k] = (c[k] + r_ * c[k - 1]) * inverse_[k];
    for (std::size_t k = volumes - 1; k-- > 0;) c[k] += upper_[k] * c[k + 1];
    mean_ += 3 * flux * inflow_ / volumes;
    return c[volumes - 1] + 1.5 * flux / volumes - mean_;
  }

 private:
  static constexpr std::size_t volumes = 24;
  std::array<double, volumes> concentration_{}, inverse_{}, upper_{};
  double r_ = 0, inflow_ = 0, mean_ = 0;
};

/// i = i0 (exp((1 - alpha) x) - exp(-alpha x)), x = overvoltage by the thermal voltage, in series with a resistance.
class Electrode {
 public:
  explicit Electrode(double alpha) : alpha_(alpha) {}

  /// Overvoltage [V] under a given current; resistance_ohm is its slope at zero.
  double under_current(double current_a, double resistance_ohm) {
    const double i0 = thermal_voltage_v / resistance_ohm;
    double x = 2 * std::asinh(current_a / (2 * i0));  // exact for alpha 0.5
    for (int k = 0; k < 30; ++k) {
      const double up = std::exp((1 - alpha_) * x), down = std::exp(-alpha_ * x);
      const double change = (i0 * (up - down) - current_a) / (i0 * ((1 - alpha_) * up + alpha_ * down));
      x -= std::clamp(change, -1.0, 1.0);
      if (std::abs(change) < 1e-10) break;
    }
    return thermal_voltage_v * x;
  }

  /// Current through it and series_ohm when voltage_v lies over both.
  double current_at(double voltage_v, double resistance_ohm, double series_ohm) {
    const double i0 = thermal_voltage_v / resistance_ohm;
    double up = 1, down = 1;
    for (int k = 0; k < 30; ++k) {
      up = std::exp((1 - alpha_) * x_), down = std::exp(-alpha_ * x_);
      const double over_v = thermal_voltage_v * x_ + series_ohm * i0 * (up - down) - voltage_v;
      const double change = over_v / (thermal_voltage_v + series_ohm * i0 * ((1 - alpha_) * up + alpha_ * down));
      x_ -= std::clamp(change, -1.0, 1.0);
      if (std::abs(change) < 1e-10) break;
    }
    return i0 * (std::exp((1 - alpha_) * x_) - std::exp(-alpha_ * x_));
  }

 private:
  double alpha_;
  double x_ = 0;  ///< where the last search ended
};

class StopOperators {
 public:
  StopOperators(const Hysteresis& parameters, double start_soc)
      : parameters_(parameters), stretched_(parameters.half_width) {
    const double turned = start_soc > 0.92 ? 0 : 1 - start_soc;  // since the full charge
    for (double& s : stretched_) s = std::max(-s, s - turned);
  }

  void move(double soc_change) {
    for (std::size_t k = 0; k < stretched_.size(); ++k) {
      const double w = parameters_.half_width[k];
      stretched_[k] = std::clamp(stretched_[k] + soc_change, -w, w);
    }
  }

  double voltage_v(double soc) const {
    double sum = parameters_.on_discharge_branch ? 1 : 0;
    for (std::size_t k = 0; k < stretched_.size(); ++k)
      sum += parameters_.share[k] * stretched_[k] / parameters_.half_width[k];
    return sum * parameters_.half_gap_v * (1 + parameters_.tilt * (soc - 0.5));
  }

 private:
  const Hysteresis& parameters_;
  std::vector<double> stretched_;
};

double slid(const PlateauSlide& p, double soc) {
  if (p.slide == 0 || soc <= 0 || soc >= 1) return soc;
  const double window = (1 - std::exp(-soc / 0.13)) * (1 - std::exp(-(1 - soc) / 0.13));
  return soc + p.slide * window * (1 + p.lean * (soc - 0.5));
}

double temperature_factor(const TemperatureLaw& law, double temperature_c) {
  const auto g = [&](double kelvin) { return 1 / (kelvin - law.zero_k); };
  return std::exp(law.steepness_k * (g(temperature_c + zero_celsius_k) - g(reference_k)));
}

CellTrace run_parallel(const HealthyCell& cell, const CellEffects& effects, const Stimulus& stimulus,
                       double start_soc) {
  struct Half {
    double capacity_as, resistance_factor, soc, v1_v = 0;
  };
  const double d = effects.parallel.inequality, exponent = effects.parallel.resistance_exponent,
               whole_as = 3'600 * cell.capacity_ah;
  // resistances of the halves such that both together have the cell's
  const double a = std::pow(1 + d, exponent), b = std::pow(1 - d, exponent), both = a * b / (a + b);
  std::array<Half, 2> halves = {
      {{whole_as * (1 + d) / 2, a / both, start_soc}, {whole_as * (1 - d) / 2, b / both, start_soc}}};
  const int substeps = std::max(1, static_cast<int>(std::ceil(stimulus.step_s / 0.25 - 1e-9)));
  const double h = stimulus.step_s / substeps;
  CellTrace trace;
  double temperature_c = stimulus.ambient_c.front();
  for (std::size_t k = 0; k < stimulus.current_a.size(); ++k) {
    const double current_a = stimulus.current_a[k];
    const auto share = [&] {
      std::array<double, 2> open_v{}, r0{};
      for (std::size_t n = 0; n < 2; ++n) {
        open_v[n] = cell.ocv_v.at(halves[n].soc) + halves[n].v1_v;
        r0[n] = cell.r0_ohm.at(halves[n].soc) * halves[n].resistance_factor;
      }
      const double terminal_v = (current_a + open_v[0] / r0[0] + open_v[1] / r0[1]) / (1 / r0[0] + 1 / r0[1]);
      return std::array<double, 3>{(terminal_v - open_v[0]) / r0[0], (terminal_v - open_v[1]) / r0[1], terminal_v};
    };
    for (int s = 0; s < substeps && k > 0; ++s) {
      const std::array<double, 3> shared = share();
      for (std::size_t n = 0; n < 2; ++n) {
        Half& half = halves[n];
        const double r1 = cell.r1_ohm.at(half.soc) * half.resistance_factor,
                     c1 = cell.c1_f.at(half.soc) / half.resistance_factor;
        half.v1_v = r1 * shared[n] + (half.v1_v - r1 * shared[n]) * std::exp(-h / (r1 * c1));
        half.soc += shared[n] * h / half.capacity_as;
      }
    }
    const double soc = (halves[0].soc * halves[0].capacity_as + halves[1].soc * halves[1].capacity_as) / whole_as;
    const double heat_w = current_a * current_a * (cell.r0_ohm.at(soc) + cell.r1_ohm.at(soc));
    const double lost_w = cell.thermal.to_ambient_w_per_k * (temperature_c - stimulus.ambient_c[k]);
    if (k > 0) temperature_c += stimulus.step_s / cell.thermal.heat_capacity_j_per_k * (heat_w - lost_w);
    trace.voltage_v.push_back(share()[2]);
    trace.soc.push_back(soc);
    trace.temperature_c.push_back(temperature_c);
    trace.v1_v.push_back((halves[0].v1_v + halves[1].v1_v) / 2);
  }
  return trace;
}

}  // namespace

CellTrace run_cell(const HealthyCell& cell, const CellEffects& effects, const Stimulus& stimulus, double start_soc) {
  if (effects.parallel.inequality != 0) return run_parallel(cell, effects, stimulus, start_soc);

  const int substeps = std::max(1, static_cast<int>(std::ceil(stimulus.step_s / 0.25 - 1e-9)));
  const double h = stimulus.step_s / substeps;
  const double capacity_as = 3'600 * cell.capacity_ah * effects.capacity_factor;
  const bool transfers = effects.charge_transfer.share_of_r0 > 0 || effects.charge_transfer.share_of_r1 > 0;
  const bool asymmetric = effects.asymmetry.excess != 0, lagging = effects.diffusion.resistance_ohm != 0;
  const bool hysteretic = effects.hysteresis.half_gap_v != 0, fast = effects.fast.resistance_ohm != 0;
  const bool warm = effects.temperature_law.steepness_k != 0, two_nodes = effects.core.to_can_k_per_w > 0;

  StopOperators stops(effects.hysteresis, start_soc);
  Slab slab(effects.diffusion.time_s, h);
  Electrode in_r0(effects.charge_transfer.alpha), in_r1(effects.charge_transfer.alpha);
  constexpr std::array<double, 3> fast_share = {0.3, 0.4, 0.3};
  std::array<double, 3> fast_v{}, fast_kept{};
  for (std::size_t n = 0; n < 3; ++n)
    fast_kept[n] = std::exp(-h / (effects.fast.time_s * std::pow(effects.fast.spread, static_cast<double>(n) - 1)));
  const double lag_kept = std::exp(-h / effects.diffusion.lag_s);

  double soc = start_soc, v1_v = 0, diffusion_v = 0, plated = 0, pressure = 0;
  bool remembers = effects.memory.bump_v != 0, was_below = false;
  double core_c = stimulus.ambient_c.front(), can_c = core_c;
  double voltage_v = cell.ocv_v.at(start_soc);

  CellTrace trace;
  for (std::vector<double>* series : {&trace.voltage_v, &trace.soc, &trace.temperature_c, &trace.v1_v})
    series->reserve(stimulus.current_a.size());
  for (std::size_t k = 0; k < stimulus.current_a.size(); ++k) {
    const double current_a = stimulus.current_a[k];
    double r0_factor = 1, r1_factor = 1, c1_factor = 1;
    if (warm) {
      const double factor =
          temperature_factor(effects.temperature_law,
                             stimulus.resistance_temperature_c.empty() ? core_c : stimulus.resistance_temperature_c[k]);
      r1_factor *= factor;
      r0_factor *= std::pow(factor, effects.temperature_law.share_of_r0);
    }
    if (asymmetric) {
      const double factor =
          1 + effects.asymmetry.excess * (0.5 + 0.5 * std::tanh(current_a / effects.asymmetry.width_a));
      r0_factor *= factor;
      r1_factor *= factor;
    }
    if (effects.growth.of_r1 != 0) {
      r1_factor *= 1 + effects.growth.of_r1;
      c1_factor = std::pow(1 + effects.growth.of_r1, -effects.growth.c1_answers);
    }
    const auto r0_at = [&](double z) {
      return cell.r0_ohm.at(z) * r0_factor * (1 + effects.growth.of_r0 * (1 + effects.growth.r0_lean * (z - 0.5)));
    };

    if (k > 0) {
      for (int s = 0; s < substeps; ++s) {
        double stored_a = current_a;
        if (effects.charge_loss.share != 0 && current_a > 0) {
          stored_a *=
              1 - effects.charge_loss.share * (0.6 + 0.8 * current_a / (current_a + effects.charge_loss.half_a));
        }
        if (effects.leak.at_3v3_a != 0)
          stored_a -= effects.leak.at_3v3_a * std::exp((std::min(voltage_v, 3.6) - 3.3) / effects.leak.per_e_v);
        const double soc_change = stored_a * h / capacity_as, middle = soc + soc_change / 2;
        soc += soc_change;

        const double r1 = cell.r1_ohm.at(middle) * r1_factor, c1 = cell.c1_f.at(middle) * c1_factor;
        if (transfers && effects.charge_transfer.share_of_r1 > 0) {
          const double share = effects.charge_transfer.share_of_r1;
          const auto rate = [&](double v) {
            return (current_a - in_r1.current_at(v, share * r1, (1 - share) * r1)) / c1;
          };
          v1_v += h * rate(v1_v + h / 2 * rate(v1_v));
        } else {
          v1_v = r1 * current_a + (v1_v - r1 * current_a) * std::exp(-h / (r1 * c1));
        }
        if (hysteretic) stops.move(soc_change);
        if (lagging) {
          const double settled_v = effects.diffusion.resistance_ohm * slab.advance(current_a);
          diffusion_v = settled_v + (diffusion_v - settled_v) * lag_kept;
        }
        if (fast) {
          for (std::size_t n = 0; n < 3; ++n) {
            const double settled_v = effects.fast.resistance_ohm * fast_share[n] * current_a;
            fast_v[n] = settled_v + (fast_v[n] - settled_v) * fast_kept[n];
          }
        }
      }

      const double dt = stimulus.step_s;
      if (effects.plating.plateau_v != 0) {
        if (current_a > effects.plating.least_a)
          plated += (1 - plated) * dt / effects.plating.fill_s;
        else
          plated = std::max(0.0, plated - dt / effects.plating.hold_s);
      }
      if (effects.pressure.lift_v != 0)
        pressure += (std::abs(current_a) / cell.capacity_ah - pressure) * dt / effects.pressure.time_constant_s;

      const double heat_w = current_a * current_a * r0_at(soc) + v1_v * v1_v / (cell.r1_ohm.at(soc) * r1_factor);
      if (two_nodes) {
        const double inner_j_per_k = cell.thermal.heat_capacity_j_per_k * effects.core.share_of_heat_capacity;
        const double outer_j_per_k = cell.thermal.heat_capacity_j_per_k - inner_j_per_k;
        const double outward_w = (core_c - can_c) / effects.core.to_can_k_per_w;
        core_c += dt / inner_j_per_k * (heat_w - outward_w);
        can_c += dt / outer_j_per_k *
                 (outward_w - effects.core.cooling * cell.thermal.to_ambient_w_per_k * (can_c - stimulus.ambient_c[k]));
      } else {
        core_c += dt / cell.thermal.heat_capacity_j_per_k *
                  (heat_w - cell.thermal.to_ambient_w_per_k * (core_c - stimulus.ambient_c[k]));
        can_c = core_c;
      }
    }

    const double r0 = r0_at(soc);
    voltage_v = cell.ocv_v.at(slid(effects.plateau_slide, soc)) + v1_v;
    if (transfers && effects.charge_transfer.share_of_r0 > 0) {
      const double share = effects.charge_transfer.share_of_r0;
      voltage_v += (1 - share) * r0 * current_a + in_r0.under_current(current_a, share * r0);
    } else {
      voltage_v += r0 * current_a;
    }
    if (hysteretic) voltage_v += stops.voltage_v(soc);
    voltage_v += diffusion_v + fast_v[0] + fast_v[1] + fast_v[2];
    if (effects.entropy_scale != 0)
      voltage_v += effects.entropy_scale * effects.entropy_v_per_k.at(soc) * (core_c + zero_celsius_k - reference_k);
    if (effects.contact_scale != 0) voltage_v += effects.contact_scale * effects.contact_ohm[k] * current_a;
    if (effects.plating.plateau_v != 0) voltage_v += effects.plating.plateau_v * std::tanh(plated / 0.12);
    if (effects.pressure.lift_v != 0) voltage_v += effects.pressure.lift_v * std::pow(pressure / 0.5, 1.7);
    if (remembers) {
      const Memory& memory = effects.memory;
      was_below = was_below || soc < memory.turned_at;
      if (was_below && soc > memory.turned_at + 0.12) remembers = false;
      const double off = (soc - memory.turned_at) / memory.width;
      voltage_v +=
          memory.bump_v * std::exp(-off * off) * (0.65 + 0.35 * std::tanh(current_a / (0.1 * cell.capacity_ah)));
    }
    trace.voltage_v.push_back(voltage_v);
    trace.soc.push_back(soc);
    trace.temperature_c.push_back(can_c);
    trace.v1_v.push_back(v1_v);
  }
  return trace;
}

}  // namespace bms::benchmark::truth
