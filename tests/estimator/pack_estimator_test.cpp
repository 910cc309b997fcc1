#include "estimator/pack_estimator.hpp"

#include <gtest/gtest.h>

#include "estimator/soc_estimator.hpp"
#include "plant/truth_cell.hpp"
#include "tests/cells.hpp"
#include "tests/starting_point.hpp"

namespace bms::estimator {
namespace {

const auto nominal = tests::prepared<float>();

TEST(MeanCell, IsThatOfTheReadingsThatCanBeOnes) {
  measurement::PackSample<4> p;
  p.time_us = 7;
  p.current_ua = -3;
  p.cell_uv = {3'300'000, 3'310'000, 0, measurement::no_reading};
  p.temperature_cdegc = {2'000, measurement::no_temperature, 3'000, -9'999};
  p.pack_uv = 13'000'000;
  const measurement::Sample mean = mean_cell(p, nominal.plausible);
  EXPECT_EQ(mean.time_us, 7U);
  EXPECT_EQ(mean.current_ua, -3);
  EXPECT_EQ(mean.voltage_uv, 3'305'000);
  EXPECT_EQ(mean.temperature_cdegc, 2'500);
}

TEST(MeanCell, NoCellAloneMovesItByMuch) {
  measurement::PackSample<16> p;
  for (std::size_t k = 0; k < 16; ++k) p.cell_uv[k] = 3'280'000 + static_cast<std::int32_t>(k) * 1'000;
  const std::int32_t whole_uv = mean_cell(p, nominal.plausible).voltage_uv;
  EXPECT_EQ(whole_uv, 3'287'500);
  for (std::int32_t uv = 1'000'000; uv < 4'500'000; uv += 10'000) {
    p.cell_uv[3] = uv;
    EXPECT_NEAR(mean_cell(p, nominal.plausible).voltage_uv, whole_uv, 7'000) << uv;
  }
  // a broken wire between two
  p.cell_uv[3] = 2'600'000;
  p.cell_uv[4] = 3'960'000;
  EXPECT_NEAR(mean_cell(p, nominal.plausible).voltage_uv, whole_uv, 1'500);
}

TEST(MeanCell, WithoutAnyTheTotalStandsInAndWithoutThatNothing) {
  measurement::PackSample<4> p;
  p.pack_uv = 13'200'000;
  EXPECT_EQ(mean_cell(p, nominal.plausible).voltage_uv, 3'300'000);
  EXPECT_EQ(mean_cell(p, nominal.plausible).temperature_cdegc, measurement::no_temperature);
  p.pack_uv = measurement::no_reading;
  EXPECT_EQ(mean_cell(p, nominal.plausible).voltage_uv, measurement::no_reading);
}

TEST(MeanCell, OfAPackOfOneIsTheSampleItself) {
  for (const measurement::Sample& s :
       {measurement::Sample{1, 2, 3'300'000, 4},
        measurement::Sample{1, measurement::no_reading, measurement::no_reading, measurement::no_temperature},
        measurement::Sample{9, -5, 17, 15'001}, measurement::Sample{9, -5, 2'147'483'647, -6'000}}) {
    const measurement::Sample mean = mean_cell(single_cell_pack(s), nominal.plausible);
    EXPECT_EQ(mean.time_us, s.time_us);
    EXPECT_EQ(mean.current_ua, s.current_ua);
    EXPECT_EQ(mean.voltage_uv, s.voltage_uv);
    EXPECT_EQ(mean.temperature_cdegc, measurement::temperature_possible(s.temperature_cdegc)
                                          ? s.temperature_cdegc
                                          : measurement::no_temperature);
  }
}

/// Four cells of the plant, one 6 % emptier and one with a quarter more resistance, through an hour of work.
TEST(PackCells, FindsTheCellThatIsEmptierThanTheOthers) {
  std::vector<plant::Cell> cells;
  const double soc[] = {0.30, 0.30, 0.24, 0.30};
  for (const double s : soc) cells.emplace_back(plant::CellParameters{}, plant::CellState{.soc = s});
  SocEstimator<float> estimator(starting_at(0.285, 0.01));
  PackCells<float, 4> pack;
  for (std::uint64_t k = 0; k < 3'600; ++k) {
    const double current_a = k % 60 < 40 ? -2 : 0.5;
    measurement::PackSample<4> p;
    p.time_us = k * 1'000'000;
    p.current_ua = static_cast<std::int32_t>(current_a * 1e6);
    for (std::size_t c = 0; c < 4; ++c) {
      if (k > 0) cells[c].run(current_a, 20, 1);
      p.cell_uv[c] = static_cast<std::int32_t>(cells[c].voltage_v() * 1e6);
    }
    p.temperature_cdegc[0] = 2'000;
    const auto mean = estimator.step(nominal, mean_cell(p, nominal.plausible));
    pack.update(nominal, p, mean);
  }
  for (std::size_t c = 0; c < 4; ++c) {
    EXPECT_NEAR(pack[c].soc(), soc[c] - 0.285, 0.005) << c;
    EXPECT_NEAR(pack[c].soc(), soc[c] - 0.285, 3 * pack[c].soc_sigma()) << c;
    EXPECT_LT(pack[c].soc_sigma(), 0.02) << c;
  }
  EXPECT_LT(pack[2].soc(), pack[0].soc() - 0.03);
}

TEST(PackCells, SurvivesGapsTimesThatGoBackAndCellsThatAreGone) {
  SocEstimator<float> estimator(starting_at(0.5, 0.01));
  PackCells<float, 4> pack;
  for (const std::uint64_t time_us : {std::uint64_t{0}, std::uint64_t{1'000'000}, std::uint64_t{1'000'000},
                                      std::uint64_t{0}, std::uint64_t{1} << 60, (std::uint64_t{1} << 60) + 1}) {
    measurement::PackSample<4> p;
    p.time_us = time_us;
    p.current_ua = -1'000'000;
    p.cell_uv = {3'280'000, measurement::no_reading, 9'000'000, 3'281'000};
    pack.update(nominal, p, estimator.step(nominal, mean_cell(p, nominal.plausible)));
    for (std::size_t c = 0; c < 4; ++c) {
      EXPECT_TRUE(std::isfinite(pack[c].soc()) && std::isfinite(pack[c].soc_sigma())) << time_us;
    }
  }
}

}  // namespace
}  // namespace bms::estimator
