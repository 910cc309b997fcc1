// Simulation of a pack to be balanced: sixteen cells, each with its own capacity, charge, resistance, balancing
// resistor and reading error, on the plant's open-circuit curve. The pack is driven and charged once a day, under a
// rule that selects the cells to bleed.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <vector>

#include "plant/random.hpp"
#include "plant/truth_cell.hpp"
#include "protection/balancing.hpp"
#include "tests/firmware/protection/expected_rows.hpp"

namespace bms::protection {

inline constexpr std::size_t balanced_cells = 16;

struct BalancedPack {
  std::array<double, balanced_cells> soc{}, capacity_ah{}, ohm{}, offset_v{};
  std::array<double, balanced_cells> bled_ah{};
  double current_a = 0;
  plant::MonotoneCurve ocv_v = plant::table9_ocv_v();

  double voltage_v(std::size_t k) const { return ocv_v.at(soc[k]) + ohm[k] * current_a; }
  double read_v(std::size_t k) const { return voltage_v(k) + offset_v[k]; }
  double spread() const {
    return *std::max_element(soc.begin(), soc.end()) - *std::min_element(soc.begin(), soc.end());
  }
  double mean_soc() const {
    double sum = 0;
    for (const double s : soc) sum += s;
    return sum / balanced_cells;
  }
  void run(double seconds, std::uint32_t bleed) {
    for (std::size_t k = 0; k < balanced_cells; ++k) {
      const double bleed_a = (bleed >> k & 1) != 0 ? voltage_v(k) / 33.0 : 0;
      soc[k] += (current_a - bleed_a) * seconds / 3'600 / capacity_ah[k];
      bled_ah[k] += bleed_a * seconds / 3'600;
    }
  }
};

/// Cells after a year of storage: charge +-3 %, resistance +-15 %, readings +-3 mV, capacity +-0.5 %. weak_by: fraction
/// of capacity that one cell lacks.
inline BalancedPack pack_out_of_balance(std::uint64_t seed, double weak_by) {
  plant::Random random(seed);
  BalancedPack p;
  for (std::size_t k = 0; k < balanced_cells; ++k) {
    p.soc[k] = 0.55 + 0.06 * (random.uniform() - 0.5);
    p.capacity_ah[k] = 6 * (1 + 0.01 * (random.uniform() - 0.5)) * (k == 6 ? 1 - weak_by : 1);
    p.ohm[k] = 0.02 * (1 + 0.3 * (random.uniform() - 0.5));
    p.offset_v[k] = 0.006 * (random.uniform() - 0.5);
  }
  return p;
}

/// Returns the cells to bleed for the next seconds, one bit each.
using BleedRule = std::function<std::uint32_t(const BalancedPack&, double seconds)>;

/// By charge: the firmware's rule, with an estimator whose differences have an error of one sigma, drawn every day.
class ByCharge {
 public:
  explicit ByCharge(double sigma, const PackDesign& design = forklift) : plan_(balancing_plan(design)), sigma_(sigma) {}

  std::uint32_t operator()(const BalancedPack& p, double seconds) {
    std::array<std::int32_t, balanced_cells> uv{}, soc{}, sigma{};
    since_s_ += seconds;
    if (since_s_ > 86'400) {
      since_s_ = 0;
      for (double& off : off_) off = sigma_ * random_.normal();
    }
    for (std::size_t k = 0; k < balanced_cells; ++k) {
      uv[k] = static_cast<std::int32_t>(1e6 * p.voltage_v(k));
      soc[k] = static_cast<std::int32_t>(1e9 * (p.soc[k] - p.mean_soc() + off_[k]));
      sigma[k] = static_cast<std::int32_t>(1e9 * sigma_);
    }
    return balancing_.update({.cell_uv = uv,
                              .soc_ppb = soc,
                              .sigma_ppb = sigma,
                              .mean_soc_ppb = static_cast<std::int32_t>(1e9 * p.mean_soc()),
                              .current_ua = static_cast<std::int32_t>(1e6 * p.current_a),
                              .highest_cdegc = 2'500,
                              .allowed = true},
                             static_cast<std::uint32_t>(1e6 * seconds));
  }
  const Balancing<balanced_cells>& balancing() const { return balancing_; }

 private:
  BalancingPlan plan_;
  Balancing<balanced_cells> balancing_{plan_};
  double sigma_, since_s_ = 1e9;
  std::array<double, balanced_cells> off_{};
  plant::Random random_{17};
};

/// By voltage: every cell that reads 5 mV more than the lowest and more than from_v, while charging or at rest, in the
/// same turns as the firmware.
class ByVoltage {
 public:
  explicit ByVoltage(double from_v) : from_v_(from_v) {}
  std::uint32_t operator()(const BalancedPack& p, double) {
    if (p.current_a < -0.12) return 0;
    double lowest_v = 9;
    for (std::size_t k = 0; k < balanced_cells; ++k) lowest_v = std::min(lowest_v, p.read_v(k));
    std::uint32_t mask = 0;
    for (std::size_t k = 0; k < balanced_cells; ++k) {
      if (p.read_v(k) > lowest_v + 0.005 && p.read_v(k) > from_v_) mask |= 1U << k;
    }
    even_ = !even_;
    return mask & (even_ ? 0x5555U : 0xAAAAU);
  }

 private:
  double from_v_;
  bool even_ = false;
};

struct BalancingFigures {
  std::vector<double> spread;   ///< spread of soc at the end of each day's charge
  std::vector<double> bled_ah;  ///< all cells, by day
};

/// Time of charging: just before the truck drives, or right after it returns.
enum class Habit { before_the_shift, after_the_shift };

/// Simulates days. Each day the truck is discharged at 3 A until the first cell is at 10 % or 4.5 Ah are drawn, and
/// charged at 3 A until the first cell reads 3.6 V under current. It rests ten hours before the charge and a quarter of
/// an hour after it, or the other way round.
inline BalancingFigures balance(BalancedPack p, const BleedRule& rule, int days,
                                Habit habit = Habit::before_the_shift) {
  BalancingFigures f;
  constexpr double step_s = 8;
  for (int day = 0; day < days; ++day) {
    double drawn_ah = 0;
    const double bled_before = [&] {
      double s = 0;
      for (const double b : p.bled_ah) s += b;
      return s;
    }();
    const auto step = [&](double current_a) {
      p.current_a = current_a;
      p.run(step_s, rule(p, step_s));
    };
    const auto rest = [&](double seconds) {
      for (double t = 0; t < seconds; t += step_s) step(0);
    };
    const auto lowest = [&] { return *std::min_element(p.soc.begin(), p.soc.end()); };
    while (lowest() > 0.1 && drawn_ah < 4.5) {
      step(-3);
      drawn_ah += 3 * step_s / 3'600;
    }
    rest(habit == Habit::before_the_shift ? 36'000 : 900);
    const auto highest_v = [&] {
      double v = 0;
      for (std::size_t k = 0; k < balanced_cells; ++k) v = std::max(v, p.voltage_v(k));
      return v;
    };
    do step(3);
    while (highest_v() < 3.6);
    f.spread.push_back(p.spread());
    rest(habit == Habit::before_the_shift ? 900 : 36'000);
    double bled = 0;
    for (const double b : p.bled_ah) bled += b;
    f.bled_ah.push_back(bled - bled_before);
  }
  return f;
}

}  // namespace bms::protection
