// Images of a board with other words than those of its board.cmake.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "files/cell_file.hpp"

namespace bms::images {

/// Options of CMake (cmake/firmware.cmake), and a name for their build folders: other options need another name.
struct Choice {
  std::string name;
  std::vector<std::string> options;
};

/// The application of `board` with these options, built if it is not there yet. Throws as firmware_image().
std::filesystem::path chosen_image(const std::string& board, const files::CellFile& cell, const Choice& choice);

}  // namespace bms::images
