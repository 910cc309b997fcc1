#include "replay/lanes.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <deque>
#include <random>

#include "arithmetic/lanes.hpp"
#include "files/recording.hpp"

namespace bms::replay {
namespace {

using measurement::Sample;

std::vector<Sample> shift() {
  static const auto all =
      measurement::samples(files::read_recording(BMS_SOURCE_DIR "/evidence/recordings/forklift_shift.csv"));
  return all;
}

/// Several cells with their samples.
class Group {
 public:
  LaneInput& add(const files::CellFile& cell, std::vector<Sample> samples,
                 std::optional<measurement::StartingPoint> start = starting_point(SocPrior{0.98})) {
    cells_.push_back(cell);
    samples_.push_back(std::move(samples));
    inputs_.push_back({cells_.back(), measurement::SampleList(samples_.back()), start});
    return inputs_.back();
  }
  LaneTracks run() const { return run_in_lanes(std::vector<LaneInput>(inputs_.begin(), inputs_.end())); }

  /// Each cell by itself gives the same bits.
  void expect_same(const std::vector<Track>& tracks) const {
    ASSERT_EQ(tracks.size(), inputs_.size());
    for (std::size_t k = 0; k < tracks.size(); ++k) {
      const LaneInput& in = inputs_[k];
      const Track one = run_on_host(in.cell, in.samples, in.start, ScalarKind::float32, Timing::none);
      ASSERT_EQ(one.rows.size(), in.samples.size());
      const auto d = first_difference(one, tracks[k], ScalarKind::float32);
      EXPECT_FALSE(d.has_value()) << "cell " << k << ", sample " << d->sample << ", " << d->field << ": " << d->host
                                  << " alone, " << d->board << " in a lane";
    }
  }

 private:
  std::deque<files::CellFile> cells_;
  std::deque<std::vector<Sample>> samples_;
  std::deque<LaneInput> inputs_;
};

files::CellFile base_cell(const char* name) {
  files::CellFile cell = files::read_cell(name);
  cell.mechanisms.clear();
  cell.parameters.noise.errors_are_states = false;
  return cell;
}

/// Cell k of a group: no two have a parameter in common.
files::CellFile cell_of_its_own(std::size_t k) {
  files::CellFile cell = base_cell(k % 3 == 2 ? "a123_26650" : "table9");
  const double factor = 1 + 0.03 * static_cast<double>(k);
  auto& p = cell.parameters;
  p.capacity_ah *= factor;
  p.noise.model_v *= factor;
  p.noise.voltage_v *= factor;
  p.reference_temperature_c += static_cast<double>(k);
  for (std::size_t n = 0; n < p.rc.soc.size; ++n) {
    p.rc.r0_ohm[n] *= factor;
    p.rc.r1_ohm[n] /= factor;
    p.rc.c1_f[n] *= factor;
  }
  return cell;
}

/// The shift as cell k sees it: other currents, voltages, temperatures, steps of the time.
std::vector<Sample> shift_of_its_own(std::size_t k) {
  std::vector<Sample> samples = shift();
  samples.resize(samples.size() - 777 * k);
  for (Sample& s : samples) {
    s.time_us *= 1 + k % 2;
    s.current_ua =
        static_cast<std::int32_t>(s.current_ua * (1 - 0.05 * static_cast<double>(k)) / static_cast<double>(1 + k % 2));
    s.voltage_uv += static_cast<std::int32_t>(100 * k);
    s.temperature_cdegc = static_cast<std::int16_t>(s.temperature_cdegc - 350 * static_cast<int>(k));
  }
  return samples;
}

TEST(LanesOfTheEstimator, HaveTheBitsOfEachCellByItself) {
  Group group;
  for (std::size_t k = 0; k < lane_count() + 3; ++k) group.add(cell_of_its_own(k), shift_of_its_own(k));
  group.expect_same(group.run().tracks);
}

TEST(LanesOfTheEstimator, ComputeTheCellsOfAPackTogether) {
  Group pack;
  for (std::size_t k = 0; k < 2 * lane_count(); ++k) {
    std::vector<Sample> samples = shift();
    for (Sample& s : samples) s.voltage_uv += static_cast<std::int32_t>(150 * k);
    pack.add(base_cell("table9"), samples);
  }
  const LaneTracks result = pack.run();
  pack.expect_same(result.tracks);
  EXPECT_EQ(result.steps, 2 * lane_count() * shift().size());
  EXPECT_LT(static_cast<double>(result.alone), 0.03 * static_cast<double>(result.steps));
  EXPECT_GE(lane_count(), 4U);
}

/// What the estimator checks, at random places of random lanes.
void spoil(std::vector<Sample>& samples, std::mt19937& random) {
  const auto any = [&](std::size_t below) { return std::uniform_int_distribution<std::size_t>(0, below - 1)(random); };
  for (std::size_t places = samples.size() / 60; places > 0; --places) {
    const std::size_t first = any(samples.size() - 40), kind = any(12), count = 1 + any(30);
    for (std::size_t k = first; k < first + count; ++k) {
      Sample& s = samples[k];
      if (kind == 0) s.current_ua = measurement::no_reading;
      if (kind == 1) s.voltage_uv = measurement::no_reading;
      if (kind == 2) s.temperature_cdegc = measurement::no_temperature;
      if (kind == 3) s.current_ua = 2'100'000'000;
      if (kind == 4) s.voltage_uv = samples[first].voltage_uv;
      if (kind == 5) s.voltage_uv += 120'000;
      if (kind == 6) s.temperature_cdegc = static_cast<std::int16_t>(any(8'000));
      if (kind == 7) s.time_us = samples[first].time_us;
      if (kind == 8) s.current_ua = static_cast<std::int32_t>(any(200'000'000)) - 100'000'000;
      if (kind == 9) s.voltage_uv = static_cast<std::int32_t>(any(5'000'000));
    }
    if (kind == 10) {
      for (std::size_t k = first; k < samples.size(); ++k) samples[k].time_us += 1'000'000 * any(4) / 3;
    }
    if (kind == 11) samples[first].time_us += 3'000'000'000'000;
  }
}

TEST(LanesOfTheEstimator, HaveTheSameBitsWithBadReadings) {
  std::mt19937 random(27);
  Group group;
  for (std::size_t k = 0; k < 3 * lane_count(); ++k) {
    std::vector<Sample> samples = shift_of_its_own(k % 8);
    samples.resize(4'000 + 100 * k);
    spoil(samples, random);
    group.add(cell_of_its_own(k % 8), samples,
              k % 3 == 0 ? std::optional<measurement::StartingPoint>() : starting_point(SocPrior{0.98}));
  }
  group.expect_same(group.run().tracks);
}

/// A wrong capacity takes the counted charge to its limits.
TEST(LanesOfTheEstimator, HaveTheSameBitsAtTheLimitsOfTheCharge) {
  Group group;
  for (std::size_t k = 0; k < lane_count(); ++k) {
    files::CellFile cell = base_cell("table9");
    cell.parameters.capacity_ah *= 0.02 * static_cast<double>(1 + k);
    std::vector<Sample> samples = shift();
    for (Sample& s : samples) s.voltage_uv = k % 2 == 0 ? measurement::no_reading : s.voltage_uv;
    group.add(cell, samples);
  }
  group.expect_same(group.run().tracks);
}

TEST(LanesOfTheEstimator, LeaveCellsWithMechanismsToTheEstimator) {
  Group group;
  group.add(files::read_cell("a123_26650_extended"), shift());
  group.add(base_cell("table9"), shift());
  const LaneTracks result = group.run();
  group.expect_same(result.tracks);
  EXPECT_EQ(result.steps, shift().size());
}

TEST(LanesOfTheEstimator, OfNoCellsAreNoTracks) { EXPECT_TRUE(run_in_lanes({}).tracks.empty()); }

TEST(Lanes, GiveTheExponentialOfEachLane) {
  using Two = arithmetic::Lanes<2>;
  for (float x = 1e-6F; x < 300; x *= 1.003F) {
    Two::Array rates{};
    for (std::size_t k = 0; k < rates.size(); ++k) rates[k] = x * static_cast<float>(k * k * k);
    const auto lanes = arithmetic::step_response_after<Two>(Two(0.7F), Two(rates)).array();
    for (std::size_t k = 0; k < rates.size(); ++k)
      ASSERT_EQ(lanes[k], arithmetic::step_response_after<float>(0.7F, rates[k])) << x << ", lane " << k;
  }
}

TEST(Lanes, SelectLaneByLane) {
  using Two = arithmetic::Lanes<2>;
  Two::Array numbers{};
  for (std::size_t k = 0; k < numbers.size(); ++k) numbers[k] = static_cast<float>(k);
  const Two x(numbers), three(3.0F);
  const auto larger = select(x > three, x, three).array();
  for (std::size_t k = 0; k < numbers.size(); ++k) EXPECT_EQ(larger[k], std::max(3.0F, numbers[k])) << k;
  EXPECT_TRUE(any(x > three));
  EXPECT_FALSE(all(x > three));
  EXPECT_TRUE(all(x >= Two(0.0F)));
}

}  // namespace
}  // namespace bms::replay
