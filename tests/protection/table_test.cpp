#include "protection/table.hpp"

#include <iterator>
#include <regex>
#include <string>

#include <gtest/gtest.h>

#include "host_sim/cell_file.hpp"
#include "host_sim/text_file.hpp"
#include "protection/contactors.hpp"
#include "protection/table_text.hpp"
#include "tests/protection/expected_rows.hpp"

namespace bms::protection {
namespace {

constexpr Table table = protection_table(forklift);
static_assert(consistent(rules_of(table)));
static_assert(std::size(expected_rows) == fault_count);

TEST(ProtectionTable, SaysWhatWasReckonedByHandForThePapersCell) {
  for (std::size_t k = 0; k < fault_count; ++k) {
    const ExpectedRow& e = expected_rows[k];
    const Rule& r = table[k].rule;
    EXPECT_STREQ(name_of(r.fault), e.name);
    EXPECT_EQ(r.sense == Sense::above ? '>' : '<', e.beyond) << e.name;
    EXPECT_EQ(r.threshold, e.threshold) << e.name;
    EXPECT_EQ(r.delay_us, 1'000U * static_cast<unsigned>(e.delay_ms)) << e.name;
    EXPECT_EQ(r.release, e.release) << e.name;
    EXPECT_EQ(r.recover_us, 1'000U * static_cast<unsigned>(e.recover_ms)) << e.name;
    EXPECT_EQ(r.recovery == Recovery::automatic ? 'a' : r.recovery == Recovery::on_clear ? 'c' : 's', e.recovery) << e.name;
    EXPECT_STREQ(words(r.reaction), e.reaction) << e.name;
    EXPECT_GT(std::string(table[k].why).size(), 5U) << e.name << " has no reason for its delay";
  }
}

TEST(ProtectionTable, LimitsAreThoseOfTheShippedCellFile) {
  const model::Limits l = read_cell("table9").parameters.limits;
  EXPECT_EQ(l.voltage_min_v, table9_limits.voltage_min_v);
  EXPECT_EQ(l.voltage_max_v, table9_limits.voltage_max_v);
  EXPECT_EQ(l.charge_current_max_a, table9_limits.charge_current_max_a);
  EXPECT_EQ(l.discharge_current_max_a, table9_limits.discharge_current_max_a);
  EXPECT_EQ(l.temperature_min_c, table9_limits.temperature_min_c);
  EXPECT_EQ(l.temperature_max_c, table9_limits.temperature_max_c);
}

TEST(ProtectionTable, IsConsistentForAnyCellAndNumberOfCells) {
  for (const int cells : {1, 4, 16, 24}) {
    for (const model::Limits& l : {model::Limits{2.5, 4.2, 1.5, 3, -20, 60}, model::Limits{1.5, 2.8, 300, 300, -30, 55}, model::Limits{2.0, 3.6, 2.5, 50, 5, 45}}) {
      PackDesign d = forklift;
      d.limits = l;
      d.cells = static_cast<std::uint8_t>(cells);
      EXPECT_TRUE(consistent(rules_of(protection_table(d)))) << cells << " cells up to " << l.voltage_max_v << " V";
    }
  }
}

TEST(ProtectionTable, IsTheOneInTheReadme) {
  const std::string readme = read_file(BMS_SOURCE_DIR "/protection/README.md");
  EXPECT_NE(readme.find(markdown(table)), std::string::npos) << "run ./bms figures, or build/host/tests/write_protection_figures";
}

/// The texts of VAL_ <id> <signal> in the DBC file.
std::map<int, std::string> values_in_dbc(const std::string& dbc, const std::string& of) {
  const std::size_t begin = dbc.find("\nVAL_ " + of + " "), end = dbc.find(";", begin);
  std::map<int, std::string> values;
  if (begin == std::string::npos) return values;
  const std::string line = dbc.substr(begin + of.size() + 6, end - begin - of.size() - 6);
  static const std::regex pair("([0-9]+) \"([^\"]*)\"");
  for (std::sregex_iterator it(line.begin(), line.end(), pair), none; it != none; ++it) values[std::stoi((*it)[1])] = (*it)[2];
  return values;
}

TEST(ProtectionTable, HasTheNamesOfTheBus) {
  const std::string dbc = read_file(BMS_SOURCE_DIR "/can/greybox_bms.dbc");
  const auto causes = values_in_dbc(dbc, "406 FirstCause");
  ASSERT_EQ(causes.size(), fault_count + 2);
  EXPECT_EQ(causes.at(0), "none");
  for (std::size_t k = 0; k < fault_count; ++k) {
    EXPECT_EQ(causes.at(static_cast<int>(k) + 1), fault_names[k]);
    const std::string signal = std::string(" SG_ ") + expected_rows[k].signal + " : " + std::to_string(16 + k) + "|1@1+";
    EXPECT_NE(dbc.find(signal), std::string::npos) << signal;
  }
  const auto states = values_in_dbc(dbc, "407 State");
  ASSERT_EQ(states.size(), contactor_state_count + 1);
  for (std::size_t k = 0; k < contactor_state_count; ++k) EXPECT_EQ(states.at(static_cast<int>(k)), contactor_state_names[k]);
}

}  // namespace
}  // namespace bms::protection
