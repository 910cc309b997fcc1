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
      : pack{.limits = limits,
             .capacity_ah = capacity_ah,
             .cells = cells,
             .temperatures = 4,
             .sample_period_s = period_s,
             .current_range_a = 2'000},
        rules(protection::rules_of(protection::protection_table(pack))),
        board(front_end_board(pack, rules)),
        settings(hal::bq76952::settings(board)),
        line(second_line(settings, board.shunt_mohm)) {}

  constexpr bool wider_and_slower() const {
    return overvoltage_is_wider_and_slower(line, rules, period_s) &&
           undervoltage_is_wider_and_slower(line, rules, period_s) &&
           overcurrent_is_wider_and_slower(line, rules, pack) &&
           charge_overcurrent_is_above_rated_pulses(line, rules, pack) && sustained_is_wider_and_slower(line, pack) &&
           temperatures_are_wider_and_slower(line, rules) && line.all_on && host_silence_is_slower(line, rules) &&
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

constexpr model::Limits lfp(double current_a) {
  model::Limits limits = lfp_200ah;
  limits.charge_current_max_a = limits.discharge_current_max_a = current_a;
  return limits;
}

constexpr Chip table9(tests::table9.limits, tests::table9.capacity_ah), a123(tests::a123_26650.limits, 2.58),
    of_nmc(nmc, 50), of_lto(lto, 30), of_lfp_200ah(lfp_200ah, 200);
static_assert(table9.wider_and_slower());
static_assert(a123.wider_and_slower());
static_assert(of_nmc.wider_and_slower());
static_assert(of_lto.wider_and_slower());
static_assert(of_lfp_200ah.wider_and_slower());
static_assert(Chip(lfp(206), 206).wider_and_slower() && Chip(lfp(210), 210).wider_and_slower());
static_assert(Chip(lfp(280), 280).wider_and_slower() && Chip(lfp(400), 400).wider_and_slower());

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

/// The table in the README of the driver, for packs of LFP cells whose limit is 1C.
std::string table_of_packs() {
  const std::array packs{Chip(tests::table9.limits, tests::table9.capacity_ah), Chip(lfp(100), 100),
                         Chip(lfp(200), 200), Chip(lfp(280), 280), Chip(lfp(400), 400)};
  std::string text;
  const auto row = [&](const char* start, const char* number, auto&& value, const char* end) {
    text += start;
    for (const Chip& chip : packs) {
      char cell[30];
      std::snprintf(cell, sizeof cell, number, value(chip.line));
      text += cell;
    }
    text += end;
  };
  using L = SecondLine;
  row(
      "| COV | DCHG |", " %.3f V |", [](const L& l) { return l.overvoltage_v; }, " 1.0 s |\n");
  row(
      "| CUV | DDSG |", " %.3f V |", [](const L& l) { return l.undervoltage_v; }, " 1.0 s |\n");
  row(
      "| OCC | DCHG |", " %.0f A |", [](const L& l) { return l.charge_overcurrent_a; }, " 0.42 s |\n");
  row(
      "| OCD1 | DDSG |", " %.0f A |", [](const L& l) { return l.overcurrent_a; }, " 0.42 s |\n");
  row(
      "| OCD2 | DDSG |", " %.0f A |", [](const L& l) { return l.high_overcurrent_a; }, " 0.35 s |\n");
  row(
      "| OCD3 | DDSG |", " %.0f A |", [](const L& l) { return l.sustained_a; }, " 20 s |\n");
  row(
      "| SCD | both |", " %.0f A |", [](const L& l) { return l.short_circuit_a; }, " 0.45 ms |\n");
  row(
      "| OTC | DCHG |", " %d °C |", [](const L& l) { return l.charge_hot_c; }, " 20 s |\n");
  row(
      "| OTD | DDSG |", " %d °C |", [](const L& l) { return l.discharge_hot_c; }, " 20 s |\n");
  row(
      "| UTC | DCHG |", " %d °C |", [](const L& l) { return l.charge_cold_c; }, " 20 s |\n");
  return text;
}

TEST(SecondLineOfTheFrontEnd, IsThatOfTheReadme) {
  std::ifstream file(BMS_SOURCE_DIR "/hal/bq76952/README.md");
  const std::string page{std::istreambuf_iterator<char>(file), {}}, table = table_of_packs();
  EXPECT_NE(page.find(table), page.npos) << "expected there:\n" << table;
  for (const Chip* chip : {&table9, &of_lfp_200ah}) {
    EXPECT_NEAR(chip->line.overvoltage_s, 1.0, 0.004);
    EXPECT_NEAR(chip->line.charge_overcurrent_s, 0.42, 0.002);
    EXPECT_NEAR(chip->line.high_overcurrent_s, 0.35, 0.002);
    EXPECT_DOUBLE_EQ(chip->line.sustained_s, 20);
    EXPECT_DOUBLE_EQ(chip->line.temperature_s, 20);
  }
}

/// By hand: five times the limit, and not more than 1,886 A; 2 mV a step at 0.1 mOhm, OCC ends at 62, OCD at 100 steps.
TEST(SecondLineOfTheFrontEnd, IsOnForEveryPackAndEndsWithItsComparators) {
  const Chip of_280a(lfp(280), 280), of_400a(lfp(400), 400);
  for (const Chip* chip : {&table9, &of_lfp_200ah, &of_280a, &of_400a}) {
    EXPECT_EQ(chip->at(0x9261), 0xFCU) << "SCD, OCD2, OCD1, OCC, COV, CUV";
    EXPECT_EQ(chip->at(0x9262), 0x31U) << "OTD, OTC, UTC";
    EXPECT_EQ(chip->at(0x9263), 0xC2U) << "OCD3, SCDL, HWDF";
  }
  EXPECT_DOUBLE_EQ(of_280a.line.charge_overcurrent_a, 1'240) << "4.4 times the limit";
  EXPECT_DOUBLE_EQ(of_280a.line.overcurrent_a, 1'680);
  EXPECT_DOUBLE_EQ(of_280a.line.high_overcurrent_a, 2'000);
  EXPECT_DOUBLE_EQ(of_280a.line.sustained_a, 560);
  EXPECT_DOUBLE_EQ(of_400a.line.charge_overcurrent_a, 1'240) << "3.1 times the limit";
  EXPECT_DOUBLE_EQ(of_400a.line.overcurrent_a, 2'000);
  EXPECT_DOUBLE_EQ(of_400a.line.sustained_a, 800);
  EXPECT_EQ(of_280a.at(0x928A), 0x10000U - 5'600U) << "in steps of 100 mA";
  EXPECT_EQ(table9.at(0x928A), 0x10000U - 1'200U) << "in steps of 10 mA";
}

TEST(SecondLineOfTheFrontEnd, FollowsTheTemperaturesOfTheCell) {
  // charging up to 45, discharging up to 60 degrees C, charging from 0 on
  EXPECT_EQ(table9.line.charge_hot_c, 50);
  EXPECT_EQ(table9.line.discharge_hot_c, 65);
  EXPECT_EQ(table9.line.charge_cold_c, -5);
  EXPECT_EQ(table9.at(0x92A6), 0xFBU);
  EXPECT_EQ(table9.at(0x92A8), 0xFEU) << "ends at -2 degrees C";
}

/// With 0.1 mOhm the comparator of a pack of 420 A would open at less than three times its limit.
TEST(SecondLineOfTheFrontEnd, APackForWhichAProtectionWouldBeTooNarrowOrOffDoesNotCompile) {
  EXPECT_FALSE(Chip(lfp(420), 420).wider_and_slower());
  for (const int enabled : {0x9261, 0x9262, 0x9263, 0x9265, 0x9266, 0x9267, 0x9269, 0x926A, 0x926B}) {
    auto settings = table9.settings;
    for (auto& s : settings) {
      if (s.address == enabled) s.value = 0;
    }
    EXPECT_FALSE(second_line(settings, 0.1).all_on) << std::hex << enabled;
  }
  hal::bq76952::Board board = table9.board;
  board.sustained_delay_s = 10;
  const auto fast = hal::bq76952::settings(board);
  EXPECT_FALSE(sustained_is_wider_and_slower(second_line(fast, 0.1), table9.pack));
  board = table9.board;
  board.charge_hot_c = 46;
  const auto narrow = hal::bq76952::settings(board);
  EXPECT_FALSE(temperatures_are_wider_and_slower(second_line(narrow, 0.1), table9.rules));
}

/// Whatever a cell file rates, the chip's threshold stays, its delay is at most 36 s, and the image compiles.
TEST(SecondLineOfTheFrontEnd, LeavesRatedPulsesToTheFirstLineWithTheSameThreshold) {
  int waits = 0, cases = 0;
  for (const double limit_a : {6.0, 70.3, 100.0, 206.1, 280.0, 400.0}) {
    const Chip without(lfp(limit_a), limit_a);
    for (double for_30s = 1; for_30s < 6; for_30s += 0.003) {
      for (const double more : {1.0, 1.01, 3.0}) {
        Chip chip = without;
        chip.pack.pulses.discharge = {more * for_30s * limit_a, cases % 5 == 0 ? 0 : for_30s * limit_a};
        if (chip.pack.pulses.discharge.for_10s_a > model::accepted::current_a.high) continue;
        chip.board = front_end_board(chip.pack, chip.rules);
        chip.settings = hal::bq76952::settings(chip.board);
        chip.line = second_line(chip.settings, chip.board.shunt_mohm);
        EXPECT_EQ(chip.line.sustained_a, without.line.sustained_a);
        EXPECT_LE(chip.line.sustained_s, 36);
        EXPECT_TRUE(chip.wider_and_slower()) << limit_a << " A, " << for_30s << " for 30 s, times " << more;
        waits += chip.line.sustained_s > 20 ? 1 : 0;
        ++cases;
      }
    }
  }
  EXPECT_GT(waits, cases / 4);
  Chip fast = table9;
  fast.pack.pulses.discharge = {18, 12};
  EXPECT_FALSE(fast.wider_and_slower()) << "12 A for 20 s, and the first line allows 30 s";
}

/// At 0.1 mOhm its comparator ends at 1,240 A: 4.4 times 280 A, but 3.1 times 400 A.
TEST(SecondLineOfTheFrontEnd, AChargePulseIsRatedBelowTheChipsOvercurrentOrTheImageDoesNotCompile) {
  const auto fits = [](double limit_a, model::PulseRating charge) {
    Chip chip(lfp(limit_a), limit_a);
    chip.pack.pulses.charge = charge;
    EXPECT_TRUE(overcurrent_is_wider_and_slower(chip.line, chip.rules, chip.pack)) << "the shunt is not the reason";
    EXPECT_EQ(charge_overcurrent_is_above_rated_pulses(chip.line, chip.rules, chip.pack), chip.wider_and_slower());
    return chip.wider_and_slower();
  };
  EXPECT_TRUE(fits(400, {0, 0}));
  EXPECT_TRUE(fits(400, {1'180, 800}));
  EXPECT_FALSE(fits(400, {1'182, 800})) << "1,241 A with the error of the sensor";
  EXPECT_FALSE(fits(400, {0, 1'400}));
  EXPECT_TRUE(fits(280, {1'180, 0}));
  EXPECT_FALSE(fits(280, {1'300, 0}));
  EXPECT_TRUE(fits(100, {480, 300}));
  EXPECT_TRUE(fits(100, {1'000, 300})) << "above short circuit the first line opens, too";
}

/// What is off stands in the safety file by its name.
TEST(SecondLineOfTheFrontEnd, WhatIsOffIsNamedInTheSafetyFile) {
  struct Protection {
    const char* name;
    std::uint16_t enabled;
    std::uint32_t bit;
  };
  // SLUUBY2B and SLUUBY1B, 13.3.3
  constexpr Protection all[] = {
      {"CUV", 0x9261, 4},     {"COV", 0x9261, 8},     {"OCC", 0x9261, 0x10}, {"OCD1", 0x9261, 0x20},
      {"OCD2", 0x9261, 0x40}, {"SCD", 0x9261, 0x80},  {"UTC", 0x9262, 1},    {"UTD", 0x9262, 2},
      {"UTINT", 0x9262, 4},   {"OTC", 0x9262, 0x10},  {"OTD", 0x9262, 0x20}, {"OTINT", 0x9262, 0x40},
      {"OTF", 0x9262, 0x80},  {"HWDF", 0x9263, 2},    {"PTO", 0x9263, 4},    {"COVL", 0x9263, 0x10},
      {"OCDL", 0x9263, 0x20}, {"SCDL", 0x9263, 0x40}, {"OCD3", 0x9263, 0x80}};
  std::ifstream file(BMS_SOURCE_DIR "/docs/safety/assumptions.md");
  std::string line, limit;
  while (std::getline(file, line)) {
    if (line.rfind("| L-24 |", 0) == 0) limit = line;
  }
  int off = 0;
  for (const Protection& p : all) {
    const bool on = (table9.at(p.enabled) & p.bit) != 0;
    off += on ? 0 : 1;
    EXPECT_EQ(limit.find("`" + std::string(p.name) + "`") == limit.npos, on) << p.name;
  }
  EXPECT_EQ(off, 7);
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
  EXPECT_FALSE(
      overcurrent_is_wider_and_slower(second_line(hal::bq76952::settings(fast), 0.1), table9.rules, table9.pack));
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
