// bms image cell and bms update as a user calls them: what is signed, and what the tool asks for before it sends.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "files/cell_file.hpp"
#include "files/temporary_folder.hpp"
#include "files/text_file.hpp"
#include "tests/end_to_end/run_tool.hpp"

namespace bms {
namespace {

using ::testing::HasSubstr;

class CellUpdateTool : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_EQ(run_tool("image key --out " + at("product.pem")).exit_code, 0);
    files::CellFile cell = files::read_cell("table9");
    cell.parameters.rc.r0_ohm[3] *= 1.1;
    files::write_file(at("better.toml"), files::cell_text(cell));
    hash_ = fmt::format("{:08x}", files::read_cell(at("better.toml")).hash);
  }
  std::string at(const std::string& name) const { return (folder_.path() / name).string(); }
  ToolRun sign(const std::string& cell, const std::string& built = "table9") const {
    return run_tool("image cell " + cell + " --for " + built + " --key " + at("product.pem") + " --out " +
                    at("cell.bms") + " --board stm32f405_forklift --version 1.0.0 --security-version 1");
  }
  nlohmann::json replay() const {
    return {{"command", "replay"},
            {"board", "stm32f405_forklift"},
            {"cell_hash", "4f0695c1"},
            {"against_cell_hash", hash_},
            {"samples", 36'000},
            {"statement", "State of charge: up to 1.10 % apart."},
            {"faults", nlohmann::json::array()},
            {"cut_off_at_s", {{"before", nullptr}, {"after", nullptr}}}};
  }
  /// A bus that does not exist: whatever is refused before is refused without it.
  ToolRun update(const nlohmann::json& seen, const std::string& more = "") const {
    files::write_file(at("seen.json"), seen.dump());
    return run_tool("update no_such_bus " + at("cell.bms") + " --replayed " + at("seen.json") + more);
  }

  files::TemporaryFolder folder_;
  std::string hash_;
};

TEST_F(CellUpdateTool, SignsTheConstantsForBothSlots) {
  const ToolRun run = sign(at("better.toml"));
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("cell constants 1.0.0 for stm32f405_forklift, slot B"));
  const ToolRun shown = run_tool("image show " + at("cell.bms") + " --json -");
  const auto images = nlohmann::json::parse(shown.out)["images"];
  ASSERT_EQ(images.size(), 2U);
  EXPECT_EQ(images[0]["kind"], "cell");
  EXPECT_EQ(images[1]["cell_hash"], hash_);
  EXPECT_EQ(images[1]["built_for_cell_hash"], "4f0695c1");
  EXPECT_EQ(images[1]["oldest_loader"], "0.2.0");
  EXPECT_EQ(run_tool("image verify " + at("cell.bms") + " --key " + at("product.pem.pub")).exit_code, 0);
}

TEST_F(CellUpdateTool, SignsNothingThatTheFirmwareProtectsBy) {
  files::CellFile cell = files::read_cell("table9");
  cell.parameters.limits.charge_current_max_a = 12;
  files::write_file(at("wider.toml"), files::cell_text(cell));
  const ToolRun run = sign(at("wider.toml"));
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_THAT(run.err, HasSubstr("limits.charge_current_max_a is 12, of the firmware's cell file 6"));
  EXPECT_FALSE(std::filesystem::exists(at("cell.bms")));
  EXPECT_EQ(sign("a123_26650_extended").exit_code, 2);
}

TEST_F(CellUpdateTool, SendsNothingThatNobodyHasSeenOnALog) {
  ASSERT_EQ(sign(at("better.toml")).exit_code, 0);
  const ToolRun unseen = run_tool("update no_such_bus " + at("cell.bms"));
  EXPECT_EQ(unseen.exit_code, 2);
  EXPECT_THAT(unseen.err, HasSubstr("expected --replayed FILE, of bms replay LOG --board stm32f405_forklift"));
  auto seen = replay();
  seen["against_cell_hash"] = "12345678";
  EXPECT_THAT(update(seen).err, HasSubstr("is a replay of the cell file 12345678 on stm32f405_forklift"));
  seen = replay();
  seen["board"] = "netduinoplus2";
  EXPECT_THAT(update(seen).err, HasSubstr("on netduinoplus2, expected " + hash_));
  seen = replay();
  seen["samples"] = 0;
  EXPECT_EQ(update(seen).exit_code, 2);
  EXPECT_THAT(update({{"command", "diagnose"}}).err, HasSubstr("expected the JSON of bms replay --against"));
  EXPECT_THAT(update("no object").err, HasSubstr("expected the JSON of bms replay --against"));
}

TEST_F(CellUpdateTool, FaultsThatDifferHaveToBeMeant) {
  ASSERT_EQ(sign(at("better.toml")).exit_code, 0);
  auto seen = replay();
  seen["faults"] = {{{"name", "voltage low"}}};
  EXPECT_THAT(update(seen).err, HasSubstr("shows other faults with the new cell file"));
  EXPECT_THAT(update(seen, " --other-faults").err, HasSubstr("no_such_bus")) << "then the bus is opened";
  seen = replay();
  seen["cut_off_at_s"]["after"] = 12.5;
  EXPECT_THAT(update(seen).err, HasSubstr("contactors that open at another time"));
  const ToolRun accepted = update(replay());
  EXPECT_THAT(accepted.err, HasSubstr("no_such_bus"));
  EXPECT_THAT(accepted.out, HasSubstr("up to 1.10 % apart")) << "what was seen is said again";
}

}  // namespace
}  // namespace bms
