#include "protection/table.hpp"

#include <fstream>
#include <iterator>
#include <regex>
#include <string>

#include <gtest/gtest.h>

#include "protection/contactors.hpp"
#include "protection/table_text.hpp"
#include "tests/cells.hpp"
#include "tests/firmware/protection/expected_rows.hpp"

namespace bms::protection {
namespace {

constexpr Table table = protection_table(forklift);
static_assert(consistent(rules_of(table)));
static_assert(std::size(expected_rows) == fault_count);

std::string text_of_file(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

TEST(ProtectionTable, EqualsTheValuesCalculatedByHandForThePapersCell) {
  for (std::size_t k = 0; k < fault_count; ++k) {
    const ExpectedRow& e = expected_rows[k];
    const Rule& r = table[k].rule;
    EXPECT_STREQ(name_of(r.fault), e.name);
    EXPECT_EQ(r.sense == Sense::above ? '>' : '<', e.beyond) << e.name;
    EXPECT_EQ(r.threshold, e.threshold) << e.name;
    EXPECT_EQ(r.delay_us, 1'000U * static_cast<unsigned>(e.delay_ms)) << e.name;
    EXPECT_EQ(r.release, e.release) << e.name;
    EXPECT_EQ(r.recover_us, 1'000U * static_cast<unsigned>(e.recover_ms)) << e.name;
    constexpr char recovery_letters[] = {'a', 'c', 's'};  // in the order of Recovery
    EXPECT_EQ(recovery_letters[static_cast<std::size_t>(r.recovery)], e.recovery) << e.name;
    EXPECT_STREQ(text_of(r.reaction), e.reaction) << e.name;
    EXPECT_GT(std::string(table[k].why).size(), 5U) << e.name << " has no reason for its delay";
  }
}

TEST(ProtectionTable, LimitsAreThoseOfTheShippedCellFile) {
  const model::Limits l = tests::table9.limits;
  EXPECT_EQ(l.voltage_min_v, table9_limits.voltage_min_v);
  EXPECT_EQ(l.voltage_max_v, table9_limits.voltage_max_v);
  EXPECT_EQ(l.charge_current_max_a, table9_limits.charge_current_max_a);
  EXPECT_EQ(l.discharge_current_max_a, table9_limits.discharge_current_max_a);
  EXPECT_EQ(l.temperature_min_c, table9_limits.temperature_min_c);
  EXPECT_EQ(l.temperature_max_c, table9_limits.temperature_max_c);
}

TEST(ProtectionTable, IsConsistentForAnyCellAndNumberOfCells) {
  for (const int cells : {1, 4, 16, 24}) {
    for (const model::Limits& l : {model::Limits{2.5, 4.2, 1.5, 3, -20, 60}, model::Limits{1.5, 2.8, 300, 300, -30, 55},
                                   model::Limits{2.0, 3.6, 2.5, 50, 5, 45}}) {
      PackDesign d = forklift;
      d.limits = l;
      d.cells = static_cast<std::uint8_t>(cells);
      EXPECT_TRUE(consistent(rules_of(protection_table(d)))) << cells << " cells up to " << l.voltage_max_v << " V";
    }
  }
}

TEST(ProtectionTable, IsConsistentAndAContradictionIsDetected) {
  for (std::size_t k = 0; k < fault_count; ++k) {
    Rules rules = rules_of(table);
    ASSERT_TRUE(consistent(rules));
    rules[k].release = rules[k].threshold + (rules[k].sense == Sense::above ? 1 : -1);
    EXPECT_FALSE(consistent(rules)) << name_of(rules[k].fault) << " would be released before it is raised";
    rules[k].release = rules[k].threshold;
    EXPECT_TRUE(consistent(rules)) << name_of(rules[k].fault);
    rules[k].fault = static_cast<Fault>((k + 1) % fault_count);
    EXPECT_FALSE(consistent(rules)) << name_of(table[k].rule.fault) << " would raise the bit of another fault";
  }
}

TEST(ProtectionTable, GivesTheFaultsOfEachReactionAndRecovery) {
  const Rules rules = rules_of(table);
  FaultSet by_reaction = 0, by_recovery = 0;
  for (const Reaction r : {Reaction::warn, Reaction::derate, Reaction::forbid_charge, Reaction::forbid_discharge,
                           Reaction::open, Reaction::open_now}) {
    for (std::size_t k = 0; k < fault_count; ++k)
      EXPECT_EQ((faults_with(rules, r) >> k & 1) != 0, std::string(expected_rows[k].reaction) == text_of(r))
          << expected_rows[k].name;
    by_reaction |= faults_with(rules, r);
  }
  for (const Recovery r : {Recovery::automatic, Recovery::on_clear, Recovery::service})
    by_recovery |= faults_with(rules, r);
  EXPECT_EQ(by_reaction, 0x3'FFFF'FFFF'FFFFU) << "50 rows";
  EXPECT_EQ(by_recovery, 0x3'FFFF'FFFF'FFFFU);
}

/// Rounding is symmetric for both signs.
TEST(IntegersOfAPack, AreRounded) {
  for (const double sign : {1.0, -1.0}) {
    const int s = static_cast<int>(sign);
    EXPECT_EQ(in_micro(sign * 1.234'567'4), s * 1'234'567);
    EXPECT_EQ(in_micro(sign * 1.234'567'6), s * 1'234'568);
    EXPECT_EQ(in_centi(sign * 12.344), s * 1'234);
    EXPECT_EQ(in_centi(sign * 12.346), s * 1'235);
    EXPECT_EQ(in_micro(0), 0);
  }
  EXPECT_EQ(in_us(0.000'001'4), 1U);
  EXPECT_EQ(in_us(0.000'001'6), 2U);
}

TEST(ProtectionTable, OfAnotherPackUsesItsCellsTheirNumberAndItsSamplePeriod) {
  PackDesign d = forklift;
  d.limits = {.voltage_min_v = 2.5,
              .voltage_max_v = 4.2,
              .charge_current_max_a = 1.5,
              .discharge_current_max_a = 3,
              .temperature_min_c = 5,
              .temperature_max_c = 45};
  d.cells = 4;
  d.sample_period_s = 0.25;
  const auto rule = [&](Fault f) { return protection_table(d)[static_cast<std::size_t>(f)].rule; };
  EXPECT_EQ(rule(Fault::pack_overvoltage).threshold, 4 * 4'234'000) << "4.2 V and a fiftieth of 1.7 V";
  EXPECT_EQ(rule(Fault::pack_undervoltage).threshold, 4 * 2'602'000);
  EXPECT_EQ(rule(Fault::sum_mismatch).threshold, 4 * 51'000);
  EXPECT_EQ(rule(Fault::short_circuit).threshold, 15'000'000) << "from the larger limit";
  EXPECT_EQ(rule(Fault::short_circuit).release, 3'000'000);
  EXPECT_EQ(rule(Fault::charge_undertemperature).threshold, 500) << "its own minimum temperature is above 0 degrees C";
  EXPECT_EQ(rule(Fault::charge_undertemperature).release, 700);
  EXPECT_EQ(rule(Fault::samples_missing).threshold, 1'250'000);
  EXPECT_EQ(rule(Fault::samples_missing).release, 500'000);
  d.limits.charge_current_max_a = 4;
  EXPECT_EQ(rule(Fault::short_circuit).threshold, 20'000'000);
}

TEST(ProtectionTable, EqualsTheTableInTheReadme) {
  const std::string readme = text_of_file(BMS_SOURCE_DIR "/firmware/protection/README.md");
  EXPECT_NE(readme.find(markdown(table)), std::string::npos)
      << "run ./bms figures, or build/host/tests/write_protection_figures";
}

/// Texts of VAL_ <id> <signal> in the DBC file, by value.
std::map<int, std::string> values_in_dbc(const std::string& dbc, const std::string& of) {
  const std::size_t begin = dbc.find("\nVAL_ " + of + " "), end = dbc.find(";", begin);
  std::map<int, std::string> values;
  if (begin == std::string::npos) return values;
  const std::string line = dbc.substr(begin + of.size() + 6, end - begin - of.size() - 6);
  static const std::regex pair("([0-9]+) \"([^\"]*)\"");
  for (std::sregex_iterator it(line.begin(), line.end(), pair), none; it != none; ++it)
    values[std::stoi((*it)[1])] = (*it)[2];
  return values;
}

TEST(ProtectionTable, HasTheNamesOfTheDbcFile) {
  const std::string dbc = text_of_file(BMS_SOURCE_DIR "/firmware/can/greybox_bms.dbc");
  const auto causes = values_in_dbc(dbc, "406 FirstCause");
  ASSERT_EQ(causes.size(), fault_count + 2);
  EXPECT_EQ(causes.at(0), "none");
  for (std::size_t k = 0; k < fault_count; ++k) {
    EXPECT_EQ(causes.at(static_cast<int>(k) + 1), fault_names[k]);
    const std::string signal =
        std::string(" SG_ ") + expected_rows[k].signal + " : " + std::to_string(16 + k % 32) + "|1@1+";
    const std::size_t message = dbc.find(k < 32 ? "BO_ 406 Faults: 8 Bms\n" : "BO_ 418 MoreFaults: 8 Bms\n");
    ASSERT_NE(message, std::string::npos);
    EXPECT_LT(dbc.find(signal), dbc.find("\n\n", message)) << signal;
    EXPECT_GT(dbc.find(signal), message) << signal;
  }
  const auto states = values_in_dbc(dbc, "407 State");
  ASSERT_EQ(states.size(), contactor_state_count + 1);
  for (std::size_t k = 0; k < contactor_state_count; ++k)
    EXPECT_EQ(states.at(static_cast<int>(k)), contactor_state_names[k]);
}

}  // namespace
}  // namespace bms::protection
