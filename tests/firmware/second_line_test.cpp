// Thresholds of the measuring chip's own protections for cells of several chemistries. Expected registers are computed
// by hand from the limits of the cell: severe rows are 10 % of the span above and 12 % below the limits, a short
// circuit is five times the larger continuous current.
#include "firmware/front_end/second_line.hpp"

#include <bit>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <string>

#include <gtest/gtest.h>

#include "firmware/board_design.hpp"
#include "protection/contactor_plan.hpp"
#include "tests/cells.hpp"

namespace bms::firmware {
namespace {

constexpr double period_s = 0.1;

struct Chip {
  constexpr explicit Chip(const model::Limits& limits, double capacity_ah, std::uint8_t cells = 16)
      : pack{.limits = limits, .capacity_ah = capacity_ah, .cells = cells, .temperatures = 4},
        rules(protection::rules_of(protection::protection_table(pack))),
        board(front_end_board(pack, rules)),
        settings(hal::bq76952::settings(board)),
        line(second_line(settings, board.shunt_mohm)) {}

  constexpr bool wider_and_slower() const {
    return overvoltage_is_wider_and_slower(line, rules, period_s) &&
           undervoltage_is_wider_and_slower(line, rules, period_s) &&
           overcurrent_is_wider_and_slower(line, rules, period_s) && host_silence_is_slower(line, rules) &&
           current_is_in_range(board, rules) && hal::bq76952::possible(board);
  }
  constexpr std::uint32_t at(std::uint16_t address) const { return hal::bq76952::value_of(settings, address); }

  protection::PackDesign pack;
  protection::Rules rules;
  hal::bq76952::Board board;
  decltype(hal::bq76952::settings(hal::bq76952::Board{})) settings;
  SecondLine line;
};

constexpr model::Limits nmc{.voltage_min_v = 3.0,
                            .voltage_max_v = 4.2,
                            .charge_current_max_a = 50,
                            .discharge_current_max_a = 100,
                            .temperature_min_c = -20,
                            .temperature_max_c = 60};
constexpr model::Limits lto{.voltage_min_v = 1.5,
                            .voltage_max_v = 2.8,
                            .charge_current_max_a = 60,
                            .discharge_current_max_a = 60,
                            .temperature_min_c = -30,
                            .temperature_max_c = 55};
constexpr model::Limits lfp_200ah{.voltage_min_v = 2.5,
                                  .voltage_max_v = 3.65,
                                  .charge_current_max_a = 200,
                                  .discharge_current_max_a = 200,
                                  .temperature_min_c = -20,
                                  .temperature_max_c = 60};

constexpr Chip table9(tests::table9.limits, tests::table9.capacity_ah), a123(tests::a123_26650.limits, 2.58),
    of_nmc(nmc, 50), of_lto(lto, 30), of_lfp_200ah(lfp_200ah, 200);
static_assert(table9.wider_and_slower());
static_assert(a123.wider_and_slower());
static_assert(of_nmc.wider_and_slower());
static_assert(of_lto.wider_and_slower());
static_assert(of_lfp_200ah.wider_and_slower());

TEST(SecondLineOfTheFrontEnd, FollowsTheVoltagesOfTheCell) {
  // 3.65 + 0.165 + 0.02 V in steps of 50.6 mV: 75.8; 0.75 * 2.0 - 0.02 V: 29.2
  EXPECT_EQ(table9.at(0x9278), 76U);
  EXPECT_EQ(table9.at(0x9275), 29U);
  // 4.2 + 0.12 + 0.02 V: 85.8; 0.75 * 3.0 - 0.02 V: 44.1
  EXPECT_EQ(of_nmc.at(0x9278), 86U);
  EXPECT_EQ(of_nmc.at(0x9275), 44U);
  // 2.8 + 0.13 + 0.02 V: 58.3; 0.75 * 1.5 - 0.02 V: 21.8
  EXPECT_EQ(of_lto.at(0x9278), 59U);
  EXPECT_EQ(of_lto.at(0x9275), 21U);
  for (const Chip* chip : {&table9, &of_nmc, &of_lto}) {
    EXPECT_NEAR(chip->line.overvoltage_s, 1.0, 0.004) << "0.8 s more than 0.2 s";
    EXPECT_NEAR(chip->line.undervoltage_s, 1.0, 0.004);
  }
}

TEST(SecondLineOfTheFrontEnd, FollowsTheCurrentsOfTheCell) {
  // 6 A: short circuit at 30 A; 36 A and 45 A are 3.6 and 4.5 mV in steps of 2 mV; 600 A of the inrush are 60 mV
  EXPECT_EQ(table9.at(0x9282), 2U);
  EXPECT_EQ(table9.at(0x9284), 3U);
  EXPECT_EQ(table9.at(0x9286), 3U);
  EXPECT_EQ(table9.at(0x9261), 0xFCU) << "all of them";
  EXPECT_EQ(hal::bq76952::current_step_ua(table9.board), 10'000);
  // 200 A: 1,000 A; 1,200 A are 120 mV, beyond the 62 steps of OCC; 1,500 A are 150 mV; 2,000 A are 200 mV
  EXPECT_EQ(of_lfp_200ah.at(0x9282), 60U);
  EXPECT_EQ(of_lfp_200ah.at(0x9280), 60U);
  EXPECT_EQ(of_lfp_200ah.at(0x9284), 75U);
  EXPECT_EQ(of_lfp_200ah.at(0x9286), 9U);
  EXPECT_EQ(hal::bq76952::current_step_ua(of_lfp_200ah.board), 100'000);
  EXPECT_DOUBLE_EQ(hal::bq76952::current_end_a(of_lfp_200ah.board), 2'000) << "200 mV at 0.1 mOhm";
  EXPECT_NEAR(of_lfp_200ah.line.overcurrent_s, 0.42, 0.002);
  EXPECT_NEAR(of_lfp_200ah.line.high_overcurrent_s, 0.35, 0.002);
}

/// The table in the README of the driver, which is written by hand.
TEST(SecondLineOfTheFrontEnd, IsThatOfTheReadme) {
  std::ifstream file(BMS_SOURCE_DIR "/hal/bq76952/README.md");
  const std::string page{std::istreambuf_iterator<char>(file), {}};
  const auto has = [&](const char* row, double threshold, double delay) {
    char text[100];
    std::snprintf(text, sizeof text, row, threshold, delay);
    EXPECT_NE(page.find(text), page.npos) << text;
  };
  const SecondLine& line = table9.line;
  has("| COV | DCHG | %.3f V | %.1f s |", line.overvoltage_v, line.overvoltage_s);
  has("| CUV | DDSG | %.3f V | %.1f s |", line.undervoltage_v, line.undervoltage_s);
  has("| OCC | DCHG | %.0f A | %.2f s |", line.charge_overcurrent_a, line.charge_overcurrent_s);
  has("| OCD1 | DDSG | %.0f A | %.2f s |", line.overcurrent_a, line.overcurrent_s);
  has("| OCD2 | DDSG | %.0f A | %.2f s |", line.high_overcurrent_a, line.high_overcurrent_s);
  has("| SCD | both | %.0f A | %.2f ms |", line.short_circuit_a, 0.45);
}

TEST(SecondLineOfTheFrontEnd, AnOvercurrentBeyondTheComparatorIsLeftToTheOthers) {
  model::Limits limits = lfp_200ah;
  limits.charge_current_max_a = limits.discharge_current_max_a = 300;
  const Chip chip(limits, 300);
  // 1,500 A: 1,800 A are 90 steps, OCC ends at 62; 2,250 A are 113 steps, OCD2 ends at 100
  EXPECT_EQ(chip.at(0x9261), 0xACU) << "SCD, OCD1, COV, CUV";
  EXPECT_TRUE(chip.wider_and_slower());
}

TEST(SecondLineOfTheFrontEnd, ABoardWithOtherThresholdsIsNotWiderAndSlower) {
  // What a fixed 3.8 V and 2.0 V for 1 s would be: with this cell the first line opens at 3.815 V and 1.802 V.
  hal::bq76952::Board fixed = table9.board;
  fixed.overvoltage_v = 3.79;
  fixed.undervoltage_v = 2.0;
  const auto settings = hal::bq76952::settings(fixed);
  const SecondLine line = second_line(settings, fixed.shunt_mohm);
  EXPECT_FALSE(overvoltage_is_wider_and_slower(line, table9.rules, period_s));
  EXPECT_FALSE(undervoltage_is_wider_and_slower(line, table9.rules, period_s));
  hal::bq76952::Board fast = table9.board;
  fast.overcurrent_delay_s = 0.2;
  EXPECT_FALSE(overcurrent_is_wider_and_slower(second_line(hal::bq76952::settings(fast), 0.1), table9.rules, period_s));
}

/// This test is compiled for another truck than the forklift board's: bms_board_of_another_truck in
/// tests/CMakeLists.txt.
TEST(BoardDesign, TakesTheTruckFromTheSettingsOfTheBoard) {
  const protection::PackDesign design = board_design(lfp_200ah, 200);
  const protection::ContactorPlan plan = protection::contactor_plan(design);
  EXPECT_EQ(design.cells, 8U);
  EXPECT_EQ(plan.half_time_constant_us, 500'000U);
  EXPECT_EQ(plan.max_closing_gap_uv, 8'000'000) << "400 A through 20 mohm";
  EXPECT_TRUE(possible_truck(design));
  const protection::Rules rules = protection::rules_of(protection::protection_table(design));
  EXPECT_DOUBLE_EQ(front_end_board(design, rules).short_circuit_a, 2'000) << "more than main plus makes";
}

TEST(BoardDesign, RefusesATruckForWhichThePrechargeCannotBeChecked) {
  const protection::PackDesign design = board_design(lfp_200ah, 200);
  protection::PackDesign quick = design, slow = design, open = design, far = design;
  quick.precharge_time_constant_s = 0.1;
  slow.precharge_time_constant_s = 5;
  open.closing_current_max_a = 0;
  far.closing_loop_ohm = 0.04;
  for (const protection::PackDesign& truck : {quick, slow, open, far}) EXPECT_FALSE(possible_truck(truck));
}

TEST(SecondLineOfTheFrontEnd, APackOfFewerCellsHasItsInputs) {
  EXPECT_EQ(Chip(nmc, 50, 8).at(0x9304), 0x807FU);
  EXPECT_EQ(Chip(nmc, 50, 15).at(0x9304), 0xBFFFU);
  EXPECT_EQ(table9.at(0x9304), 0xFFFFU);
}

}  // namespace
}  // namespace bms::firmware
