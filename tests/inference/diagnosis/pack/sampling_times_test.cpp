// The time from the first to the last channel that is read, from readings of cells that are resistances.
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "diagnosis/pack/sampling_times.hpp"
#include "plant/random.hpp"
#include "tests/cells.hpp"

namespace bms {
namespace {

namespace dp = diagnosis::pack;

constexpr double r0_ohm = 0.01, cell_v = 3.3;
constexpr std::size_t rows = 6'000, cells = 12;

/// A current that is constant between steps at any moment.
class Current {
 public:
  Current(double shortest_s, double longest_s, double end_s) {
    plant::Random random(3);
    for (double t = 0; t < end_s; t += shortest_s + (longest_s - shortest_s) * random.uniform()) {
      from_s_.push_back(t);
      current_a_.push_back(6 * random.normal());
    }
  }
  double at(double t) const {
    std::size_t k = 0;
    for (std::size_t width = from_s_.size(); width > 0; width /= 2) {
      while (k + width < from_s_.size() && from_s_[k + width] <= t) k += width;
    }
    return current_a_[k];
  }

 private:
  std::vector<double> from_s_, current_a_;
};

/// The channels are read one after the other, the first one early_s before the end of the row, the last one span_s
/// earlier than that.
dp::PackRecording recording_of(const Current& current, double step_s, double early_s, double span_s) {
  constexpr std::size_t parts = 100;
  plant::Random random(4);
  dp::PackRecording pack;
  pack.cell_v.resize(cells);
  for (std::size_t k = 1; k <= rows; ++k) {
    const double end_s = static_cast<double>(k) * step_s;
    double sum_a = 0;
    for (std::size_t j = 0; j < parts; ++j)
      sum_a += current.at(end_s - step_s * (static_cast<double>(j) + 0.5) / static_cast<double>(parts));
    pack.time_s.push_back(end_s);
    pack.current_a.push_back(sum_a / static_cast<double>(parts));
    pack.soc.push_back(0.5);
    for (std::size_t c = 0; c < cells; ++c) {
      const double delay_s = early_s + span_s * static_cast<double>(c) / static_cast<double>(cells - 1);
      const double ohm = r0_ohm * (1 + 0.02 * static_cast<double>(c % 3));
      pack.cell_v[c].push_back(cell_v + ohm * current.at(std::fmax(0, end_s - delay_s)) + 0.0003 * random.normal());
    }
  }
  return pack;
}

dp::Track track_of(const dp::PackRecording& pack) {
  model::CellParameters<> cell = tests::table9;
  for (std::size_t k = 0; k < cell.rc.r1_ohm.size; ++k) cell.rc.r1_ohm[k] = 1e-5;  // no polarisation
  return dp::track_of(cell, pack);
}

std::optional<dp::Estimated> span_in(const dp::PackRecording& pack) {
  std::vector<std::size_t> all;
  for (std::size_t c = 0; c < cells; ++c) all.push_back(c);
  return dp::sampling_span(track_of(pack), pack, all);
}

TEST(PackSamplingTimes, FollowFromStepsThatStandAlone) {
  for (const double span_s : {0.2, 0.5, 0.8}) {
    const auto found = span_in(recording_of(Current(5, 20, rows), 1, 0.05, span_s));
    ASSERT_TRUE(found) << span_s;
    EXPECT_LT(std::abs(found->value - span_s), 2 * found->sigma) << span_s << ", found " << found->value;
    EXPECT_LT(found->sigma, 0.06);
  }
}

TEST(PackSamplingTimes, AreUnknownIfTheCurrentChangesSeveralTimesWithinARow) {
  const dp::PackRecording fast = recording_of(Current(2, 6, 10.0 * rows), 10, 0.5, 5);
  EXPECT_FALSE(span_in(fast));
  EXPECT_FALSE(dp::steps_stand_alone(track_of(fast), fast));
  const dp::PackRecording some_alone = recording_of(Current(0.3, 3, rows), 1, 0.05, 0.5);
  EXPECT_FALSE(dp::steps_stand_alone(track_of(some_alone), some_alone));
  const dp::PackRecording slow = recording_of(Current(5, 20, rows), 1, 0.05, 0.5);
  EXPECT_TRUE(dp::steps_stand_alone(track_of(slow), slow));
}

TEST(PackSamplingTimes, AreUnknownIfTheChannelsAreReadARowAfterTheCurrent) {
  EXPECT_FALSE(span_in(recording_of(Current(5, 20, rows), 1, 1.1, 0.5)));
}

TEST(PackSamplingTimes, OfALinearFitAreAtLeastThatAndAtMostARow) {
  const dp::Estimated span = dp::span_within_row(1.4, 10);
  for (const double span_s : {1.4, 3.0, 7.0, 10.0}) EXPECT_LT(std::abs(span.value - span_s), 2 * span.sigma) << span_s;
}

}  // namespace
}  // namespace bms
