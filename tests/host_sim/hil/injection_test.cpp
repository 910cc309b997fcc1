#include "hil/injection.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "files/bad_input.hpp"
#include "hil/session.hpp"

namespace bms::hil {
namespace {

measurement::PackSample<max_cells> reading(std::int32_t first_uv) {
  measurement::PackSample<max_cells> s;
  s.current_ua = -first_uv;
  for (std::size_t k = 0; k < max_cells; ++k) s.cell_uv[k] = first_uv + static_cast<std::int32_t>(k);
  s.temperature_cdegc[0] = static_cast<std::int16_t>(first_uv % 1000);
  return s;
}

TEST(Injection, RejectsInvalidTexts) {
  for (const char* text : {"", "drop", "drop@3", "drop=2@3", "drop=x@3", "drop=nan@3", "cell_stuck@3", "cell_stuck=0@3",
                           "cell_stuck=17@3", "cell_stuck=1.5@3", "sense_wire=16@3", "welded=1@3", "welded@",
                           "welded@-1", "welded@5-5", "welded@5-4", "nothing@3"}) {
    EXPECT_THROW(parse_injection(text, 16), files::BadInput) << text;
  }
  try {
    parse_injection("cell_open=3@60", 1);
    FAIL() << "of a board with one cell";
  } catch (const files::BadInput& refused) {
    EXPECT_THAT(refused.what(), testing::HasSubstr("this board has one cell"));
  }
  const auto i = parse_injection("cell_open=3@60.5-90", 16);
  EXPECT_EQ(i.name, "cell_open");
  EXPECT_EQ(i.value, 3);
  EXPECT_EQ(i.from_s, 60.5);
  EXPECT_EQ(i.to_s, 90);
  EXPECT_EQ(i.expected, "VoltageMissing");
}

TEST(Injector, ActsDuringItsIntervalAndOnItsCellOnly) {
  Injector injector({parse_injection("cell_open=3@10-20", 16), parse_injection("current_stuck@10-20", 16)}, 1);
  for (const double time_s : {9.9, 10.0, 19.9, 20.0}) {
    auto s = reading(3'300'000 + static_cast<std::int32_t>(time_s * 10));
    const auto whole = s;
    injector.apply(time_s, s);
    const bool inside = time_s >= 10 && time_s < 20;
    EXPECT_EQ(s.cell_uv[2], inside ? measurement::no_reading : whole.cell_uv[2]) << time_s;
    EXPECT_EQ(s.cell_uv[3], whole.cell_uv[3]) << time_s;
    EXPECT_EQ(s.current_ua, inside ? -(3'300'000 + 99) : whole.current_ua) << time_s << ": stuck at the last value";
  }
}

TEST(TracePoint, AMissingReadingIsNoVoltage) {
  auto s = reading(3'300'000);
  s.cell_uv[2] = measurement::no_reading;
  const auto [low_v, high_v] = voltage_range_v(s, 16);
  EXPECT_DOUBLE_EQ(low_v, 3.3);
  EXPECT_DOUBLE_EQ(high_v, 3.300015);
  s.cell_uv.fill(measurement::no_reading);
  EXPECT_TRUE(std::isnan(voltage_range_v(s, 16).first));
}

TEST(Injector, ABrokenSenseWireShiftsTwoNeighboursInOppositeDirectionsAndPreservesTheirSum) {
  Injector injector({parse_injection("sense_wire=5@0", 16)}, 1);
  auto s = reading(3'300'000);
  const auto whole = s;
  injector.apply(1, s);
  EXPECT_EQ(s.cell_uv[4] + s.cell_uv[5], whole.cell_uv[4] + whole.cell_uv[5]);
  EXPECT_LT(s.cell_uv[4], whole.cell_uv[4] - 300'000);
  EXPECT_GT(s.cell_uv[5], whole.cell_uv[5] + 300'000);
}

TEST(Injector, DropsCorruptsAndDelaysTheRequestedFractionOfFrames) {
  const std::vector<can::Frame> sent(10, can::Frame{0x310, 8, {1, 2, 3, 4, 5, 6, 7, 8}});
  const auto run = [&](const char* text) {
    Injector injector({parse_injection(text, 16)}, 7);
    std::size_t through = 0, changed = 0;
    for (int k = 0; k < 1'000; ++k) {
      for (const auto& f : injector.apply(k, sent)) {
        ++through;
        if (f.data != sent[0].data) ++changed;
      }
    }
    return std::pair(through, changed);
  };
  EXPECT_NEAR(static_cast<double>(run("drop=0.1@0").first), 9'000, 120);
  EXPECT_EQ(run("drop=0.1@0").second, 0U);
  EXPECT_EQ(run("corrupt=0.1@0").first, 10'000U);
  EXPECT_NEAR(static_cast<double>(run("corrupt=0.1@0").second), 1'000, 120);
  EXPECT_NEAR(static_cast<double>(run("delay=0.5@0").first), 10'000, 10) << "delayed frames are not lost";
  EXPECT_EQ(run("silence@0").first, 0U);
}

TEST(SimulatedPack, TheDcLinkFollowsThePrechargeCurveAndStaysChargedThroughAWeldedContactor) {
  SimulatedPack pack(files::read_cell("table9"), 16, 0.5, {});
  const double v = pack.pack_v();
  EXPECT_NEAR(v, 16 * 3.285, 0.3);
  for (int k = 0; k < 5; ++k) pack.run(-6, {.main_minus = true, .precharge = true}, false, 25, 0.1);
  EXPECT_NEAR(pack.dc_link_v(), v * (1 - std::exp(-1.0)), 0.01 * v) << "after one time constant";
  EXPECT_EQ(pack.current_a(), 0) << "no load current during precharge";
  pack.run(-6, {.main_plus = true, .main_minus = true}, false, 25, 0.1);
  EXPECT_EQ(pack.current_a(), -6);
  EXPECT_NEAR(pack.dc_link_v(), pack.pack_v(), 1e-9);
  pack.run(-6, {.main_minus = true}, true, 25, 0.1);
  EXPECT_EQ(pack.current_a(), -6) << "welded";
  pack.run(-6, {}, false, 25, 5);
  EXPECT_EQ(pack.current_a(), 0);
  EXPECT_NEAR(pack.dc_link_v(), pack.pack_v() * std::exp(-1.0), 0.5);
}

TEST(SimulatedPack, CellsDifferAndTheSameSeedReproducesThem) {
  SimulatedPack a(files::read_cell("table9"), 16, 0.5, {.seed = 3}),
      b(files::read_cell("table9"), 16, 0.5, {.seed = 3}), c(files::read_cell("table9"), 16, 0.5, {.seed = 4});
  for (int k = 0; k < 100; ++k) {
    for (SimulatedPack* p : {&a, &b, &c}) p->run(-6, {.main_plus = true, .main_minus = true}, false, 25, 1);
  }
  EXPECT_EQ(a.soc(), b.soc());
  EXPECT_NE(a.soc(), c.soc());
  EXPECT_NE(a.voltage_v(0), a.voltage_v(1));
  EXPECT_NEAR(a.soc(), 0.5 - 100.0 / 3'600, 0.01);
  EXPECT_EQ(a.read(5, 25).cell_uv, b.read(5, 25).cell_uv);
}

}  // namespace
}  // namespace bms::hil
