// What all cells of a pack share, from a simulation of equal cells in fine steps.
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "diagnosis/pack/shared_current.hpp"
#include "measurement/statistics.hpp"
#include "plant/random.hpp"
#include "tests/cells.hpp"

namespace bms {
namespace {

namespace dp = diagnosis::pack;

constexpr std::size_t rows = 7'200, parts = 10;

/// Pulses of seconds, as a truck that lifts and drives. The current is the mean of a row, the voltages are read at its
/// end.
dp::PackRecording recording_of(double resistance_factor) {
  const auto cell = model::prepare<double, model::max_intervals>(tests::table9);
  plant::Random random(11);
  dp::PackRecording pack;
  pack.cell_v.resize(4);
  double soc = 0.9, rc_v = 0, now_a = 0, left_s = 300;
  std::uint8_t interval = 0;
  for (std::size_t k = 0; k < rows; ++k) {
    double sum_a = 0;
    for (std::size_t j = 0; j < parts; ++j) {
      if (left_s <= 0) {
        now_a = random.uniform() < 0.3 ? 0 : -5 + 8 * random.normal();
        left_s = 2 + 4 * random.uniform();
        if (random.uniform() < 0.01) left_s = 600;
        if (left_s > 100) now_a = 0;
      }
      left_s -= 0.1;
      const auto at = model::look_up(cell, soc, interval);
      soc += now_a * 0.1 / (3'600 * tests::table9.capacity_ah);
      rc_v += -std::expm1(-0.1 / (at.r1_ohm * at.c1_f)) * (at.r1_ohm * now_a - rc_v);
      sum_a += now_a / parts;
    }
    const auto at = model::look_up(cell, soc, interval);
    pack.time_s.push_back(static_cast<double>(k));
    pack.current_a.push_back(sum_a);
    pack.soc.push_back(soc);
    for (auto& v : pack.cell_v)
      v.push_back(at.ocv_v + resistance_factor * (at.r0_ohm * now_a + rc_v) + 0.001 * random.normal());
  }
  return pack;
}

TEST(PackSharedState, KnowsTheResistancesOfAllCellsThoughVoltagesAreReadAtTheEndOfARow) {
  for (const double factor : {0.85, 1.1}) {
    const dp::PackRecording pack = recording_of(factor);
    dp::Track track = dp::track_of(tests::table9, pack);
    dp::set_neighbours(track, pack, {0, 1, 2, 3}, false);
    const dp::SharedState shared = dp::shared_state_of(track, pack);
    ASSERT_EQ(shared.not_tested, "");
    EXPECT_NEAR(measurement::mean(shared.resistance_factor), factor, 0.012);
  }
}

}  // namespace
}  // namespace bms
