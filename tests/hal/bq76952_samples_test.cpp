// The back end hal/bq76952/samples.cpp: period, received frames, contactors and balancing.
#include "hal/samples.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "hal/requests.hpp"
#include "hal/sample_frames.hpp"
#include "tests/hal/bq76952_board.hpp"

namespace bms {
namespace {

using ::testing::IsEmpty;

// hal/bq76952/samples.cpp has a single front end for the whole program, so one test covers all of it.
TEST(Bq76952Samples, ComeEvery100msWithOrWithoutTheChipReceiveRequestsAndSwitchContactors) {
  Bq76952Model model{variant_under_test()};
  chip = &model;
  model.cell_v.fill(3.3);
  model.stack_v = 52.8;
  model.ld_v = 40;
  model.gone = true;
  arriving = {hal::frame_of(measurement::StartingPoint{500'000'000, 10'000'000}),
              {hal::start_frame_id, 8, {1}, true},
              {0x1A0, 8, {1, 2, 3}},
              {hal::reading_frame_id, 8, {}}};
  std::uint64_t last_us = 0;
  for (int k = 0; k < 50; ++k) {
    if (k == 10) model.gone = false;
    const auto* s = hal::next_sample();
    ASSERT_NE(s, nullptr);
    if (k > 0) {
      ASSERT_NEAR(static_cast<double>(s->time_us - last_us), 100'000, 1'001);
    }
    last_us = s->time_us;
    if (k < 10) {
      ASSERT_EQ(s->cell_uv[3], measurement::no_reading);
    }
    if (k == 49) {
      EXPECT_EQ(s->cell_uv[3], 3'300'000);
      EXPECT_EQ(hal::dc_link_uv(), 40'000'000);
    }
  }
  EXPECT_FALSE(hal::starting_point()) << "a board that measures itself takes no state of charge from the bus";
  can::Frame request;
  ASSERT_TRUE(hal::next_request(request));
  EXPECT_TRUE(request.long_id) << "a 29-bit frame is not the starting point";
  ASSERT_TRUE(hal::next_request(request));
  EXPECT_EQ(request.id, 0x1A0);
  EXPECT_FALSE(hal::next_request(request)) << "a sample frame of another node is not a request";
  hal::PowerPath wanted;
  wanted.main_minus = true;
  wanted.bleed = 0x0100;
  hal::power_path_set(wanted);
  hal::next_sample();
  ASSERT_FALSE(switched.empty());
  EXPECT_TRUE(switched.back().main_minus && !switched.back().main_plus);
  EXPECT_EQ(model.balancing(), 0x0100);

  model.advance(730'000);  // an erase of flash stopped the core
  const std::uint64_t late_us = hal::next_sample()->time_us;
  EXPECT_NEAR(static_cast<double>(hal::next_sample()->time_us - late_us), 100'000, 1'001);
  EXPECT_THAT(model.violations, IsEmpty());
}

}  // namespace
}  // namespace bms
