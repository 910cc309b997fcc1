// A bench for the front end's driver: a sample every 100 ms from a model of its chip, in the variant under test.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numeric>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "hal/bq76952/front_end.hpp"
#include "tests/hal/bq76952_board.hpp"

namespace bms {

class Bq76952 : public ::testing::Test {
 protected:
  explicit Bq76952(const hal::bq76952::Configuration& of = hal::bq76952::board_configuration) : configuration(of) {
    chip = &model;
    set_cells(3.3, 0.001);
  }
  void TearDown() override {
    EXPECT_THAT(model.violations, ::testing::IsEmpty());
    std::printf("at most %u transfers and %u us in a sample\n", max_transfers_, static_cast<unsigned>(max_us_));
    EXPECT_LE(max_transfers_, max_transfers());
    EXPECT_LE(max_us_, 60'000U);
  }

  /// Of one sample, whatever fails. A chip that returns one command at a time needs one for each of 33 words.
  unsigned max_transfers() const { return variant.transfer_spans_commands ? 30 : 75; }

  void set_cells(double v, double apart_v) {
    for (std::size_t k = 0; k < 16; ++k) model.cell_v[k] = v + apart_v * static_cast<double>(k);
    model.stack_v = std::accumulate(model.cell_v.begin(), model.cell_v.end(), 0.0);
  }
  const measurement::PackSample<16>& next(std::uint64_t after_us = 100'000) {
    const std::uint64_t due = due_us_ += after_us;
    if (model.time_us < due) model.advance(due - model.time_us);
    const unsigned before = model.transfers;
    sample.time_us = model.time_us;
    front_end.read(sample);
    max_transfers_ = std::max(max_transfers_, model.transfers - before);
    max_us_ = std::max(max_us_, model.time_us - sample.time_us);
    return sample;
  }
  bool complete() const {
    return std::none_of(sample.cell_uv.begin(), sample.cell_uv.end(),
                        [](auto uv) { return uv == measurement::no_reading; }) &&
           sample.pack_uv != measurement::no_reading && sample.current_ua != measurement::no_reading &&
           front_end.dc_link_uv() != measurement::no_reading;
  }
  bool empty() const {
    return std::all_of(sample.cell_uv.begin(), sample.cell_uv.end(),
                       [](auto uv) { return uv == measurement::no_reading; }) &&
           sample.pack_uv == measurement::no_reading && sample.current_ua == measurement::no_reading &&
           front_end.dc_link_uv() == measurement::no_reading &&
           std::all_of(sample.temperature_cdegc.begin(), sample.temperature_cdegc.end(),
                       [](auto t) { return t == measurement::no_temperature; });
  }
  int samples_until_complete(int most = 60) {
    for (int k = 1; k <= most; ++k) {
      next();
      if (complete()) return k;
    }
    return most + 1;
  }
  void start() { ASSERT_LE(samples_until_complete(), 20); }

  /// Each field has either the value of the model or no reading.
  void expect_correct_or_no_reading() const {
    const auto near = [](std::int64_t is, std::int64_t no_reading, double should_be, double within) {
      return is == no_reading || std::abs(static_cast<double>(is) - should_be) <= within;
    };
    for (std::size_t k = 0; k < 16; ++k)
      EXPECT_TRUE(near(sample.cell_uv[k], measurement::no_reading, 1e6 * model.cell_v[k], 501))
          << "cell " << k << ": " << sample.cell_uv[k] << ", " << model.cell_v[k];
    EXPECT_TRUE(near(sample.pack_uv, measurement::no_reading, 1e6 * model.stack_v, 5'001)) << sample.pack_uv;
    EXPECT_TRUE(near(front_end.dc_link_uv(), measurement::no_reading, 1e6 * model.ld_v, 5'001))
        << front_end.dc_link_uv();
    EXPECT_TRUE(near(sample.current_ua, measurement::no_reading, 1e6 * model.current_a, 0.1e6))
        << sample.current_ua << ", " << model.current_a;
    for (std::size_t k = 0; k < 4; ++k)
      EXPECT_TRUE(near(sample.temperature_cdegc[k], measurement::no_temperature, 100 * model.temperature_c[k], 5.1))
          << sample.temperature_cdegc[k];
  }

  /// A chip that was just reset takes the CRC of the current transfer for data: two unknown subcommands, and writes to
  /// a read-only register.
  void accept_violations_of_a_reset_between_transfers() {
    for (const std::string& v : model.violations) {
      EXPECT_THAT((std::vector<std::string>{"an unknown subcommand 49525", "an unknown subcommand 51318",
                                            "a write to 100", "a write to 101"}),
                  ::testing::Contains(v));
    }
    model.violations.clear();
  }

  const hal::bq76952::Configuration& configuration;
  const ChipVariant variant = variant_under_test();
  Bq76952Model model{variant};
  hal::bq76952::FrontEnd front_end{configuration};
  measurement::PackSample<16> sample;

 private:
  std::uint64_t due_us_ = 0, max_us_ = 0;
  unsigned max_transfers_ = 0;
};

}  // namespace bms
