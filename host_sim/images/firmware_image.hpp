// Firmware images, built on demand: one per board and cell file, stored under build/.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "files/cell_file.hpp"
#include "images/source_tree.hpp"

namespace bms::images {

/// Purpose of an image: the end of its name after "bms_<board>" (cmake/firmware.cmake). slot_a to remote_slot_b are the
/// application and the remote image, linked for a slot of the boot loader (BMS_SLOT).
enum class Image {
  application,
  remote,
  remote_product,
  replay,
  hil,
  bench,
  fault,
  pack,
  protection,
  filter_forms,
  loader,
  slot_a,
  slot_b,
  remote_slot_a,
  remote_slot_b
};

/// Builds `image` of `board` with the tables of `cell`, if it is not there yet, and returns its path. vehicle_profile:
/// BMS_VEHICLE_PROFILE of cmake/firmware.cmake. cells: BMS_CELLS; 0 for the board's own number. Needs the source tree,
/// CMake and the cross compiler of the board. Throws BadInput if they are missing or the board does not measure this
/// number of cells, and std::runtime_error if the build fails.
std::filesystem::path firmware_image(const std::string& board, const files::CellFile& cell, Image image,
                                     const std::string& vehicle_profile = "none", std::size_t cells = 0);

/// The same of other sources.
std::filesystem::path firmware_image(const SourceTree& sources, const std::string& board, const files::CellFile& cell,
                                     Image image, const std::string& vehicle_profile = "none", std::size_t cells = 0);

/// Names of all boards, in alphabetical order.
std::vector<std::string> board_names();

/// Value of a variable in board.cmake. Throws BadInput if there is no such board, std::runtime_error if board.cmake
/// does not set the variable.
std::string board_setting(const std::string& board, const std::string& name);

/// The image for the chip of the board. If the board is also emulated, its other images run in the emulator only.
Image chip_image(const std::string& board);

/// Number of cells in series that a board measures if no other is chosen, from its board.cmake. Throws BadInput if
/// there is no such board.
std::size_t board_cells(const std::string& board);

}  // namespace bms::images
