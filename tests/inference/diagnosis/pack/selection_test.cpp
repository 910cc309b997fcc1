// Parts of the diagnosis of a pack: which accusations are chosen, and the sign of the current sensor.
#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "diagnosis/pack/current_sign.hpp"
#include "diagnosis/pack/diagnose_pack.hpp"
#include "diagnosis/pack/selection.hpp"
#include "plant/random.hpp"

namespace bms {
namespace {

namespace dp = diagnosis::pack;

constexpr double r0_ohm = 0.01, cell_v = 3.3;

/// Cells whose channels show these constant errors [V] and nothing else.
std::vector<dp::CellFit> cells_with_errors(const std::vector<double>& error_v) {
  constexpr double sigma_v = 0.0003;
  dp::Vector column = dp::Vector::Zero();
  column[dp::offset] = 1 / sigma_v;
  column[dp::gain] = cell_v / sigma_v;
  std::vector<dp::CellFit> fits(error_v.size());
  for (std::size_t c = 0; c < fits.size(); ++c) {
    dp::Information information;
    information.of_parameters = column * column.transpose();
    information.with_data = column * error_v[c] / sigma_v;
    fits[c].until = {information};
  }
  return fits;
}

TEST(PackSelection, FindsAWireNextToAnErrorOfTheNextChannel) {
  const std::vector<dp::CellFit> fits = cells_with_errors({0, 0.0005, 0, -0.015, 0.015, -0.031, 0, -0.0005, 0, 0});
  const dp::PackLikelihood likelihood(fits, dp::least_spread(r0_ohm), r0_ohm, 1, 1);
  const std::vector<dp::Accusation> chosen = dp::select(likelihood, {});
  ASSERT_EQ(chosen.size(), 2);
  std::size_t wires = 0;
  for (const dp::Accusation& a : chosen) {
    if (a.cause != dp::Cause::sense_wire) {
      EXPECT_EQ(a.cell, 5);
      continue;
    }
    EXPECT_EQ(a.cell, 3);
    ++wires;
  }
  EXPECT_EQ(wires, 1);
}

/// Less than half a row is how the channels are read, so a lateness has to lie beyond it for certain.
TEST(PackSelection, ADelayOfHalfARowIsNoLateChannel) {
  const std::vector<dp::CellFit> fits = cells_with_errors({0, 0, 0, 0});
  for (const double row_s : {1.0, 10.0}) {
    const dp::PackLikelihood likelihood(fits, dp::least_spread(r0_ohm), r0_ohm, 1, row_s);
    const dp::Accusation late{dp::Cause::late, 1}, wire{dp::Cause::sense_wire, 1};
    EXPECT_FALSE(likelihood.is_possible(late, {0.51 * row_s, 0.04 * row_s}));
    EXPECT_TRUE(likelihood.is_possible(late, {0.7 * row_s, 0.04 * row_s}));
    EXPECT_TRUE(likelihood.is_possible(late, {-0.7 * row_s, 0.04 * row_s}));
    EXPECT_FALSE(likelihood.is_possible(late, {1.2 * row_s, 0.3 * row_s})) << "not certain at all";
    EXPECT_TRUE(likelihood.is_possible(wire, {0.006, 0.001})) << "of other causes the least size is not a boundary";
  }
}

TEST(PackSelection, AccusesNoChannelTwice) {
  const std::vector<dp::CellFit> fits = cells_with_errors({0, 0.0005, 0, -0.015, 0.04, 0, 0, -0.0005, 0, 0});
  const dp::PackLikelihood likelihood(fits, dp::least_spread(r0_ohm), r0_ohm, 1, 1);
  const std::vector<dp::Accusation> chosen = dp::select(likelihood, {});
  EXPECT_FALSE(chosen.empty());
  for (std::size_t channel = 0; channel < fits.size(); ++channel) {
    const auto count = std::count_if(chosen.begin(), chosen.end(), [&](const auto& a) { return a.touches(channel); });
    EXPECT_LE(count, 1) << "channel " << channel + 1 << ": errors that cancel can have any size";
  }
}

/// Voltages that follow the current after some rows.
struct Load {
  std::vector<double> current_a;
  std::vector<std::vector<double>> voltage_v;
};

Load load_with(std::size_t late) {
  plant::Random random(5);
  Load load;
  double current_a = 0;
  for (std::size_t k = 0; k < 2'000; ++k) {
    if (k % 7 == 0) current_a = 20 * random.normal();
    load.current_a.push_back(current_a);
  }
  for (std::size_t c = 0; c < 8; ++c) {
    std::vector<double> v;
    for (std::size_t k = 0; k < load.current_a.size(); ++k)
      v.push_back(cell_v + r0_ohm * load.current_a[k > late ? k - late : 0] + 0.001 * random.normal());
    load.voltage_v.push_back(std::move(v));
  }
  return load;
}

TEST(PackCurrent, RecognisesAReversedSignAlsoOfLateChannels) {
  for (const std::size_t late : {0U, 1U, 3U}) {
    Load load = load_with(late);
    EXPECT_FALSE(dp::reversed_current(load.current_a, load.voltage_v, 1)) << late;
    for (double& a : load.current_a) a = -a;
    const auto found = dp::reversed_current(load.current_a, load.voltage_v, 1);
    ASSERT_TRUE(found) << late;
    EXPECT_EQ(found->cause, dp::Cause::current_sign);
    EXPECT_GT(found->value, 0.9);
  }
}

/// Rows of 30 s, a load of 25 s on and 25 s off: mean current and voltage are against each other a row later.
TEST(PackCurrent, ALoadThatIsSwitchedWithinARowHasNoReversedSign) {
  constexpr std::size_t row_s = 30;
  plant::Random random(3);
  std::vector<double> each_second;
  for (double left = 0, now_a = 0; each_second.size() < 60'000; --left) {
    if (left <= 0) {
      now_a = now_a == 0 ? 50 : 0;
      left += 20 + 10 * random.uniform();
    }
    each_second.push_back(now_a);
  }
  Load load;
  std::vector<double> v;
  for (std::size_t k = 0; (k + 1) * row_s <= each_second.size(); ++k) {
    double sum = 0;
    for (std::size_t s = k * row_s; s < (k + 1) * row_s; ++s) sum += each_second[s];
    load.current_a.push_back(sum / static_cast<double>(row_s));
    v.push_back(3.3 + 0.001 * each_second[(k + 1) * row_s - 1]);
  }
  load.voltage_v.assign(8, v);
  EXPECT_FALSE(dp::reversed_current(load.current_a, load.voltage_v, 1));
}

TEST(PackCurrent, SaysNothingOfASignWithoutChangesOfTheCurrent) {
  Load load = load_with(0);
  for (double& a : load.current_a) a = -10;
  EXPECT_FALSE(dp::reversed_current(load.current_a, load.voltage_v, 1));
}

/// Resistance and joint are so much alike that the size of one depends on what the other is.
TEST(PackVerdict, AResistanceWhoseSigmaContainsZeroIsNotNamed) {
  for (const dp::Cause cause : {dp::Cause::resistance, dp::Cause::joint, dp::Cause::capacity}) {
    for (const double sigma : {0.03, 0.25}) {
      dp::PackFinding f;
      f.cause = cause;
      f.cell = 2;
      f.value = 0.2;
      f.sigma = sigma;
      f.probability = 1;
      dp::PackDiagnosis d;
      d.cells = 6;
      d.findings = {f};
      dp::conclude(d);
      const bool named = sigma < 0.1 || cause == dp::Cause::capacity;
      EXPECT_EQ(d.findings.size(), named ? 1 : 0) << sigma;
      EXPECT_EQ(d.verdict, named ? diagnosis::Verdict::cause : diagnosis::Verdict::no_mismatch) << sigma;
    }
  }
}

}  // namespace
}  // namespace bms
