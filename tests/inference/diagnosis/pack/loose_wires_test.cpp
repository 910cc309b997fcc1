// Sense wires with a bad contact, among cells that differ, balancers and single odd readings.
#include "diagnosis/pack/loose_wires.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>

namespace bms {
namespace {

namespace dp = diagnosis::pack;

constexpr std::size_t rows = 2'000;

/// Cells of other resistances and charges under steps of the current; `wire` changes what the channels of a row read.
dp::PackRecording pack_of(std::size_t cells, unsigned seed,
                          const std::function<void(std::size_t row, std::vector<double>& v)>& wire,
                          double digit_v = 1e-3) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0, 1);
  dp::PackRecording pack;
  pack.cell_v.resize(cells);
  std::vector<double> ohm, apart;
  for (std::size_t c = 0; c < cells; ++c) {
    ohm.push_back(0.001 * (1 + 0.1 * noise(random)));
    apart.push_back(0.004 * noise(random));
  }
  double current_a = 0;
  for (std::size_t k = 0; k < rows; ++k) {
    if (k % 17 == 0) current_a = 40 * noise(random);
    pack.time_s.push_back(2.0 * static_cast<double>(k));
    pack.current_a.push_back(current_a);
    std::vector<double> v;
    for (std::size_t c = 0; c < cells; ++c)  // cells empty at other rates
      v.push_back(3.3 + apart[c] * (1 + static_cast<double>(k) / rows) + ohm[c] * current_a + 5e-4 * noise(random));
    wire(k, v);
    for (std::size_t c = 0; c < cells; ++c) pack.cell_v[c].push_back(std::round(v[c] / digit_v) * digit_v);
  }
  return pack;
}

std::vector<dp::LooseWire> wires_in(dp::PackRecording& pack) { return dp::take_loose_wires(pack, 5); }

TEST(LooseWires, AreNamedWithTheirSizeAndTheirRowsAreLeftOut) {
  unsigned seed = 1;
  for (const std::size_t cells : {3U, 4U, 8U, 24U}) {
    for (const double size_v : {0.02, 0.06, 1.15}) {
      const std::size_t at = ++seed % (cells - 1);
      const auto is_bad = [](std::size_t k) { return k > 300 && k % 97 < 30; };
      dp::PackRecording pack = pack_of(cells, seed, [&](std::size_t k, std::vector<double>& v) {
        if (!is_bad(k)) return;
        v[at] += size_v;
        v[at + 1] -= size_v;
      });
      const auto wires = wires_in(pack);
      ASSERT_EQ(wires.size(), 1U) << cells << " cells, " << size_v << " V";
      EXPECT_EQ(wires[0].cell, at);
      EXPECT_EQ(wires[0].finding.cause, dp::Cause::sense_wire);
      EXPECT_NEAR(wires[0].finding.value, size_v, 0.02 * size_v + 0.001);
      std::size_t kept = 0, lost = 0;
      for (std::size_t k = 0; k < rows; ++k) {
        if (is_bad(k)) kept += std::isfinite(pack.cell_v[at][k]) ? 1 : 0;
        if (!is_bad(k)) lost += std::isfinite(pack.cell_v[at][k]) ? 0 : 1;
      }
      EXPECT_LE(kept, 2U) << "bad readings that stay";
      EXPECT_LE(lost, 2U) << "good readings that are gone";
    }
  }
}

TEST(LooseWires, AWireThatComesOffAndStaysOffIsOneLeap) {
  dp::PackRecording pack = pack_of(8, 3, [](std::size_t k, std::vector<double>& v) {
    if (k < 1'500) return;
    v[2] += 0.3;
    v[3] -= 0.3;
  });
  const auto wires = wires_in(pack);
  ASSERT_EQ(wires.size(), 1U);
  EXPECT_EQ(wires[0].rows, 500U);
  EXPECT_NE(wires[0].finding.because.find("from 3000 to 3998 s"), std::string::npos) << wires[0].finding.because;
}

/// The sum changes with a balancing current, and so do other cells.
TEST(LooseWires, AreNotSeenInHealthyPacksBalancersAndSingleOddReadings) {
  const auto none = [](std::size_t, std::vector<double>&) {};
  const auto one_cell = [](std::size_t k, std::vector<double>& v) {
    if (k % 60 >= 30) return;
    v[1] += 0.006;
    v[2] -= 0.012;
    if (v.size() > 3) v[3] += 0.006;
  };
  const auto every_second = [](std::size_t k, std::vector<double>& v) {
    for (std::size_t c = 0; c < v.size() && k % 60 < 30; ++c) v[c] += c % 2 == 0 ? -0.015 : 0.015;
  };
  const auto odd_readings = [](std::size_t k, std::vector<double>& v) {
    if (k % 500 == 7) v[1] = 0.5;
    if (k == 900) {
      v[0] += 0.4;
      v[1] -= 0.37;
    }
  };
  for (unsigned seed = 1; seed <= 20; ++seed) {
    // a large joint, and currents that step within a row: the voltage shows the new current, the mean both
    dp::PackRecording joint = pack_of(8, seed, none);
    for (std::size_t k = rows - 1; k > 0; --k) {
      joint.cell_v[4][k] += 0.02 * joint.current_a[k];
      const double share = 0.1 * static_cast<double>(k % 10);
      joint.current_a[k] = share * joint.current_a[k] + (1 - share) * joint.current_a[k - 1];
    }
    EXPECT_TRUE(wires_in(joint).empty()) << seed;
    const std::size_t cells = 4 + seed;
    dp::PackRecording healthy = pack_of(cells, seed, none), single = pack_of(cells, seed, one_cell),
                      second = pack_of(cells, seed, every_second), odd = pack_of(cells, seed, odd_readings);
    EXPECT_TRUE(wires_in(healthy).empty()) << seed;
    EXPECT_TRUE(wires_in(single).empty()) << seed;
    EXPECT_TRUE(wires_in(second).empty()) << seed;
    EXPECT_TRUE(wires_in(odd).empty()) << seed;
  }
}

/// Rows of seconds, channels read one after the other, a current that is read once: a pulse or a step of the load lies
/// between two channels of a row, one reads what was before and the next what was after, and the current knows neither.
TEST(LooseWires, AreNotStepsOfTheLoadBetweenTheChannelsOfARow) {
  std::size_t found = 0;
  for (unsigned seed = 1; seed <= 40; ++seed) {
    const std::size_t cells = 3 + seed % 6;
    dp::PackRecording pack = pack_of(cells, seed, [](std::size_t, std::vector<double>&) {});
    std::mt19937 random(1'000 + seed);
    std::uniform_real_distribution<double> moment(-0.5, 0.5 + 0.7 * static_cast<double>(cells));
    std::normal_distribution<double> noise(0, 1);
    double before_a = 0;
    for (std::size_t k = 0; k < rows; ++k) {
      const double now_a = k % 6 != 0 ? 5.0 * std::round(2 * noise(random)) : before_a;
      // the current is read first, then a channel at a time; the rest of a row nobody reads
      const double step_at = moment(random);
      const double pulse_a = k % 5 == 0 ? 15 * noise(random) : 0, pulse_at = moment(random);
      for (std::size_t c = 0; c < cells; ++c) {
        const double at = 1 + static_cast<double>(c);
        const double channel_a = (at < step_at ? before_a : now_a) + (std::abs(at - pulse_at) < 1.2 ? pulse_a : 0);
        pack.cell_v[c][k] = std::round((pack.cell_v[c][k] + 0.0015 * (channel_a - pack.current_a[k])) * 1e3) / 1e3;
      }
      pack.current_a[k] = step_at > 0 ? before_a : now_a;
      before_a = now_a;
    }
    dp::PackRecording with_wire = pack;
    for (std::size_t k = 0; k < rows; k += k % 97 == 29 ? 68 : 1) {
      with_wire.cell_v[0][k] += 0.3;
      with_wire.cell_v[1][k] -= 0.3;
    }
    EXPECT_TRUE(wires_in(pack).empty()) << cells << " cells, " << seed;
    const auto wires = wires_in(with_wire);
    found += wires.size() == 1 && wires[0].cell == 0 &&
                     std::abs(wires[0].finding.value - 0.3) < 2 * wires[0].finding.sigma + 0.001
                 ? 1
                 : 0;
  }
  EXPECT_GE(found, 38U) << "a wire among such rows";
}

/// A cell near its end drifts away while the load changes in every row, so that no row shows the level.
TEST(LooseWires, AreNotADriftWhileTheLoadHidesIt) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    dp::PackRecording pack = pack_of(4, seed, [](std::size_t k, std::vector<double>& v) {
      constexpr std::size_t from = 800, until = 950;
      const bool hides = k >= from && k < until;
      for (double& cell_v : v) cell_v += hides && k % 2 == 0 ? 0.08 : 0;
      const double drifted = k < from ? 0 : std::min(1.0, static_cast<double>(k - from) / (until - from));
      v[1] += 0.015 * drifted;
      v[2] -= 0.015 * drifted;
    });
    for (const dp::LooseWire& wire : wires_in(pack)) ADD_FAILURE() << seed << ": " << wire.finding.because;
  }
}

TEST(LooseWires, AreNotTheDigitsOfACoarseReading) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    for (const double digit_v : {0.002, 0.005, 0.01, 0.02}) {
      dp::PackRecording pack = pack_of(
          4 + seed, seed, [](std::size_t, std::vector<double>&) {}, digit_v);
      EXPECT_TRUE(wires_in(pack).empty()) << seed << ", " << digit_v;
    }
  }
}

TEST(LooseWires, ReplaceTheMissingReadingsOfTheirRowsOnly) {
  dp::PackFinding missing;
  missing.cause = dp::Cause::missing;
  missing.cell = 1;
  missing.value = 0.3;
  dp::LooseWire wire{.cell = 0, .rows = 300, .finding = {}};
  std::vector<dp::PackFinding> findings = {missing};
  dp::add_loose_wires({wire}, 1'000, findings);
  EXPECT_EQ(findings.size(), 1U) << "all that is missing was removed";
  missing.value = 0.9;
  findings = {missing};
  dp::add_loose_wires({wire}, 1'000, findings);
  EXPECT_EQ(findings.size(), 2U) << "most is missing for another reason";
}

}  // namespace
}  // namespace bms
