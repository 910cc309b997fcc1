// An image as a file: the same bytes from the same sources.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "host_sim/cell_file.hpp"
#include "host_sim/child_process.hpp"
#include "host_sim/firmware_image.hpp"
#include "host_sim/text_file.hpp"

namespace bms {
namespace {

namespace fs = std::filesystem;

/// From a copy of the sources in another place, without a compiler cache: one that answered would only show that it is the same as itself.
TEST(Image, HasTheSameBytesFromAnotherFolder) {
  const auto here = firmware_image("stm32f405_forklift", read_cell("table9"), Image::application);
  const TemporaryFolder folder;
  const fs::path sources = folder.path() / "other sources", build = folder.path() / "other build";
  fs::create_directory(sources);
  for (const char* name : {"CMakeLists.txt", "cmake", "boards", "can", "hal", "storage", "firmware", "estimator", "model", "protection"}) {
    fs::copy(fs::path(BMS_SOURCE_DIR) / name, sources / name, fs::copy_options::recursive);
  }
  output_of({"cmake", "-S", sources, "-B", build, "-G", "Ninja", "-DBMS_BOARD=stm32f405_forklift", "-DCCACHE=CCACHE-NOTFOUND", "--toolchain", sources / "cmake/toolchain-arm-none-eabi.cmake",
             "-DBMS_CELL_HEADER_TOOL=" BMS_CELL_HEADER_TOOL});
  output_of({"cmake", "--build", build, "--target", "bms_stm32f405_forklift.elf"});
  const std::string there = read_file(build / "bms_stm32f405_forklift.elf");
  EXPECT_EQ(sha256(read_file(here)), sha256(there));
  EXPECT_EQ(there.find(folder.path().filename().string()), std::string::npos);
  EXPECT_EQ(there.find(BMS_SOURCE_DIR), std::string::npos);
}

}  // namespace
}  // namespace bms
