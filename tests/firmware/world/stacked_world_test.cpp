// The flashed image of the board stm32f405_80v, with 24 cells at two stacked chips, in the circuit of a truck.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <sstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fmt/format.h>

#include "files/text_file.hpp"
#include "images/firmware_image.hpp"
#include "plant/random.hpp"
#include "tests/firmware/world/cases.hpp"
#include "tests/firmware/world/promise.hpp"
#include "tests/firmware/world/scenarios.hpp"
#include "tests/firmware/world/size_budgets.hpp"

namespace bms::world {
namespace {

using plant::Relay;
using ::testing::IsEmpty;

/// The image whose budget board_budget_test measures.
const Pack& pack() {
  static const Pack built = pack_of(printed_ah, 24);
  return built;
}

double mean_soc(TruckWorld& world) {
  double soc = 0;
  for (std::size_t k = 0; k < world.truck.cell_count(); ++k) soc += world.truck.cells().soc(k);
  return soc / static_cast<double>(world.truck.cell_count());
}

void expect_clean(const TruckWorld& world) {
  EXPECT_EQ(fault_names(world.vehicle.faults_seen()), "none");
  EXPECT_THAT(world.closings_below_v(closing_limit_v), IsEmpty());
  EXPECT_THAT(world.violations(), IsEmpty());
}

void drive_charge_and_open(const Pack& pack) {
  TruckWorld world(pack.image, typical_setup(pack));
  for (const Operating state : {Operating::drive, Operating::charge, Operating::recuperate}) {
    ASSERT_EQ(bring_to(world, pack, state), "");
    EXPECT_EQ(fault_names(world.vehicle.faults_seen()), "none") << name_of(state);
    if (state == Operating::recuperate) break;
    EXPECT_GE(key_off(world), 0) << name_of(state);
  }
  expect_clean(world);
  EXPECT_LT(world.vehicle.longest_sample_ms(), 50) << "BMS_BUDGET_SAMPLE_MS of board.cmake";
  std::printf("longest sample %.1f ms\n", world.vehicle.longest_sample_ms());
  const double begun_ms = world.now_ms();
  world.hold_cell(pack.cells - 1, 3.9);
  EXPECT_GE(world.run_until([&] { return world.isolated(); }, 1e3 * (0.2 + chain_s + contactor_s)), 0);
  EXPECT_GT(world.opened_ms() - begun_ms, 200) << "the delay of the row";
  world.run_ms(300);
  EXPECT_EQ(world.vehicle.first_cause(), 3U) << "cell overvoltage severe";
}

TEST(StackedWorld, DrivesChargesAndOpensForItsHighestCell) { drive_charge_and_open(pack()); }

/// 9 + 8, 13 + 12 and 16 + 16 cells.
class StackedSize : public ::testing::TestWithParam<std::size_t> {};
TEST_P(StackedSize, DrivesChargesAndOpensForItsHighestCell) { drive_charge_and_open(pack_of(truck_ah, GetParam())); }
INSTANTIATE_TEST_SUITE_P(Cells, StackedSize, ::testing::Values(17, 25, 32), ::testing::PrintToStringParamName());

/// The columns of a row of the table in the board's README.
std::array<double, budget_columns> committed_budget(const std::string& pack) {
  const std::string text = files::read_file(BMS_SOURCE_DIR "/boards/stm32f405_80v/README.md"),
                    row = fmt::format("| {} |", pack);
  const auto table = text.find("<!-- figures: sizes -->"), at = text.find(row, table);
  std::array<double, budget_columns> columns{};
  if (table == std::string::npos || at == std::string::npos) return columns;
  std::istringstream line(text.substr(at + row.size(), text.find('\n', at) - at - row.size()));
  for (double& column : columns) {
    char bar = 0;
    line >> column >> bar;
  }
  return columns;
}

/// Compares with the row of the table in the board's README.
void expect_row(const std::string& row, const SizeBudget& budget) {
  const auto now = columns_of(budget), committed = committed_budget(row);
  for (std::size_t k = 0; k < now.size(); ++k) {
    std::printf("%.1f ", now[k]);
    EXPECT_NEAR(now[k], committed[k], 0.05 * now[k] + 0.051)
        << "column " << k + 1 << "; if the change is worth it: build/host/tests/write_figures sizes";
  }
  std::printf("\n");
}

class SizeBudgets : public ::testing::TestWithParam<std::size_t> {};
/// The budgets of board.cmake hold for every size.
TEST_P(SizeBudgets, AreThoseOfTheReadme) {
  const SizeBudget measured = size_budget_of(GetParam());
  expect_row(fmt::format("{} cells", GetParam()), measured);
  const auto budget = [](const std::string& of) {
    return std::stod(
        images::board_setting(GetParam() > 16 ? "stm32f405_80v" : "stm32f405_forklift", "BMS_BUDGET_" + of));
  };
  EXPECT_LE(measured.flash, budget("FLASH"));
  EXPECT_LE(measured.ram, budget("RAM"));
  EXPECT_LE(measured.stack, budget("STACK"));
  EXPECT_LE(measured.longest_sample_ms, budget("SAMPLE_MS"));
}

/// Its flash is above the budget of board.cmake by what the README says.
TEST(GroupBudget, IsThatOfTheReadme) {
  const SizeBudget measured = size_budget_of_group();
  expect_row(group_row, measured);
  const auto budget = [](const std::string& of) {
    return std::stod(images::board_setting("stm32f405_80v", "BMS_BUDGET_" + of));
  };
  constexpr double of_the_group = 8 * 1'024;  // boards/stm32f405_80v/README.md
  EXPECT_LE(measured.flash, budget("FLASH") + of_the_group);
  EXPECT_LE(measured.ram, budget("RAM"));
  EXPECT_LE(measured.stack, budget("STACK"));
  EXPECT_LE(measured.longest_sample_ms, budget("SAMPLE_MS"));
}
INSTANTIATE_TEST_SUITE_P(Cells, SizeBudgets, ::testing::ValuesIn(budget_sizes), ::testing::PrintToStringParamName());

/// Driving, lifting, recuperation and pauses with noise on all readings. BMS_WORLD_MINUTES: another duration than 20.
TEST(StackedWorld, TwentyMinutesOfATruckHaveNoFault) {
  const Pack truck = pack_of(truck_ah, 24);
  TruckWorld world(truck.image, typical_setup(truck));
  world.set_noise(0.0015, 5e-6);
  plant::Random random(11);
  const auto between = [&](double least, double most) { return least + random.uniform() * (most - least); };
  ASSERT_EQ(bring_to(world, truck, Operating::standby), "");
  const double begun_ms = world.now_ms();
  const char* minutes = std::getenv("BMS_WORLD_MINUTES");
  const double end_ms = begun_ms + 60e3 * (minutes == nullptr ? 20 : std::atof(minutes));
  double printed_ms = begun_ms, worst_error = 0;
  int looked = 0, outside = 0;
  while (world.now_ms() < end_ms) {
    if (world.now_ms() - printed_ms > 300e3) {
      printed_ms = world.now_ms();
      std::printf("%.0f s, SOC %.2f %%, true %.2f %%\n", 1e-3 * (printed_ms - begun_ms), world.vehicle.soc_percent(),
                  100 * mean_soc(world));
      std::fflush(stdout);
    }
    const bool recuperates = random.uniform() < 0.25;
    const double most_a = recuperates ? world.vehicle.allowed_charge_a() : world.vehicle.allowed_discharge_a();
    const double a = std::min(truck.limit_a, most_a) * between(0, 0.6);
    set_drive_a(world, recuperates ? 0.5 * a : -a);
    world.run_ms(1e3 * between(0.5, 12));
    ++looked;
    const double error = std::abs(world.vehicle.soc_percent() - 100 * mean_soc(world));
    outside += error > 2 * world.vehicle.soc_sigma_percent() ? 1 : 0;
    worst_error = std::max(worst_error, error);
    ASSERT_TRUE(world.both_mains_closed()) << summary(world);
  }
  expect_clean(world);
  EXPECT_LE(20 * outside, looked) << "the true state of charge is within two published standard deviations";
  std::printf(
      "SOC %.2f %%, true %.2f %%, sigma %.2f %%, worst error %.2f %%, outside of 2 sigma %d of %d; longest sample %.2f "
      "ms\n",
      world.vehicle.soc_percent(), 100 * mean_soc(world), world.vehicle.soc_sigma_percent(), worst_error, outside,
      looked, world.vehicle.longest_sample_ms());
}

/// What happens to the upper half of the image's two chips; the contactors open in the time of the row.
struct HalfFault {
  const char* name;
  void (*begin)(TruckWorld&);
  double within_s;
  unsigned first_cause;  ///< number of the fault's bit plus 1; 0: by the enable signals, before a fault is published
};
constexpr double orderly_s = 0.5 + 5 + chain_s + contactor_s;  ///< row voltage missing, and its orderly stop
const HalfFault half_faults[] = {
    {"IsolatorWithoutSupply", [](TruckWorld& w) { w.isolator_supplied = false; }, 0.1, 0},
    {"UpperHangs", [](TruckWorld& w) { w.upper_chip.hung = true; }, orderly_s, 21},
    {"UpperStale", [](TruckWorld& w) { w.upper_chip.frozen = true; }, orderly_s, 21},
    {"UpperReset", [](TruckWorld& w) { w.upper_chip.reset(); }, 0.1, 0},
    {"LowerHangs", [](TruckWorld& w) { w.chip.hung = true; }, orderly_s, 21},
    {"LowerStale", [](TruckWorld& w) { w.chip.frozen = true; }, orderly_s, 21},
};
class HalfFails : public ::testing::TestWithParam<HalfFault> {};

TEST_P(HalfFails, OpensInTime) {
  TruckWorld world(pack().image, typical_setup(pack()));
  ASSERT_EQ(bring_to(world, pack(), Operating::drive), "");
  ASSERT_EQ(fault_names(world.vehicle.faults_seen()), "none");
  GetParam().begin(world);
  const double ms = world.run_until([&] { return world.isolated(); }, 1e3 * GetParam().within_s);
  EXPECT_GE(ms, 0) << summary(world);
  world.run_ms(1'000);
  EXPECT_FALSE(world.both_mains_closed());
  if (GetParam().first_cause != 0) {
    EXPECT_EQ(world.vehicle.first_cause(), GetParam().first_cause) << summary(world);
  }
  std::printf("isolated after %.0f ms: %s\n", ms, summary(world).c_str());
}
INSTANTIATE_TEST_SUITE_P(StackedWorld, HalfFails, ::testing::ValuesIn(half_faults),
                         [](const auto& info) { return std::string(info.param.name); });

}  // namespace
}  // namespace bms::world
