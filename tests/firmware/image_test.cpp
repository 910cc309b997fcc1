// The image as a file: the same sources give the same bytes, and its bill of materials agrees with the linker's map.
#include <map>
#include <regex>
#include <set>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "files/cell_file.hpp"
#include "files/temporary_folder.hpp"
#include "files/text_file.hpp"
#include "images/child_process.hpp"
#include "images/firmware_image.hpp"

namespace bms::firmware {
namespace {

namespace fs = std::filesystem;

/// Builds a copy of the sources in another folder. Without a compiler cache, because a cached result proves nothing.
TEST(Image, HasTheSameBytesFromAnotherFolder) {
  const auto here =
      images::firmware_image("stm32f405_forklift", files::read_cell("table9"), images::Image::application);
  const files::TemporaryFolder folder;
  const fs::path sources = folder.path() / "other sources", build = folder.path() / "other build";
  fs::create_directory(sources);
  for (const char* name :
       {"CMakeLists.txt", "cmake", "boards", "hal", "firmware", "estimator", "model", "arithmetic", "measurement"}) {
    fs::copy(fs::path(BMS_SOURCE_DIR) / name, sources / name, fs::copy_options::recursive);
  }
  images::output_of({"cmake", "-S", sources, "-B", build, "-G", "Ninja", "-DBMS_BOARD=stm32f405_forklift",
                     "-DBMS_MBEDTLS=" BMS_SOURCE_DIR "/build/mbedtls", "--toolchain",
                     sources / "cmake/toolchain-arm-none-eabi.cmake", "-DBMS_CELL_HEADER_TOOL=" BMS_CELL_HEADER_TOOL});
  images::output_of({"cmake", "--build", build, "--target", "bms_stm32f405_forklift.elf"});
  const std::string there = files::read_file(build / "bms_stm32f405_forklift.elf");
  EXPECT_EQ(files::sha256(files::read_file(here)), files::sha256(there));
  EXPECT_EQ(files::read_file(fs::path(here).replace_extension(".cdx.json")),
            files::read_file(build / "bms_stm32f405_forklift.cdx.json"));
  EXPECT_EQ(there.find(folder.path().filename().string()), std::string::npos);
  EXPECT_EQ(there.find(BMS_SOURCE_DIR), std::string::npos);
}

/// Linked members of each archive, according to the map.
std::map<std::string, std::set<std::string>> members_in(const std::string& map) {
  std::map<std::string, std::set<std::string>> found;
  static const std::regex member("/([^/ ()]*\\.a)\\(([^)]*)\\)");
  for (std::sregex_iterator it(map.begin(), map.end(), member), end; it != end; ++it) found[(*it)[1]].insert((*it)[2]);
  return found;
}

TEST(BillOfMaterials, NamesEveryArchiveAndMemberOfTheLinkersMapWithVersionAndLicence) {
  const files::CellFile cell = files::read_cell("table9");
  for (const std::string& board : images::board_names()) {
    const fs::path image = images::firmware_image(board, cell, images::chip_image(board));
    const auto bom = nlohmann::json::parse(files::read_file(fs::path(image).replace_extension(".cdx.json")));
    EXPECT_EQ(bom.at("bomFormat"), "CycloneDX");
    EXPECT_EQ(bom.at("specVersion"), "1.5");
    const auto& self = bom.at("metadata").at("component");
    EXPECT_EQ(self.at("type"), "firmware");
    EXPECT_EQ(self.at("hashes")[0].at("content"), files::sha256(files::read_file(image)));
    std::map<std::string, std::set<std::string>> named;
    std::set<std::string> references;
    bool has_cell = false;
    for (const auto& c : bom.at("components")) {
      EXPECT_TRUE(references.insert(c.at("bom-ref")).second) << c;
      if (c.at("type") == "data") {
        has_cell = true;
        const std::string hash = c.at("hashes")[0].at("content");
        EXPECT_EQ(hash, files::sha256(cell.text));
        EXPECT_EQ(std::stoul(hash.substr(0, 8), nullptr, 16), cell.hash) << "the hash in the message Identity";
        continue;
      }
      EXPECT_EQ(c.at("type"), "library");
      EXPECT_FALSE(c.at("licenses").empty());
      EXPECT_TRUE(std::regex_match(c.at("version").get<std::string>(), std::regex("[0-9]+(\\.[0-9]+)+"))) << c;
      if (!c.contains("properties")) continue;  // headers
      for (const auto& p : c.at("properties")) named[c.at("bom-ref")].insert(p.at("value"));
    }
    EXPECT_TRUE(has_cell);
    const std::string map = files::read_file(fs::path(image).replace_extension(".map"));
    EXPECT_EQ(named, members_in(map)) << board;
    EXPECT_FALSE(named.empty());
    for (const auto& d : bom.at("dependencies")[0].at("dependsOn")) EXPECT_TRUE(references.contains(d)) << d;
    for (const auto& p : self.at("properties")) {
      const std::string source = p.at("value");
      EXPECT_TRUE(fs::exists(fs::path(BMS_SOURCE_DIR) / source)) << source;
      EXPECT_THAT(map, ::testing::HasSubstr(source + ".obj"));
    }
    EXPECT_GT(self.at("properties").size(), 10U);
  }
}

}  // namespace
}  // namespace bms::firmware
