// How a cell differs from its neighbours: noise of the neighbours, channels that are read later, inexact rows.
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "diagnosis/pack/cell_fit.hpp"
#include "diagnosis/pack/pack_likelihood.hpp"
#include "measurement/statistics.hpp"
#include "plant/random.hpp"
#include "tests/cells.hpp"

namespace bms {
namespace {

namespace dp = diagnosis::pack;

constexpr double r0_ohm = 0.01, noise_v = 0.001;
constexpr std::size_t rows = 3'000, cells = 6;

/// A cell of one resistance. Its OCV is a straight line. course: of the resistance from empty to full, as a share of
/// it.
model::CellParameters<> straight_cell(double course) {
  model::CellParameters<> cell = tests::table9;
  for (std::size_t k = 0; k < cell.rc.r0_ohm.size; ++k) {
    cell.rc.r0_ohm[k] = r0_ohm * (1 + course * (cell.rc.soc[k] - 0.5));
    cell.rc.r1_ohm[k] = 1e-5;
  }
  for (std::size_t k = 0; k < cell.ocv.b0_v.size; ++k) {
    cell.ocv.b0_v[k] = 3;
    cell.ocv.b1_v[k] = 0.5;
  }
  return cell;
}

/// Cells that are alike; the current steps within the rows. late: by which the channels of the second and of the third
/// cell are read later, and twice that, as a share of the row.
dp::PackRecording recording_of(double least_rows, double late) {
  plant::Random random(7);
  dp::PackRecording pack;
  pack.cell_v.resize(cells);
  double now_a = 0, before_a = 0, left = 0, soc = 0.8;
  for (std::size_t k = 0; k < rows; ++k) {
    before_a = now_a;
    double moment = 0;  // of a step in this row, as a share of it
    if (left < 1) {
      now_a = -3 + 6 * random.normal();
      moment = random.uniform();
      left += least_rows * (1 + random.uniform());
    }
    left -= 1;
    const double mean_a = moment * before_a + (1 - moment) * now_a;
    soc += mean_a / (3'600 * tests::table9.capacity_ah);
    pack.time_s.push_back(static_cast<double>(k));
    pack.current_a.push_back(mean_a);
    pack.soc.push_back(soc);
    for (std::size_t c = 0; c < cells; ++c) {
      const double read_before = c == 1 || c == 2 ? static_cast<double>(c) * late : 0;
      const bool missed = 1 - moment < read_before;  // the step came after this channel was read
      pack.cell_v[c].push_back(3 + 0.5 * soc + r0_ohm * (missed ? before_a : now_a) + noise_v * random.normal());
    }
  }
  return pack;
}

dp::Track track_of(const dp::PackRecording& pack, double course = 0) {
  dp::Track track = dp::track_of(straight_cell(course), pack, std::vector<double>(rows, 1.0));
  dp::set_neighbours(track, pack, {0, 1, 2}, false);
  return track;
}

/// The last cell against the first half of the others.
dp::CellFit fit_of(const dp::PackRecording& pack, dp::Parameter fault = dp::joint, double course = 0,
                   bool uses_moving = true) {
  dp::Track track = track_of(pack, course);
  track.uses_moving = uses_moving;
  dp::Vector prior = dp::least_spread(r0_ohm);
  const auto at = static_cast<Eigen::Index>(fault);
  prior[at] = dp::fault_spread(r0_ohm)[at];
  prior[dp::blur] = 1;
  prior[dp::resistance] = 1e-6;  // without polarisation it is the same as a joint
  prior[dp::delay] = 1e-6;       // the neighbours have no common moment that a delay could be measured from
  return dp::fit_cell({.pack = &pack, .track = &track, .warmer_k = {}, .cell = cells - 1, .known_delay_s = {}},
                      dp::Vector::Zero(), prior, {.white_v = noise_v, .fast_v = 2e-5, .slow_v = 2e-5});
}

TEST(PackTrack, TheNeighboursHaveNoNoiseWhereTheCurrentIsConstant) {
  const dp::PackRecording pack = recording_of(60, 0);
  const dp::Track track = track_of(pack);
  measurement::MeanSquare measured, smooth;
  for (std::size_t k = 1; k + 1 < rows; ++k) {
    if (pack.current_a[k - 1] != pack.current_a[k] || pack.current_a[k + 1] != pack.current_a[k]) continue;
    const double true_v = 3 + 0.5 * pack.soc[k] + r0_ohm * pack.current_a[k];
    measured.add(track.neighbours_v[k] - true_v);
    smooth.add(track.smooth_v[k] - true_v);
  }
  EXPECT_NEAR(measured.root(), noise_v / std::sqrt(3), 0.1 * noise_v);
  EXPECT_LT(smooth.root(), measured.root() / 3);
}

TEST(PackTrack, TheNeighboursFollowAStepOfTheCurrentAtOnce) {
  const dp::PackRecording pack = recording_of(60, 0);
  const dp::Track track = track_of(pack);
  for (std::size_t k = 1; k < rows; ++k) {
    if (std::abs(pack.current_a[k] - pack.current_a[k - 1]) < 1) continue;
    EXPECT_EQ(track.smooth_v[k], track.neighbours_v[k]) << k;
  }
}

TEST(PackCellFit, AChannelThatIsReadBeforeItsNeighboursRespondsMoreToFastChangesAndIsNoJoint) {
  const dp::CellFit alike = fit_of(recording_of(0.5, 0)), early = fit_of(recording_of(0.5, 0.45));
  EXPECT_LT(std::abs(alike.theta[dp::blur]), 0.02);
  EXPECT_GT(early.theta[dp::blur], 0.04);
  EXPECT_LT(std::abs(early.theta[dp::joint]), 0.1 * r0_ohm);
}

TEST(PackTrack, TheRcVoltageFollowsAnyTimeConstantExactly) {
  const dp::PackRecording pack = recording_of(20, 0);
  model::CellParameters<> cell = tests::table9, slow = tests::table9;
  for (std::size_t k = 0; k < slow.rc.c1_f.size; ++k) slow.rc.c1_f[k] *= 2;
  const dp::Track track = dp::track_of(cell, pack), other = dp::track_of(slow, pack);
  const dp::RcVoltage found = dp::rc_voltage_of(track, pack, std::log(2.0)),
                      near = dp::rc_voltage_of(track, pack, std::log(2.0) + 1e-4);
  for (std::size_t k = 0; k < rows; k += 97) {
    EXPECT_NEAR(found.v[k], other.v_rc_v[k], 1e-9) << k;
    EXPECT_NEAR(found.by_tau_v[k], (near.v[k] - found.v[k]) / 1e-4, 1e-2 * (1e-4 + std::abs(found.by_tau_v[k]))) << k;
  }
}

TEST(PackCellFit, ReadingsAtAnUnknownCurrentMakeNoJointIfMovingRowsAreLeftOut) {
  dp::PackRecording pack = recording_of(5, 0);
  const dp::Track track = track_of(pack);
  std::size_t steady = 0;
  for (std::size_t k = 0; k < rows; ++k) {
    if (track.moving[k] != 0)
      pack.cell_v.back()[k] += 0.3 * r0_ohm * pack.current_a[k];
    else
      ++steady;
  }
  EXPECT_GT(fit_of(pack).used, steady);
  const dp::CellFit fit = fit_of(pack, dp::joint, 0, false);
  EXPECT_LT(std::abs(fit.theta[dp::joint]), 0.02 * r0_ohm);
  EXPECT_EQ(fit.used, steady);
}

TEST(PackCellFit, RowsCountLessWhereTheModelIsInexact) {
  dp::PackRecording pack = recording_of(60, 0);
  const auto information_of = [&] { return fit_of(pack).all().of_parameters(dp::joint, dp::joint); };
  const double exact = information_of();
  std::size_t changed = 0;
  for (std::size_t k = 0; k < rows; ++k) {
    if (pack.soc[k] > pack.soc[rows / 2]) continue;  // half of the rows
    pack.cell_v.back()[k] += changed++ % 2 == 0 ? 5 * noise_v : -5 * noise_v;
  }
  const double inexact = information_of();
  EXPECT_LT(inexact, 0.7 * exact);
  EXPECT_GT(inexact, 0.4 * exact) << "the other half is exact";
}

TEST(PackCellFit, AWrongCourseOfTheResistancesDoesNotChangeTheChargeOfACell) {
  dp::PackRecording pack = recording_of(20, 0);
  constexpr double less = 0.05;
  for (double& v : pack.cell_v.back()) v -= 0.5 * less;
  EXPECT_NEAR(fit_of(pack, dp::charge, 0).theta[dp::charge], -less, 0.003);
  EXPECT_NEAR(fit_of(pack, dp::charge, 1).theta[dp::charge], -less, 0.003);
}

/// The neighbours warm up by warmest_k. The last cell has `growth` more resistance, warms up more in proportion, and
/// its resistances fall by per_k.
dp::PackRecording warming_up(double growth, double per_k, double warmest_k) {
  dp::PackRecording pack = recording_of(20, 0);
  pack.sensor_c.resize(1);
  for (std::size_t k = 0; k < rows; ++k) {
    const double warm_k = warmest_k * std::sin(1.5 * static_cast<double>(k) / rows);
    double more = growth;
    for (int n = 0; n < 100; ++n) more = (more + (1 + growth) * std::exp(-per_k * warm_k * more) - 1) / 2;
    pack.sensor_c[0].push_back(22 + warm_k);
    pack.cell_v.back()[k] += more * (pack.cell_v.back()[k] - 3 - 0.5 * pack.soc[k]);
  }
  return pack;
}

TEST(PackCellFit, AGrownResistanceThatWarmsItsCellIsNoJoint) {
  for (const double per_k : {0.02, 0.04}) {
    const dp::PackRecording pack = warming_up(0.5, per_k, 8);
    const dp::Track track = track_of(pack);
    dp::Vector prior = dp::least_spread(r0_ohm);
    prior[dp::resistance] = dp::fault_spread(r0_ohm)[dp::resistance];
    prior[dp::delay] = prior[dp::polarisation] = 1e-6;
    const dp::CellFit fit =
        dp::fit_cell({.pack = &pack, .track = &track, .warmer_k = {}, .cell = cells - 1, .known_delay_s = {}},
                     dp::Vector::Zero(), prior, {.white_v = noise_v, .fast_v = 2e-5, .slow_v = 2e-5});
    EXPECT_NEAR(fit.theta[dp::resistance], 0.5, 0.04) << per_k;
    EXPECT_LT(std::abs(fit.theta[dp::joint]), 0.04 * r0_ohm) << per_k;
  }
}

}  // namespace
}  // namespace bms
