// The designs of Tables 7 and 8 of the paper: current pulses around one state of charge over twenty minutes, which
// charge as much as they discharge. The paper shows them (Fig. 9-11) without numbers.
#include "experiments/designs.hpp"
#include "experiments/profile_builder.hpp"

namespace bms::experiments {

namespace {

constexpr int design_s = 1'200, lead_s = 60;

}  // namespace

void short_pulses(ProfileBuilder& cell, int rest_s) {
  constexpr int pulse_s = 10;
  cell.hold(lead_s, 0);
  for (int k = 0; cell.time_s() < design_s - lead_s; ++k) {
    const double c_rate = k % 2 == 0 ? cell.high_c_rate : 0.5 * cell.high_c_rate;
    for (const double direction : {-1.0, 1.0}) {
      cell.hold(pulse_s, direction * c_rate);
      cell.hold(rest_s, 0);
    }
  }
  cell.hold(lead_s, 0);
}

void long_bursts(ProfileBuilder& cell, int high_s, int low_s) {
  cell.hold(lead_s, 0);
  while (cell.time_s() < design_s - lead_s) {
    for (const double direction : {-1.0, 1.0}) {
      cell.hold(high_s, direction * cell.high_c_rate);
      cell.hold(low_s, direction * cell.low_c_rate);
    }
  }
  cell.hold(lead_s, 0);
}

void ocv_test(ProfileBuilder& cell, int rest_s) {
  cell.hold(rest_s, 0);
  const int tenth_s = static_cast<int>(360 / cell.high_c_rate);
  for (const double direction : {-1.0, 1.0}) {
    for (int step = 0; step < 10; ++step) {
      cell.hold(tenth_s, direction * cell.high_c_rate);
      cell.hold(rest_s, 0);
    }
  }
}

}  // namespace bms::experiments
