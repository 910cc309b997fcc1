// Two stacked chips as one front end: what the pack of 25 cells has is what the sample says, and a half that is lost,
// late, stale, reset, exchanged or wrongly clocked has no readings, is named, and opens the contactors in time.
#include "hal/bq76952/stack.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "plant/link_poles.hpp"
#include "protection/protection.hpp"
#include "tests/firmware/protection/expected_rows.hpp"
#include "tests/hal/stacked_board.hpp"

namespace bms {
namespace {

using hal::FrontEndState;
using protection::Fault;
constexpr std::size_t lower = StackedBoard::lower, upper = StackedBoard::upper;

constexpr protection::PackDesign design = [] {
  protection::PackDesign d = protection::forklift;
  d.cells = StackedBoard::cells;
  return d;
}();

/// A pack of 25 cells on a bench: a sample every 100 ms from the two chips, and the protection that acts on it.
class StackBench {
 public:
  StackBench() { stack.start(); }

  void next() {
    due_us_ += 100'000;
    if (board.time_us < due_us_) board.advance(due_us_ - board.time_us);
    inputs.time_us = board.time_us;
    stack.read(inputs, {}, sample);
    longest_us = std::max(longest_us, board.time_us - inputs.time_us);
    before_v_ = truth_v_;
    truth_v_ = board.cell_v;
    protect();
  }
  void run_s(double seconds) {
    for (int k = 0; k < static_cast<int>(std::lround(10 * seconds)); ++k) next();
  }
  bool known(std::size_t half) const {
    const auto first = sample.cell_uv.begin() + (half == lower ? 0 : 13);
    return std::none_of(first, first + (half == lower ? 13 : 12),
                        [](auto uv) { return uv == measurement::no_reading; });
  }
  bool missing(std::size_t half) const {
    const auto first = sample.cell_uv.begin() + (half == lower ? 0 : 13);
    return std::all_of(first, first + (half == lower ? 13 : 12), [](auto uv) { return uv == measurement::no_reading; });
  }
  bool complete() const {
    return known(lower) && known(upper) && sample.pack_uv != measurement::no_reading &&
           sample.current_ua != measurement::no_reading;
  }
  int samples_until_complete(int most = 80) {
    for (int k = 1; k <= most; ++k) {
      next();
      if (complete()) return k;
    }
    return most + 1;
  }
  /// Measures and drives with closed contactors.
  void drive_off() {
    ASSERT_LE(samples_until_complete(), 40);
    external.request = protection::Request::drive;
    for (int k = 0; k < 150 && decision().state != protection::ContactorState::drive; ++k) next();
    board.current_a = -3;
    run_s(3);
    ASSERT_EQ(decision().state, protection::ContactorState::drive);
    ASSERT_EQ(decision().faults, 0U);
  }
  const protection::Decision& decision() const { return protection.decision(); }
  bool has(Fault fault) const { return (decision().faults & protection::bit(fault)) != 0; }
  bool closed() const { return decision().outputs.main_plus && board.enables_contactors(); }
  /// Each reading has the value of the circuit, or is missing. The last reading before a chip stops to measure is of
  /// the period before.
  void expect_right_or_none() const {
    for (std::size_t k = 0; k < StackedBoard::cells; ++k) {
      if (sample.cell_uv[k] != measurement::no_reading) {
        ASSERT_TRUE(std::abs(sample.cell_uv[k] - 1e6 * truth_v_[k]) < 501 ||
                    std::abs(sample.cell_uv[k] - 1e6 * before_v_[k]) < 501)
            << "cell " << k << ": " << sample.cell_uv[k] << ", " << truth_v_[k];
      }
    }
    double sum_v = 0;
    for (const double v : truth_v_) sum_v += v;
    if (sample.pack_uv != measurement::no_reading) {
      ASSERT_NEAR(sample.pack_uv, 1e6 * sum_v, 20'001);
    }
  }

  StackedBoard board;
  hal::bq76952::Stack stack;
  hal::bq76952::Stack::Inputs inputs;
  measurement::PackSample<StackedBoard::cells> sample;
  protection::ExternalInputs external;
  std::uint64_t longest_us = 0;

 private:
  /// The DC link follows the contactors.
  void protect() {
    const protection::Outputs out = decision().outputs;
    double pack_v = 0;
    for (double& v : board.cell_v) pack_v += v;
    const bool plus = out.main_plus && board.enables_contactors();
    if (plus && out.main_minus)
      link_v_ = pack_v;
    else if (out.precharge && out.main_minus)
      link_v_ += 0.18 * (pack_v - link_v_);
    else
      link_v_ *= 0.97;
    if (!plus) board.current_a = 0;
    const plant::LinkPoles poles = plant::link_poles(plus || out.precharge, out.main_minus, pack_v, link_v_);
    external.link_plus_uv = static_cast<std::int32_t>(std::lround(1e6 * poles.plus_v));
    external.link_minus_uv = static_cast<std::int32_t>(std::lround(1e6 * poles.minus_v));
    external.second_line = stack.trips();
    external.front_end_cdegc = stack.health().die_cdegc;
    for (std::size_t k = 0; k < board.cell_v.size(); ++k)  // a reading that never changes is a fault of its own
      board.cell_v[k] = 3.28 + 0.001 * static_cast<double>(k) + 0.0005 * static_cast<double>((count_ + k) % 3);
    for (std::size_t k = 0; k < 4; ++k) board.temperature_c[k] = 25 + 0.1 * static_cast<double>((count_ + k) % 5);
    ++count_;
    protection.update(sample, estimate_, external);
  }

  static constexpr protection::ProtectionPlan plan = protection_plan(design);
  protection::Protection<StackedBoard::cells> protection{plan};
  protection::PackEstimate<StackedBoard::cells> estimate_ = [] {
    protection::PackEstimate<StackedBoard::cells> e;
    e.soc_ppb = 600'000'000;
    return e;
  }();
  std::array<double, StackedBoard::cells> truth_v_{}, before_v_{};  ///< of the last two samples
  double link_v_ = 0;
  unsigned count_ = 0;
  std::uint64_t due_us_ = 0;
};

TEST(Stack, ReadsThirteenAndTwelveCellsAsTwentyFiveInOrder) {
  StackBench bench;
  const int samples = bench.samples_until_complete();
  std::printf("measures with sample %d\n", samples);
  EXPECT_LE(samples, 25);
  bench.board.current_a = -80;
  bench.run_s(2);
  EXPECT_TRUE(bench.complete());
  EXPECT_NEAR(bench.sample.cell_uv[12], 3'292'500, 1'000);
  EXPECT_NEAR(bench.sample.cell_uv[13], 3'293'500, 1'000);
  EXPECT_EQ(bench.stack.health().state, FrontEndState::measuring);
  for (const Bq76952Model& chip : bench.board.chip) EXPECT_THAT(chip.violations, ::testing::IsEmpty());
}

TEST(Stack, TheWarmerDieOpensBeforeItsChipShutsDown) {
  for (const std::size_t hot : {lower, upper}) {
    StackBench bench;
    bench.drive_off();
    double opened_c = 0;
    for (bench.board.die_c[hot] = 80; bench.board.die_c[hot] < 109; bench.board.die_c[hot] += 0.2) {  // 2 K/s
      bench.next();
      if (opened_c == 0 && !bench.decision().outputs.any_closed()) opened_c = bench.board.die_c[hot];
    }
    EXPECT_GT(opened_c, 95);
    EXPECT_LT(opened_c, 110);
    EXPECT_TRUE(bench.has(Fault::front_end_hot));
    EXPECT_EQ(bench.decision().first.fault, static_cast<std::uint8_t>(Fault::front_end_hot));
    EXPECT_TRUE(bench.board.enables_contactors()) << "the chips have not opened";
  }
}

TEST(Stack, TenMinutesOfDrivingHaveNoFaultAndNoMissingReading) {
  StackBench bench;
  bench.drive_off();
  for (int k = 0; k < 6'000; ++k) {
    bench.board.current_a = k / 50 % 3 == 0 ? -5 : -1.5;
    bench.next();
    ASSERT_TRUE(bench.complete()) << k;
    ASSERT_EQ(bench.decision().faults, 0U) << k;
    ASSERT_TRUE(bench.closed()) << k;
    bench.expect_right_or_none();
  }
  std::printf("a sample at most %u us, skew at most %u us\n", static_cast<unsigned>(bench.longest_us),
              bench.stack.longest_skew_us());
  EXPECT_LT(bench.stack.longest_skew_us(), 63'000) << "PackDesign::cell_skew_v is for this age";
  EXPECT_LT(bench.longest_us, 50'000) << "BMS_BUDGET_SAMPLE_MS of the board";
}

// ---- faults of either half and of both ----

enum class Kind { none, lost, late, stale, reset, misplaced, slow, fast };
constexpr std::array kinds{Kind::none,  Kind::lost,      Kind::late, Kind::stale,
                           Kind::reset, Kind::misplaced, Kind::slow, Kind::fast};

struct Expected {
  const char* name;
  FrontEndState of_lower, of_upper;
  int samples;     ///< until the half has no readings and is named
  double opens_s;  ///< latest opening after the fault
};

/// Row `voltage missing` and the orderly stop behind it (firmware/protection/README.md), and two samples to see it.
constexpr double orderly_s = 0.5 + 5 + 0.2;

Expected expected(Kind kind) {
  using enum FrontEndState;
  switch (kind) {
    case Kind::lost:
      return {"lost", lower_absent, upper_absent, 3, orderly_s};
    case Kind::late:
      return {"late", lower_absent, upper_absent, 3, orderly_s};
    case Kind::stale:
      return {"stale", lower_stale, upper_stale, 2, orderly_s};
    case Kind::reset:
      return {"reset", lower_configuring, upper_configuring, 3, 0.3};
    case Kind::misplaced:
      return {"misplaced", lower_misplaced, upper_misplaced, 3, orderly_s};
    case Kind::slow:
      return {"slow", lower_clock_wrong, upper_clock_wrong, 600, 60 + orderly_s};
    case Kind::fast:
      return {"fast", lower_clock_wrong, upper_clock_wrong, 600, 60 + orderly_s};
    case Kind::none:
      break;
  }
  return {"none", measuring, measuring, 0, 0};
}

void begin(Kind kind, std::size_t half, StackedBoard& board) {
  Bq76952Model& chip = board.chip[half];
  switch (kind) {
    case Kind::lost:
      chip.gone = true;
      return;
    case Kind::late:
      chip.hung = true;
      return;
    case Kind::stale:
      chip.frozen = true;
      return;
    case Kind::reset:
      chip.reset();
      return;
    case Kind::misplaced:
      board.strapped[half] = false;
      return;
    case Kind::slow:
      board.clock[half] = 0.9;
      return;
    case Kind::fast:
      board.clock[half] = 1.1;
      return;
    case Kind::none:
      return;
  }
}

/// What must be named: the quicker one of two different faults until the other one is found, then the lower half's.
struct FaultsOfBoth : ::testing::TestWithParam<std::tuple<Kind, Kind>> {};

TEST_P(FaultsOfBoth, LoseOnlyTheirReadingsAreNamedAndOpenInTime) {
  const std::array<Kind, 2> kind{std::get<0>(GetParam()), std::get<1>(GetParam())};
  StackBench bench;
  bench.drive_off();
  const std::uint64_t begun_us = bench.board.time_us;
  double opens_s = 1e9;
  int samples = 0;
  for (const std::size_t half : {lower, upper}) {
    begin(kind[half], half, bench.board);
    if (kind[half] == Kind::none) continue;
    opens_s = std::min(opens_s, expected(kind[half]).opens_s);
    samples = std::max(samples, expected(kind[half]).samples);
  }
  double opened_s = -1;
  std::array<bool, 2> lost{}, named{};
  bool both_named = false, all_lost = false;
  for (int k = 0, more = 65; k < samples + 65 && more > 0; ++k) {
    more -= all_lost ? 1 : 0;
    bench.next();
    bench.expect_right_or_none();
    const FrontEndState state = bench.stack.health().state;
    for (const std::size_t half : {lower, upper}) {
      const Expected should_be = expected(kind[half]);
      if (kind[half] == Kind::none) {
        ASSERT_TRUE(bench.known(half)) << "the other half loses nothing, sample " << k;
        continue;
      }
      lost[half] = lost[half] || bench.missing(half);
      named[half] = named[half] || state == (half == lower ? should_be.of_lower : should_be.of_upper);
      if (k + 1 >= should_be.samples) {
        ASSERT_TRUE(lost[half]) << should_be.name << " of half " << half << " has readings after " << k + 1;
      }
    }
    all_lost = (lost[lower] || kind[lower] == Kind::none) && (lost[upper] || kind[upper] == Kind::none) &&
               (kind[lower] != Kind::none || kind[upper] != Kind::none);
    using enum FrontEndState;
    both_named = both_named || state == absent || state == configuring || state == swapped;
    if (opened_s < 0 && !bench.closed()) opened_s = 1e-6 * static_cast<double>(bench.board.time_us - begun_us);
  }
  if (kind[lower] == Kind::none && kind[upper] == Kind::none) {
    EXPECT_LT(opened_s, 0);
    return;
  }
  ASSERT_GE(opened_s, 0) << "stays closed";
  EXPECT_LE(opened_s, opens_s);
  EXPECT_TRUE(named[lower] || kind[lower] == Kind::none || both_named);
  EXPECT_TRUE(named[upper] || kind[upper] == Kind::none || both_named || kind[lower] != Kind::none);
  std::printf("opened after %.2f s\n", opened_s);
}
INSTANTIATE_TEST_SUITE_P(Stack, FaultsOfBoth,
                         ::testing::Combine(::testing::ValuesIn(kinds), ::testing::ValuesIn(kinds)),
                         [](const auto& info) {
                           return std::string(expected(std::get<0>(info.param)).name) + "And" +
                                  expected(std::get<1>(info.param)).name;
                         });

TEST(Stack, ExchangedBusesAreNamedAndHaveNoReadings) {
  StackBench bench;
  bench.board.swapped = true;
  bench.run_s(6);
  EXPECT_EQ(bench.stack.health().state, FrontEndState::swapped);
  EXPECT_TRUE(bench.missing(lower) && bench.missing(upper));
  EXPECT_EQ(bench.sample.current_ua, measurement::no_reading);
  EXPECT_TRUE(bench.has(Fault::samples_missing));
}

TEST(Stack, TheIsolatorWithoutSupplyOpensAtOnceByItsEnableSignals) {
  StackBench bench;
  bench.drive_off();
  bench.board.isolator_supplied = false;
  EXPECT_FALSE(bench.closed()) << "the enable signals are low without the far side's supply";
  bench.run_s(1);
  EXPECT_EQ(bench.stack.health().state, FrontEndState::upper_absent);
  EXPECT_TRUE(bench.known(lower));
  EXPECT_TRUE(bench.missing(upper));
  EXPECT_TRUE(bench.has(Fault::voltage_missing));
  EXPECT_FALSE(bench.decision().outputs.main_plus);
  bench.board.isolator_supplied = true;
  EXPECT_LE(bench.samples_until_complete(), 40)
      << "it is found again: " << static_cast<int>(bench.stack.health().state);
}

}  // namespace
}  // namespace bms
