// Records in flash are a public interface: what version 0.1.0 has stored is read.
#include "tests/firmware/storage/flash_of_0_1_0.hpp"

#include <cstdint>
#include <string>
#include <vector>

#include "tests/firmware/storage/flash_after_0_1_0.hpp"
#include "tests/firmware/storage/persistence_bench.hpp"

namespace bms {
namespace {

std::vector<std::uint8_t> bytes_of(std::string_view hex) {
  std::vector<std::uint8_t> bytes;
  for (std::size_t k = 0; k + 1 < hex.size(); k += 2)
    bytes.push_back(static_cast<std::uint8_t>(std::stoi(std::string(hex.substr(k, 2)), nullptr, 16)));
  return bytes;
}

/// Its life: two settings; 95 min at -6 A, fault 12 after 90 of them, and switched off; a watchdog's reset with
/// processor fault 5; 30 min at 3 A, fault 33, two minutes of rest, and switched off at 1,800,020,000 s of the
/// calendar.
TEST_F(PersistenceTest, ReadsWhatVersion010HasStored) {
  for (std::uint32_t sector = 0; sector < tests::flash_of_0_1_0.size(); ++sector)
    flash.fill(sector, bytes_of(tests::flash_of_0_1_0[sector]));
  constexpr std::uint32_t off_s = 600;
  boot(ResetCause::power_on, 1'800'020'000 + off_s);
  EXPECT_EQ(p.newer_records(), 0U);
  EXPECT_EQ(p.off_s(), off_s);

  EXPECT_EQ(p.charge().pack.soc_ppb, 45 * percent_ppb);  // 60 - 90 * 0.2 + 30 * 0.1, in percent
  EXPECT_EQ(p.charge().pack.soc_sigma_ppb, percent_ppb);
  EXPECT_EQ(p.charge().charged_uah, 1'500'000U);
  EXPECT_EQ(p.charge().discharged_uah, 9'000'000U);
  EXPECT_EQ(p.charge().operating_s, 127U * 60);
  const auto start = p.starting_point();
  ASSERT_TRUE(start);
  EXPECT_NEAR(start->soc_ppb, 45 * percent_ppb, percent_ppb / 100) << "less what ten minutes of self-discharge took";
  EXPECT_GE(start->soc_sigma_ppb, percent_ppb);

  ASSERT_EQ(p.cells().count, 16);
  for (int k = 0; k < 16; ++k) {
    EXPECT_EQ(p.cells().cell[static_cast<std::size_t>(k)].soc, 100 * (k - 8));
    EXPECT_EQ(p.cells().cell[static_cast<std::size_t>(k)].sigma, 50 + k);
  }
  EXPECT_EQ(p.health(), (storage::HealthRecord{930'000, 20'000, 1'210'000, 60'000}));

  EXPECT_EQ(p.events().starts, 3U);
  EXPECT_EQ(p.events().faults, 3U);
  EXPECT_EQ(p.events().last(0).code, 33);
  EXPECT_EQ(p.events().last(0).time_s, 7'500U);
  EXPECT_EQ(p.events().last(1).code, 0xFF00 + 5);
  EXPECT_EQ(p.events().last(2).code, 12);
  EXPECT_EQ(p.events().last(2).time_s, 5'400U);
  EXPECT_EQ(p.settings().get(1), 1'800);
  EXPECT_EQ(p.settings().get(7), -42);

  drive(30, -6'000'000, -2'000'000);  // and goes on from there
  boot(ResetCause::power_on);
  EXPECT_EQ(p.charge().operating_s, 157U * 60);
  EXPECT_EQ(p.events().faults, 3U);
}

/// A battery went back to 0.1.0 for half an hour. 0.2.0: two settings, an action of a session, 40 min at -6 A from 70 %
/// on, fault 12. 0.1.0: 30 min at 6 A and -6 A in turn, fault 33, another setting. Charge, counters and settings go on
/// through both; what 0.1.0 does not know is there afterwards. Its faults are the newest; it has begun a list of its
/// own.
TEST_F(PersistenceTest, AStayOfVersion010LosesNeitherChargeNorSettingsNorActions) {
  for (std::uint32_t sector = 0; sector < tests::flash_after_0_1_0.size(); ++sector)
    flash.fill(sector, bytes_of(tests::flash_after_0_1_0[sector]));
  boot(ResetCause::power_on);
  EXPECT_EQ(p.newer_records(), 0U);
  EXPECT_EQ(p.charge().pack.soc_ppb, 62 * percent_ppb);
  EXPECT_EQ(p.charge().charged_uah, 1'500'000U);
  EXPECT_EQ(p.charge().discharged_uah, 5'500'000U);
  EXPECT_EQ(p.charge().operating_s, 70U * 60);
  ASSERT_EQ(p.cells().count, 16);
  EXPECT_EQ(p.cells().cell[15].soc, 700);
  EXPECT_EQ(p.health(), (storage::HealthRecord{930'000, 20'000, 1'210'000, 60'000}));
  EXPECT_EQ(p.settings().get(1), 1'800);
  EXPECT_EQ(p.settings().get(7), -42);
  EXPECT_EQ(p.settings().get(9), 77);
  EXPECT_EQ(p.actions().last(0).code, 3);
  EXPECT_EQ(p.actions().last(0).operator_number, 42);
  EXPECT_EQ(p.events().last(0).code, 33);
}

}  // namespace
}  // namespace bms
