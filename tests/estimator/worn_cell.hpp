// A month of opportunity charging with a cell of another capacity than its file's: 280 Ah in the file, 22 % less in the
// truck. Two shifts with a charge in each break, a longer charge at night that is not always long enough, a full charge
// at the weekend.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "estimator/soc_estimator.hpp"
#include "plant/random.hpp"
#include "plant/truth_cell.hpp"
#include "tests/cell_of_capacity.hpp"
#include "tests/cells.hpp"
#include "tests/starting_point.hpp"

namespace bms {

inline constexpr double file_capacity_ah = 280, cells_in_parallel = file_capacity_ah / 6;

/// table9 as a cell of 280 Ah.
constexpr model::CellParameters<> cell_of_280_ah() { return tests::of_capacity(tests::table9, file_capacity_ah); }

/// The truck, at 1 Hz. left: capacity over that of the file.
class OpportunityCharging {
 public:
  OpportunityCharging(double left, std::uint64_t seed)
      : plant_(parameters(left), {.soc = 0.95, .v_rc_v = 0, .temperature_c = 25}), random_(seed) {}

  /// Second k: runs the truck and measures it.
  measurement::Sample sample(int k) {
    const double current_a = load_a(k);
    plant_.run(current_a, 25, 1);
    walk(offset_a_, 0.02, 3'600);
    walk(offset_v_, 0.0005, 36'000);
    const double read_a = (current_a + offset_a_ + 0.01 * random_.normal()) * cells_in_parallel;
    const double read_v = plant_.voltage_v() + offset_v_ + 0.001 * random_.normal();
    return {static_cast<std::uint64_t>(k + 1) * 1'000'000, static_cast<std::int32_t>(1e6 * read_a),
            static_cast<std::int32_t>(1e6 * read_v), static_cast<std::int16_t>(100 * plant_.temperature_c())};
  }
  double soc() const { return plant_.soc(); }

 private:
  static plant::CellParameters parameters(double left) {
    plant::CellParameters p;
    p.step_s = 0.5;
    p.capacity_ah *= left;
    return p;
  }

  /// Current of one of the cells of 6 Ah that are in parallel.
  double load_a(int k) {
    constexpr double display_a = 0.012;
    const int day = k / 86'400, second = k % 86'400, minute = second / 60;
    if (second == 0) {
      load_ = 0.35 + 0.25 * random_.uniform();
      night_soc_ = 0.6 + 0.35 * random_.uniform();
    }
    if (day % 7 >= 5) return plant_.soc() < 0.99 && day % 7 == 5 ? 1.5 : -display_a;
    const bool works = minute >= 6 * 60 && minute < 22 * 60, pause = minute % 240 < 25;
    if (works && pause) return plant_.soc() < 0.9 ? 3 : 0;
    if (works) return plant_.soc() > 0.04 ? shift_a(second % 120) : -display_a;
    return plant_.soc() < night_soc_ ? 1.5 : -display_a;
  }
  /// Two minutes: 40 s of driving, 20 s of braking, a rest.
  double shift_a(int second) {
    if (second < 40) return load_ * (-6 * (0.5 + random_.uniform()));
    return second < 60 ? load_ * 3 : 0;
  }
  void walk(double& error, double sigma, double correlation_s) {
    error += -error / correlation_s + sigma * std::sqrt(2 / correlation_s) * random_.normal();
  }

  plant::Cell plant_;
  plant::Random random_;
  double offset_a_ = 0, offset_v_ = 0, load_ = 0.4, night_soc_ = 0.9;
};

/// Errors of the state of charge in one week of the month.
struct WeekFigures {
  double rmse = 0, largest = 0, inside = 0, mean_sigma = 0;
};

}  // namespace bms
