// Whole updates in the emulator: the real loader, real images in both slots, and bms update on a pseudo-terminal.
#include <gtest/gtest.h>

#include <map>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "boot/flash_map.hpp"
#include "boot/key_table.hpp"
#include "boot/refusal.hpp"
#include "files/cell_file.hpp"
#include "files/text_file.hpp"
#include "images/child_process.hpp"
#include "images/firmware_image.hpp"
#include "tests/firmware/boot/emulated_battery.hpp"

namespace bms::boot {
namespace {

namespace fs = std::filesystem;

fs::path image_of(images::Image which) {
  return images::firmware_image("netduinoplus2", files::read_cell("table9"), which);
}

/// What a depot has: keys, a loader with the public one, and releases. Made once.
class Depot {
 public:
  static Depot& get() {
    static Depot depot;
    return depot;
  }
  fs::path loader, product, other;
  fs::path release(const std::string& version, unsigned security = 1, const fs::path& key = {},
                   const std::string& board = "netduinoplus2") {
    const auto file = folder_.path() / fmt::format("{}-{}-{}-{}.bms", version, security, key.stem().string(), board);
    if (!fs::exists(file))
      images::output_of({BMS_TOOL, "image", "sign", image_of(images::Image::slot_a), image_of(images::Image::slot_b),
                         "--key", key.empty() ? product : key, "--board", board, "--version", version,
                         "--security-version", std::to_string(security), "--out", file});
    return file;
  }

 private:
  Depot() {
    product = folder_.path() / "product.pem";
    other = folder_.path() / "other.pem";
    for (const auto& key : {product, other}) images::output_of({BMS_TOOL, "image", "key", "--out", key});
    loader = folder_.path() / "loader.elf";
    images::output_of({BMS_TOOL, "image", "loader", image_of(images::Image::loader), "--key", product.string() + ".pub",
                       "--out", loader});
  }
  files::TemporaryFolder folder_;
};

class LoaderTest : public ::testing::Test {
 protected:
  /// bms update, while the battery runs. Returns its JSON.
  nlohmann::json update(const fs::path& file, int expected_exit = 0) {
    images::ChildProcess tool({BMS_TOOL, "update", std::string("slcan:") + battery.line(), file.string(), "--wait",
                               "100", "--json", (folder.path() / "json").string()},
                              folder.path() / "log");
    EXPECT_TRUE(battery.run_until([&] { return !tool.running(); }, 150));
    EXPECT_EQ(tool.wait(), expected_exit) << files::read_file(folder.path() / "log");
    return nlohmann::json::parse(files::read_file(folder.path() / "json"));
  }
  /// bms update of a table of trucks. Returns state and version of each truck, in words.
  std::string update_depot(const fs::path& file, int expected_exit) {
    images::ChildProcess tool(
        {BMS_TOOL, "update", (folder.path() / "depot.csv").string(), file.string(), "--wait", "100", "--out",
         (folder.path() / "runs.csv").string(), "--json", (folder.path() / "json").string()},
        folder.path() / "log");
    EXPECT_TRUE(battery.run_until([&] { return !tool.running(); }, 150));
    EXPECT_EQ(tool.wait(), expected_exit) << files::read_file(folder.path() / "log");
    const auto result = nlohmann::json::parse(files::read_file(folder.path() / "json"));
    std::string text;
    for (const auto& truck : result.at("trucks"))
      text += fmt::format("{} {} {};", truck.at("truck").get<std::string>(), truck.at("state").get<std::string>(),
                          truck.at("runs").get<std::string>());
    return text;
  }

  files::TemporaryFolder folder;
  EmulatedBattery battery{Depot::get().loader};
};

TEST_F(LoaderTest, AnEmptyBatteryWaitsForItsFirstImageAndRunsIt) {
  const auto result = update(Depot::get().release("0.2.0"));
  EXPECT_EQ(result.at("result"), "done");
  EXPECT_EQ(result.at("to"), "0.2.0");
  battery.cut_power();
  EXPECT_TRUE(battery.run_until([&] { return !battery.last_frame_of("180").empty(); }, 20)) << "the application runs";
}

TEST_F(LoaderTest, TheSecondImageGoesToTheOtherSlotAndTheFirstOneStays) {
  ASSERT_EQ(update(Depot::get().release("0.2.0")).at("result"), "done");
  const std::string first = battery.slot(0);
  const auto result = update(Depot::get().release("0.3.0"));
  EXPECT_EQ(result.at("result"), "done");
  EXPECT_EQ(result.at("from"), "0.2.0");
  EXPECT_EQ(result.at("to"), "0.3.0");
  EXPECT_TRUE(battery.slot(0) == first);
  EXPECT_EQ(update(Depot::get().release("0.4.0")).at("from"), "0.3.0");  // overwrites slot A
  EXPECT_FALSE(battery.slot(0) == first);
}

TEST_F(LoaderTest, ADepotIsUpdatedOneTruckAtATimePerBusAndContinues) {
  files::write_file(
      folder.path() / "depot.csv",
      fmt::format("truck,bus,key\nnorth,slcan:{0},\neast,slcan:/dev/no_adapter,\nsouth,slcan:{0},\n", battery.line()));
  const fs::path release = Depot::get().release("0.2.0");
  EXPECT_EQ(update_depot(release, 1), "north done 0.2.0;east refused ;south waiting ;");
  const std::string first = files::read_file(folder.path() / "runs.csv");
  EXPECT_NE(first.find("/dev/no_adapter"), std::string::npos) << first;

  // the next truck on this bus: its battery is empty
  const std::string of_north = battery.slot(0);
  for (const unsigned slot : {0U, 1U}) battery.write_slot(slot, std::string(application_slot_bytes, '\xFF'));
  battery.cut_power();
  EXPECT_EQ(update_depot(release, 1), "north done 0.2.0;east refused ;south done 0.2.0;");
  EXPECT_TRUE(battery.slot(0).substr(0, 4'096) == of_north.substr(0, 4'096)) << "the same image";

  // nothing is left to do on this bus
  const unsigned starts = battery.starts();
  EXPECT_EQ(update_depot(release, 1), "north done 0.2.0;east refused ;south done 0.2.0;");
  EXPECT_EQ(battery.starts(), starts);
}

TEST_F(LoaderTest, WhatIsRefusedHasItsReasonAndChangesNothing) {
  ASSERT_EQ(update(Depot::get().release("0.2.0", 5)).at("result"), "done");
  const std::string runs = battery.slot(0);
  const auto refused = [&](const fs::path& file) {
    const std::string reason = update(file, 1).at("reason");
    EXPECT_TRUE(battery.slot(0) == runs) << reason;
    return reason;
  };
  EXPECT_EQ(refused(Depot::get().release("0.3.0", 5, Depot::get().other)), words_for(Refusal::unknown_key));
  EXPECT_EQ(refused(Depot::get().release("0.3.0", 4)), words_for(Refusal::older_security));
  EXPECT_EQ(refused(Depot::get().release("0.2.0", 5)), words_for(Refusal::already_running));
  EXPECT_EQ(refused(Depot::get().release("0.3.0", 5, {}, "microbit")),
            "the image is for microbit, the battery is a "
            "netduinoplus2");
}

}  // namespace
}  // namespace bms::boot
