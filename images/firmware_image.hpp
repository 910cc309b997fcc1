// Firmware images made on demand: one per board and cell file, kept under build/.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "files/cell_file.hpp"

namespace bms::images {

/// What an image is for: its end after "bms_<board>" (cmake/firmware.cmake).
enum class Image { application, remote, replay, hil, bench, fault, pack, protection };

/// `image` of `board` with the tables of `cell`, built if it is not there yet. Needs the source tree, CMake and the
/// board's cross compiler; throws BadInput when they are missing and std::runtime_error when the build fails.
/// vehicle_profile: as BMS_VEHICLE_PROFILE of cmake/firmware.cmake.
std::filesystem::path firmware_image(const std::string& board, const files::CellFile& cell, Image image,
                                     const std::string& vehicle_profile = "none");

/// Names of the folders in boards/ that are one, in their order.
std::vector<std::string> board_names();

/// What board.cmake sets a variable to. Throws BadInput when there is no such board, std::runtime_error when it does
/// not set it.
std::string board_setting(const std::string& board, const std::string& name);

/// What goes onto the board's chip; where the board is also emulated its other images run in the emulator only.
Image chip_image(const std::string& board);

/// Cells in series that a board measures, as its board.cmake says. Throws BadInput when there is no such board.
std::size_t board_cells(const std::string& board);

}  // namespace bms::images
