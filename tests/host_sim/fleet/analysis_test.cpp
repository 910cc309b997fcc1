// What many recordings say together, for histories that are written here: planted faults are found with their day,
// healthy batteries are left alone.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "fleet/analysis.hpp"

namespace bms::fleet {
namespace {

constexpr std::size_t trucks = 12, cells = 4, days = 24;

/// A healthy depot whose recordings are off with the rate that a diagnosis has.
class Depot {
 public:
  explicit Depot(unsigned seed) : random_(seed) {
    history_.first_day_s = 1'772'668'800;
    for (std::size_t t = 0; t < trucks; ++t) {
      for (std::size_t c = 0; c < cells; ++c) {
        history_.cells.push_back({"truck_" + std::to_string(t), std::to_string(c + 1), {}});
        for (std::size_t d = 0; d < days; ++d) history_.cells.back().entries.push_back(entry(d));
      }
    }
    history_.recordings = trucks * cells * days;
  }

  History& history() { return history_; }
  Entry& at(std::size_t truck, std::size_t cell, std::size_t day) {
    return history_.cells[truck * cells + cell].entries[day];
  }
  bool chance(double probability) { return std::uniform_real_distribution<>(0, 1)(random_) < probability; }
  static void name(Entry& entry, const std::string& mechanism, std::vector<std::string> equivalent = {}) {
    entry.verdict = equivalent.empty() ? "CAUSE" : "AMBIGUOUS";
    entry.named.push_back({mechanism, "1", 0.9, 50, Strength{0.1, 0.01}, std::move(equivalent)});
  }

 private:
  Entry entry(std::size_t day) {
    std::normal_distribution<double> normal;
    Entry e;
    e.day = static_cast<double>(day) + 0.25;
    e.verdict = "NO_MISMATCH";
    e.resistance = Strength{0.0003 * static_cast<double>(day) + 0.004 * normal(random_), 0.01};
    e.capacity = Strength{0.004 * normal(random_), 0.01};
    e.current_offset = Strength{0.003 * normal(random_), 0.01};
    e.initial_soc = Strength{0.96 + 0.0015 * normal(random_), 0.01};
    if (chance(0.014)) name(e, "ocv_hysteresis", {"slow_polarisation"});
    return e;
  }

  std::mt19937 random_;
  History history_;
};

std::vector<Issue> confirmed(const Analysis& analysis) {
  std::vector<Issue> issues = analysis.issues;
  std::erase_if(issues, [](const Issue& i) { return !i.confirmed; });
  return issues;
}

TEST(DepotAnalysis, LeavesHealthyBatteriesAlone) {
  std::size_t named = 0;
  for (unsigned seed = 1; seed <= 40; ++seed) named += confirmed(analyse(Depot(seed).history(), {})).size();
  EXPECT_LE(named, 2U) << "of " << 40 * trucks << " batteries";
}

/// A third of the recordings that are off name the contact, the others cannot explain the mismatch.
TEST(DepotAnalysis, ALooseContactIsFoundWithItsCellAndDay) {
  int found = 0, named = 0, in_time = 0;
  for (unsigned seed = 1; seed <= 20; ++seed) {
    Depot depot(seed);
    for (std::size_t d = 12; d < days; ++d) {
      if (!depot.chance(0.8)) continue;
      Entry& e = depot.at(5, 2, d);
      if (depot.chance(0.4))
        depot.name(e, "contact_intermittent");
      else
        e.verdict = "UNKNOWN";
    }
    for (const Issue& issue : confirmed(analyse(depot.history(), {}))) {
      EXPECT_EQ(issue.truck + " " + issue.cell_index, "truck_5 3");
      EXPECT_THAT(issue.cause, ::testing::AnyOf("contact_intermittent", "unknown")) << "never another cause";
      ++found;
      named += issue.cause == "contact_intermittent" ? 1 : 0;
      in_time += std::abs(*issue.onset_day - 12) <= 3 ? 1 : 0;
    }
  }
  EXPECT_GE(found, 18);
  EXPECT_GE(named, 14);
  EXPECT_GE(in_time, found - 1);
}

TEST(DepotAnalysis, WhatOneRecordingOfManyNamesIsNotTheCause) {
  Depot depot(6);
  for (std::size_t d = 19; d < days; ++d) {
    Entry& e = depot.at(7, 0, d);
    e.named.clear();
    e.verdict = "UNKNOWN";
    if (d == 21) depot.name(e, "voltage_gain");
  }
  const Analysis analysis = analyse(depot.history(), {});
  const auto issue = std::find_if(analysis.issues.begin(), analysis.issues.end(),
                                  [](const Issue& i) { return i.truck == "truck_7" && i.cell_index == "1"; });
  ASSERT_NE(issue, analysis.issues.end());
  EXPECT_EQ(issue->seen, 5U);
  EXPECT_EQ(issue->cause, "unknown");
  EXPECT_THAT(issue->also, ::testing::ElementsAre("voltage_gain"));
}

TEST(DepotAnalysis, WhatAllCellsShowIsTheirCommonSensor) {
  Depot depot(1);
  for (std::size_t d = 0; d < days; ++d) {
    for (std::size_t c = 0; c < cells; ++c) {
      Entry& e = depot.at(3, c, d);
      const double offset_a = d < 6 ? 0 : 0.01 * static_cast<double>(d - 5);
      e.current_offset->value += offset_a;
      if (d >= 9) depot.name(e, c % 2 == 0 ? "leakage" : "current_offset", {"coulombic_loss"});
    }
  }
  const auto issues = confirmed(analyse(depot.history(), {}));
  ASSERT_EQ(issues.size(), 1U);
  EXPECT_EQ(issues[0].truck, "truck_3");
  EXPECT_EQ(issues[0].cell_index, "");
  EXPECT_EQ(issues[0].cause, "current_offset");
  EXPECT_NEAR(*issues[0].onset_day, 6, 2);
  EXPECT_NEAR(issues[0].per_day.value_or(0), 0.01, 0.002);
}

/// No recording is off: the offset is below what one of them can show, and single cells see their own part of it.
TEST(DepotAnalysis, ADriftingSensorIsFoundBeforeAnyRecordingNamesIt) {
  Depot depot(7);
  for (std::size_t d = 8; d < days; ++d) {
    for (std::size_t c = 0; c < cells; ++c)
      depot.at(10, c, d).current_offset->value -= 0.002 * static_cast<double>(d - 7);
    if (d > 18) depot.name(depot.at(10, 1, d), "leakage");  // the last days of one cell
  }
  const auto issues = confirmed(analyse(depot.history(), {}));
  ASSERT_EQ(issues.size(), 1U);
  EXPECT_EQ(issues[0].truck + issues[0].cell_index, "truck_10");
  EXPECT_EQ(issues[0].cause, "current_offset");
  EXPECT_NEAR(*issues[0].onset_day, 8, 3);
  EXPECT_NEAR(issues[0].per_day.value_or(0), -0.002, 0.0005);
}

TEST(DepotAnalysis, ACellThatLosesChargeAgainstItsNeighboursDischargesItself) {
  Depot depot(2);
  for (std::size_t d = 7; d < days; ++d) depot.at(8, 1, d).initial_soc->value -= 0.006 * static_cast<double>(d - 6);
  // a charger that fills the pack less and less does not mean a self-discharge
  for (std::size_t c = 0; c < cells; ++c) {
    for (std::size_t d = 0; d < days; ++d) depot.at(2, c, d).initial_soc->value -= 0.003 * static_cast<double>(d);
  }
  const auto issues = confirmed(analyse(depot.history(), {}));
  ASSERT_EQ(issues.size(), 1U);
  EXPECT_EQ(issues[0].truck + " " + issues[0].cell_index, "truck_8 2");
  EXPECT_EQ(issues[0].cause, "leakage");
  EXPECT_NEAR(*issues[0].onset_day, 7, 2);
  EXPECT_NEAR(issues[0].per_day.value_or(0), 0.006, 0.001);
}

TEST(DepotAnalysis, AWeakCellIsFoundFromItsFirstDayAndUrgentCausesComeFirst) {
  Depot depot(3);
  for (std::size_t d = 0; d < days; ++d) {
    depot.name(depot.at(1, 0, d), "capacity_change");
    depot.name(depot.at(1, 0, d), "resistance_growth");
    if (d >= 10) depot.name(depot.at(9, 3, d), "contact_intermittent");
  }
  const auto issues = confirmed(analyse(depot.history(), {}));
  ASSERT_EQ(issues.size(), 2U);
  EXPECT_EQ(issues[0].cause, "contact_intermittent");
  EXPECT_EQ(issues[1].cause, "capacity_change");
  EXPECT_THAT(issues[1].also, ::testing::ElementsAre("resistance_growth"));
  EXPECT_EQ(issues[1].onset_day, 0);
}

/// A loss that no single recording names: 1.5 sigma each.
TEST(DepotAnalysis, ManyRecordingsTogetherShowACapacityThatNoneOfThemNames) {
  int found = 0, others = 0;
  for (unsigned seed = 1; seed <= 10; ++seed) {
    Depot depot(seed);
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    for (std::size_t d = 0; d < days; ++d) {
      const double common = 0.03 * normal(random);  // the shift's own error, which the neighbours share
      for (std::size_t c = 0; c < cells; ++c)
        depot.at(4, c, d).capacity = Strength{common + (c == 2 ? 0.06 : 0) + 0.02 * normal(random), 0.04};
      if (d > 12) depot.name(depot.at(4, 2, d), "resistance_growth");
    }
    for (const Issue& issue : confirmed(analyse(depot.history(), {}))) {
      const bool right = issue.truck == "truck_4" && issue.cell_index == "3" && issue.cause == "capacity_change";
      found += right ? 1 : 0;
      others += right ? 0 : 1;
      if (!right) continue;
      EXPECT_THAT(issue.also, ::testing::Contains("resistance_growth"));
      EXPECT_EQ(issue.onset_day, 0);
      EXPECT_FALSE(issue.size) << "no recording has a size that was fitted";
    }
  }
  EXPECT_EQ(found, 10);
  EXPECT_LE(others, 1);
}

/// Half of the cells are below the other half by what healthy cells of one battery differ by.
TEST(DepotAnalysis, UnequalCellsAreNotWeak) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    Depot depot(seed);
    for (std::size_t d = 0; d < days; ++d) {
      for (std::size_t c = 0; c < cells; ++c) depot.at(6, c, d).capacity->value += c % 2 == 0 ? 0.02 : 0;
    }
    for (const Issue& issue : confirmed(analyse(depot.history(), {}))) EXPECT_NE(issue.cause, "capacity_change");
  }
}

TEST(DepotAnalysis, AgeingIsATrendAndNotAFault) {
  Depot depot(4);
  for (std::size_t d = 0; d < days; ++d) depot.at(0, 0, d).resistance->value += 0.004 * static_cast<double>(d);
  const Analysis analysis = analyse(depot.history(), {});
  EXPECT_TRUE(confirmed(analysis).empty());
  ASSERT_TRUE(analysis.trends[0].resistance.crossing);
  EXPECT_NEAR(analysis.trends[0].resistance.crossing->day, 0.5 / 0.0043, 25);
}

TEST(DepotAnalysis, OneRecordingIsNoEvidenceAndErrorsAreCounted) {
  Depot depot(5);
  for (std::size_t t = 0; t < trucks; ++t)
    for (std::size_t c = 0; c < cells; ++c)
      for (std::size_t d = 0; d < days; ++d) {
        Entry& e = depot.at(t, c, d);
        e.named.clear();
        e.verdict = "NO_MISMATCH";
      }
  depot.name(depot.at(0, 0, 3), "contact_intermittent");
  depot.at(1, 1, 1).error = "not a recording";
  depot.at(1, 1, 1).verdict = "";
  const Analysis analysis = analyse(depot.history(), {});
  ASSERT_EQ(analysis.issues.size(), 1U);
  EXPECT_FALSE(analysis.issues[0].confirmed);
  EXPECT_EQ(analysis.errors, 1U);
}

}  // namespace
}  // namespace bms::fleet
